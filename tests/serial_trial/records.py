"""Records of answers to many cases, computed in processes of one thread each and written as they arrive."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import click

#: Environment variables that set the number of threads of a process.
THREADS = ("RAYON_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS")


def collect(
    answer: Callable[[int, int], dict[str, Any]],
    seed: int,
    numbers: Iterable[int],
    *,
    jobs: int,
    file: Path | None,
    timeout: float | None = None,
) -> list[dict[str, Any]]:
    """Return the records of the answers to the cases `numbers` of a seed, in their order.

    Parameters
    ----------
    answer : callable
        Function of a seed and a case's number that returns the record; another process calls it, so it must be picklable.
    jobs : int
        Number of parallel processes.
    file : Path or None
        File for the records, one JSON object a line.
    timeout : float, optional
        Longest time for a case [s].

    Notes
    -----
    A case that fails does not end the run; its record has ``number``, ``seed`` and ``failed``, the error's type and text.
    """
    os.environ.update(dict.fromkeys(THREADS, "1"))
    from pebble import ProcessPool

    records: list[dict[str, Any]] = []
    numbers = list(numbers)
    with ProcessPool(jobs) as pool:
        tasks = [pool.schedule(answer, args=[seed, number], timeout=timeout) for number in numbers]
        for number, task in zip(numbers, tasks, strict=True):
            try:
                record = task.result()
            except Exception as error:  # a failure is recorded as an answer
                record = {"number": number, "seed": seed, "failed": f"{type(error).__name__}: {error}"}
            records.append(record)
            if file is not None:
                file.write_text("".join(json.dumps(r) + "\n" for r in records))
            click.echo(f"{len(records)} of {len(numbers)}", err=True)
    return records
