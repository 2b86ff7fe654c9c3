"""Fleet command that is killed and started again, and the same manifest on a Ray cluster."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import polars as pl

COMMAND = [sys.executable, "-c", "from armgap.cli import main; main()", "fleet"]
LOCAL, ON_RAY = "local", "ray"


def killed_and_restarted(folder: Path, kill_after: int, workers: int, options: list[str]) -> str:
    """Start the fleet command, kill it when `kill_after` entries have results, start it again; return a text on what was repeated."""
    words = [*COMMAND, str(folder / "manifest.csv"), "-o", str(folder / LOCAL), "--workers", str(workers), *options]
    diagnoses = folder / LOCAL / "diagnoses"
    began = time.perf_counter()
    running = subprocess.Popen(words, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while len(_standing(diagnoses)) < kill_after and running.poll() is None:
        time.sleep(0.2)
    os.killpg(running.pid, signal.SIGKILL)
    running.wait()
    before = _standing(diagnoses)
    done = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    after = _standing(diagnoses)
    repeated = [name for name, changed in before.items() if after.get(name) != changed]
    left = [p.name for p in diagnoses.iterdir() if p.suffix != ".json"]
    return (
        f"killed when {len(before)} results stood; {len(after)} after the restart, {len(repeated)} of the former computed again, "
        f"files left over by the kill: {len(left)}; {time.perf_counter() - began:.0f} s\n{done}"
    )


def _standing(diagnoses: Path) -> dict[str, int]:
    return {p.name: p.stat().st_mtime_ns for p in diagnoses.glob("*.json")} if diagnoses.is_dir() else {}


def on_ray(folder: Path, nodes: int, most: int | None, options: list[str]) -> str:
    """Run the manifest, or its first entries, on a Ray cluster of `nodes` nodes; return a text that compares its tables with the local ones."""
    lines = (folder / "manifest.csv").read_text(encoding="utf-8").splitlines()
    (folder / "ray.csv").write_text("\n".join(lines[: None if most is None else most + 1]) + "\n", encoding="utf-8")
    with _cluster(nodes) as address:
        began = time.perf_counter()
        words = [
            *COMMAND,
            str(folder / "ray.csv"),
            "-o",
            str(folder / ON_RAY),
            "--engine",
            "ray",
            "--address",
            address,
            *options,
        ]
        done = subprocess.run(words, capture_output=True, text=True, check=True).stdout
        seconds = time.perf_counter() - began
    return f"{done}{nodes} nodes, {seconds:.0f} s\n{compared(folder / LOCAL, folder / ON_RAY)}"


@contextmanager
def _cluster(nodes: int) -> Iterator[str]:
    """Yield the address of a Ray cluster of `nodes` nodes with one processor each, which is stopped at the end."""
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    try:
        for _ in range(nodes - 1):
            cluster.add_node(num_cpus=1)
        cluster.wait_for_nodes()
        yield cluster.address
    finally:
        cluster.shutdown()


def compared(whole: Path, part: Path) -> str:
    """Return a text that says whether two fleets' tables agree, apart from times of computation, on the robots of `part`."""
    lines = []
    robots = pl.read_parquet(part / "summary.parquet")["robot"].unique().to_list()
    for name in ("summary", "parameters"):
        one, other = (
            pl.read_parquet(folder / f"{name}.parquet")
            .filter(pl.col("robot").is_in(robots))
            .drop("seconds", strict=False)
            for folder in (whole, part)
        )
        lines.append(f"{name}: {other.height} rows, {'the same' if one.equals(other) else 'NOT the same'}")
    return "\n".join(lines)
