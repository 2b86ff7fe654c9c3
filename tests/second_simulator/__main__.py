"""Make cases, diagnose them, print how often answers are right: ``python -m tests.second_simulator --help``."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import time
from pathlib import Path
from typing import Any

THREADS = ("RAYON_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS")


def main() -> None:
    """Read the options and run the requested step: make cases, diagnose them, or score the answers."""
    parser = argparse.ArgumentParser(prog="python -m tests.second_simulator", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    make = commands.add_parser("make", help="make cases")
    make.add_argument("folder", type=Path)
    make.add_argument("--seed", type=int, required=True)
    make.add_argument("--families", required=True, help="such as single=20,clutter=30")
    make.add_argument("--duration", type=float, default=10.0)
    ask = commands.add_parser("ask", help="diagnose the cases of a folder")
    ask.add_argument("folder", type=Path)
    ask.add_argument("-o", "--output", type=Path, required=True)
    ask.add_argument("--horizon", type=float, default=0.25)
    ask.add_argument("--only", default="", help="families, with commas")
    score = commands.add_parser("score", help="print the tables of an answer file")
    score.add_argument("answers", type=Path, nargs="+")
    score.add_argument("--cases", action="store_true", help="and every case that is not right")
    for command in (make, ask):
        command.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    os.environ.update(dict.fromkeys(THREADS, "1"))
    {"make": _make, "ask": _ask, "score": _score}[options.command](options)


def _make(options: argparse.Namespace) -> None:
    from pebble import ProcessPool

    from .cases import make

    wanted = [part.split("=") for part in options.families.split(",")]
    with ProcessPool(options.jobs) as pool:
        tasks = []
        for family, count in wanted:
            for i in range(int(count)):
                folder = options.folder / f"{family}-{options.seed}-{i:04d}"
                if not (folder / "key.json").exists():
                    shutil.rmtree(folder, ignore_errors=True)
                    number = sum(map(ord, family)) * 10_000 + i
                    tasks.append(pool.schedule(make, args=[(options.seed, number), family, folder, options.duration]))
        for task in tasks:
            task.result()
    print(f"{len(tasks)} cases made", file=sys.stderr)


def answer(folder: Path, horizon: float) -> dict[str, Any]:
    """Diagnose the case of a folder, with windows of `horizon` seconds, and return the record of the answer."""
    import armgap
    from armgap.check.contradiction import Refit

    key = json.loads((folder / "key.json").read_text())
    arm = armgap.Arm.read(folder / "arm.toml")
    logs = {p.stem: p for p in sorted(folder.glob("*.parquet"))}
    train, hold = ([str(p) for n, p in logs.items() if n.startswith(part)] for part in ("train", "holdout"))
    began = time.perf_counter()
    found = armgap.diagnose(train, arm, holdout=hold, horizon=horizon).to_dict()
    seconds = time.perf_counter() - began
    names = ("effect", "joint", "probability", "closed", "equivalents", "evidence", "log", "why", "parameters")
    causes, candidates = (
        [{k: c[k] for k in names if k in c} for c in found[part]] for part in ("causes", "candidates")
    )
    share = None
    if (folder / "without").is_dir():
        read = [[armgap.Log.read(folder / sub / f"{n}.parquet", arm=arm) for n in logs] for sub in (".", "without")]
        missed = [
            Refit.of(
                arm,
                [x for x in group if x.name.startswith("train")],
                [x for x in group if x.name.startswith("hold")],
                0.25,
            )
            for group in read
        ]
        relative = [float((m.error**2 / m.motion**2).mean()) for m in missed]
        share = 1.0 - relative[1] / relative[0]
    return {
        "case": folder.name, **{k: key[k] for k in ("family", "design", "effects", "clutter", "exact")}, "pushes": key.get("pushes", []),
        "share": share,
        "verdict": found["verdict"], "causes": causes, "candidates": candidates, "gap": found["gap"], "seconds": seconds,
        "unnamed": found["unnamed"], "checks": [c["check"] for c in found["checks"]], "where": found["where"][:2], "horizon": horizon,
        "parameters": found["parameters"], "theta": key.get("theta"), "strength": key.get("strength"),
    }  # fmt: skip


def _ask(options: argparse.Namespace) -> None:
    from pebble import ProcessPool

    folders = sorted(p.parent for p in options.folder.glob("*/key.json"))
    if options.only:
        folders = [f for f in folders if f.name.rsplit("-", 2)[0] in options.only.split(",")]
    done = set()
    if options.output.exists():
        done = {json.loads(line)["case"] for line in options.output.read_text().splitlines()}
    with ProcessPool(options.jobs) as pool, options.output.open("a") as out:
        tasks = [
            (f, pool.schedule(answer, args=[f, options.horizon], timeout=600)) for f in folders if f.name not in done
        ]
        for folder, task in tasks:
            try:
                record = task.result()
            except Exception as error:  # an error in one case must not end the run; the case is counted as failed
                record = {"case": folder.name, "failed": f"{type(error).__name__}: {error}"}
            out.write(json.dumps(record) + "\n")
            out.flush()


def _score(options: argparse.Namespace) -> None:
    from .scoring import report

    records = [json.loads(line) for path in options.answers for line in path.read_text().splitlines()]
    print(report(records, options.cases))


main()
