"""One worker and two, in turns on the same entries; and what the fleet itself costs per entry.

The machine may be shared: speeds are compared within one round, and the median of the rounds counts. Costs are processor time: of this
process and its workers, less that of the same entries diagnosed here without a fleet, less that of starting a worker (a fleet of entries
that fail at once).
"""

from __future__ import annotations

import resource
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from armgap.fleet import Entry, read_manifest, run_fleet
from armgap.fleet.work import answer

Settings = dict[str, Any]


@dataclass(frozen=True)
class Cost:
    """Wall time and processor time of a run [s], and the entries' own wall time, summed."""

    wall_s: float
    cpu_s: float
    entries_s: float


def scaling(folder: Path, entries: int, pairs: int, settings: Settings) -> str:
    """Return the table of the rounds."""
    chosen = read_manifest(folder / "manifest.csv")
    sound = [entry for entry in chosen if all(Path(place).is_file() for place in entry.files)][:entries]
    place = folder / "scaling"
    lines = [
        f"{len(sound)} entries; seconds",
        f"{'round':>6} {'1 worker':>9} {'2 workers':>10} {'ratio':>6} {'busy':>6} {'CPU of 2 over 1':>16}",
    ]
    ratios, busy, cpu, overheads = [], [], [], []
    for number in range(pairs):
        one, two = (_run(sound, place, workers, settings) for workers in (1, 2))
        plain = _plain(sound, settings)
        start = _run([_failing(i) for i in range(2)], place, 1, settings).cpu_s
        ratios.append(one.wall_s / two.wall_s)
        busy.append(two.entries_s / (2.0 * two.wall_s))
        cpu.append(two.cpu_s / one.cpu_s)
        overheads.append(1e3 * (one.cpu_s - start - plain) / len(sound))
        lines.append(
            f"{number + 1:6d} {one.wall_s:9.1f} {two.wall_s:10.1f} {ratios[-1]:6.2f} {busy[-1]:6.2f} {cpu[-1]:16.2f}"
        )
    lines += [
        f"two workers are {np.median(ratios):.2f} times as fast as one (median; {min(ratios):.2f} to {max(ratios):.2f})",
        f"and busy {100 * np.median(busy):.0f} % of the time",
        f"the fleet costs {np.median(overheads):.0f} ms of processor time per entry (median; {min(overheads):.0f} to {max(overheads):.0f}), "
        f"of {1e3 * plain / len(sound):.0f} ms, and {start:.1f} s to start",
    ]
    return "\n".join(lines)


def _failing(number: int) -> Entry:
    return Entry(f"none {number}", f"missing-{number}.toml", (f"missing-{number}.csv",), (), "", number + 1)


def _cpu() -> float:
    return sum(
        u.ru_utime + u.ru_stime for u in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def _run(entries: list[Entry], place: Path, workers: int, settings: Settings) -> Cost:
    shutil.rmtree(place, ignore_errors=True)
    cpu, wall = _cpu(), time.perf_counter()
    fleet = run_fleet(entries, place, settings, workers=workers)
    cost = time.perf_counter() - wall, _cpu() - cpu
    seconds = fleet.summary.unique(["robot", "time"])["seconds"].sum()
    shutil.rmtree(place, ignore_errors=True)
    return Cost(*cost, float(seconds))


def _plain(entries: list[Entry], settings: Settings) -> float:
    """Processor time of the diagnoses alone [s]."""
    cpu = time.process_time()
    for entry in entries:
        answer(entry, settings)
    return time.process_time() - cpu
