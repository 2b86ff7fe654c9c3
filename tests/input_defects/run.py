"""Command that makes cases, puts defects into them, and records the answers: ``python -m tests.input_defects.run --help``."""

from __future__ import annotations

import argparse
import itertools
import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import TimeoutError as TookTooLong
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from armgap.trial.simulation.arms import MODELS
from armgap.trial.simulation.engine import worker_pool
from armgap.trial.trial import Plan

from .answering import WHOLE, Record, about, answer, answer_floor, build
from .defects import REPAIRED, chosen
from .making import make, plans, read, trial_plans

MODES = ("defects", "clean", "repaired", "floor")
#: Time limits for one answer, and for making one case [s].
LIMIT, MAKING = 600.0, 1200.0
#: Environment variables that limit the threads of libraries when these are loaded: one thread in each process.
THREADS = ("RAYON_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS")


@dataclass(frozen=True)
class Task:
    """One case to be diagnosed with one defect (`WHOLE` for none)."""

    case: str
    defect: str


def main(words: list[str] | None = None) -> None:
    """Read the options, make the missing cases, and record the answers to questions that have none yet."""
    options = _options().parse_args(words)
    models = options.models.split(",") if options.models else list(MODELS)
    unknown = [m for m in models if m not in MODELS]
    if unknown:
        sys.exit(f"--models: no model `{unknown[0]}`; known are {', '.join(MODELS)}")
    try:
        names = [d.name for d in chosen(options.defects.split(",") if options.defects else [])]
    except ValueError as error:
        sys.exit(f"--defects: {error}")
    os.environ.update(dict.fromkeys(THREADS, "1"))
    cases = dict(itertools.islice(_plans(options, models).items(), options.first))
    made = _made(cases, options.cache, options.jobs)
    done = set() if options.again else _done(options)
    tasks = [t for t in _tasks(options, made, names) if t not in done]
    ask = answer_floor if options.mode == "floor" else answer
    print(f"{len(made)} of {len(cases)} cases made; {len(tasks)} to be answered", file=sys.stderr)
    with options.output.open("a", encoding="utf-8") as out:
        for count, record in enumerate(_answers(tasks, options, ask), start=1):
            out.write(json.dumps({"mode": options.mode, "seed": options.seed, **record}) + "\n")
            out.flush()
            print(f"\r{count}/{len(tasks)}", end="", file=sys.stderr)
    print(file=sys.stderr)


def _options() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.input_defects.run", description=__doc__)
    parser.add_argument("--mode", choices=MODES, default="defects")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--cases", type=int, required=True, metavar="N")
    parser.add_argument("--first", type=int, metavar="K", help="only the first of the N cases; all by default")
    parser.add_argument(
        "--models", help="machines, with commas; all by default (the trial's own shares in other modes)"
    )
    parser.add_argument(
        "--defects", help="beginnings of names, with commas; all by default (modes defects and repaired)"
    )
    parser.add_argument(
        "--hidden", type=float, default=0.5, metavar="SHARE", help="of cases with an effect (mode defects)"
    )
    parser.add_argument("--duration", type=float, default=10.0, metavar="S", help="length of each log")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--limit", type=float, default=LIMIT, metavar="S", help="longest time for one answer")
    parser.add_argument("--cache", type=Path, required=True, metavar="DIR", help="where cases are kept")
    parser.add_argument("--again", action="store_true", help="ask again what stands in the output")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="JSONL", help="appended to")
    return parser


def _plans(options: argparse.Namespace, models: list[str]) -> dict[str, Plan]:
    if options.mode == "defects":
        return plans(options.seed, options.cases, models, options.hidden, options.duration)
    drawn = trial_plans(options.seed, options.cases, options.duration)
    return {name: p for name, p in drawn.items() if p.model in models}


def _made(cases: dict[str, Plan], cache: Path, jobs: int) -> list[str]:
    """Make the missing cases; return the names of all cases for which the generator found a motion."""
    with worker_pool(jobs) as pool:
        futures = {name: pool.schedule(make, args=[p, cache / name], timeout=MAKING) for name, p in cases.items()}
        return [name for name, future in futures.items() if future.result()]


def _tasks(options: argparse.Namespace, cases: list[str], names: list[str]) -> Iterator[Task]:
    for case in cases:
        if options.mode != "defects":
            yield Task(case, WHOLE)
        if options.mode == "defects":
            yield from (Task(case, name) for name in names)
        elif options.mode == "repaired":
            rng = np.random.default_rng([options.seed, int(case.split("-")[3])])
            # One variant of each kind is drawn even if few are asked for, so that the draws do not depend on the selection.
            drawn = [str(rng.choice(variants)) for variants in REPAIRED.values()]
            yield from (Task(case, name) for name in drawn if name in names)


def _done(options: argparse.Namespace) -> set[Task]:
    """Return the tasks that this build has answered in the output file with the same mode and seed; failed ones are not among them."""
    if not options.output.exists():
        return set()
    records = [json.loads(line) for line in options.output.read_text(encoding="utf-8").splitlines()]
    same = [r for r in records if (r["mode"], r["seed"], r.get("version")) == (options.mode, options.seed, build())]
    return {Task(r["case"], r["defect"]) for r in same if "failed" not in r}


def _answers(
    tasks: Iterable[Task], options: argparse.Namespace, ask: Callable[[str, str, int], Record]
) -> Iterator[Record]:
    with worker_pool(options.jobs) as pool:
        arguments = [(t, [str(options.cache / t.case), t.defect, options.seed]) for t in tasks]
        futures = [(t, pool.schedule(ask, args=args, timeout=options.limit)) for t, args in arguments]
        try:
            for task, future in futures:
                record = _result(task, future, options.limit)
                yield {**about(read(options.cache / task.case)), **record} if "failed" in record else record
        finally:
            pool.stop()


def _result(task: Task, future: Any, limit: float) -> Record:
    """Return the record of a finished task, or a record of the error or the exceeded time limit [s]."""
    from pebble import ProcessExpired

    failed: Record = {"case": task.case, "defect": task.defect}
    try:
        record: Record = future.result()
    except TookTooLong:
        return {**failed, "failed": f"took longer than {limit:g} s"}
    except ProcessExpired as end:
        return {**failed, "failed": f"its process ended with status {end.exitcode}"}
    except Exception as error:  # an error in one answer must not end the run; the task is counted as failed
        return {**failed, "failed": f"{type(error).__name__}: {error}"}
    return record


if __name__ == "__main__":
    main()
