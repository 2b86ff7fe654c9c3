"""Speed of one worker and of two on the same entries, in turns; and processor time of the fleet per entry apart from diagnosis.

The machine may be shared: speeds are compared within one round, and the median over the rounds is reported. The fleet's own cost is measured as
processor time in two ways: entries that fail at once, minus the start of a worker; and a run over a folder that has all results, which
hashes the files, reads the diagnoses and writes tables and page.
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

from .running import LOCAL

Settings = dict[str, Any]


@dataclass(frozen=True)
class Cost:
    """Wall time and processor time of a fleet's run [s], and sum of the wall times of its entries' diagnoses [s]."""

    wall_s: float
    cpu_s: float
    entries_s: float


def scaling(folder: Path, entries: int, pairs: int, settings: Settings) -> str:
    """Return the table of the rounds' times with one worker and with two."""
    chosen = read_manifest(folder / "manifest.csv")
    sound = [entry for entry in chosen if all(Path(place).is_file() for place in entry.files)][:entries]
    place = folder / "scaling"
    lines = [
        f"{len(sound)} entries; seconds",
        f"{'round':>6} {'1 worker':>9} {'2 workers':>10} {'ratio':>6} {'busy':>6} {'CPU of 2 over 1':>16}",
    ]
    ratios, busy, cpu = [], [], []
    for number in range(pairs):
        one, two = (_run(sound, place, workers, settings) for workers in (1, 2))
        ratios.append(one.wall_s / two.wall_s)
        busy.append(two.entries_s / (2.0 * two.wall_s))
        cpu.append(two.cpu_s / one.cpu_s)
        lines.append(
            f"{number + 1:6d} {one.wall_s:9.1f} {two.wall_s:10.1f} {ratios[-1]:6.2f} {busy[-1]:6.2f} {cpu[-1]:16.2f}"
        )
    lines += [
        f"two workers are {np.median(ratios):.2f} times as fast as one (median; {min(ratios):.2f} to {max(ratios):.2f})",
        f"and busy {100 * np.median(busy):.0f} % of the time",
    ]
    return "\n".join(lines)


def overhead(folder: Path, failing: int, rounds: int, settings: Settings) -> str:
    """Return a text on the fleet's processor time per entry apart from diagnosis; `folder` must hold all results for these settings."""
    entries = read_manifest(folder / "manifest.csv")
    place = folder / "scaling"
    handing, standing = [], []
    for _ in range(rounds):
        few, many = (_run([_failing(i) for i in range(count)], place, 1, settings).cpu_s for count in (2, failing))
        handing.append(1e3 * (many - few) / (failing - 2))
        cpu = _cpu()
        if run_fleet(entries, folder / LOCAL, settings).answered:
            raise RuntimeError("the folder does not hold all results for these settings")
        standing.append(1e3 * (_cpu() - cpu) / len(entries))
    return "\n".join(
        f"{what}: {np.median(found):.1f} ms of processor time per entry (median of {rounds}; {min(found):.1f} to {max(found):.1f})"
        for what, found in (("handing out and keeping", handing), ("hashes, tables and page", standing))
    )


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
