"""Engines that diagnose the entries of a fleet: processes of this machine, or a Ray cluster; both yield outcomes as they arrive."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures import TimeoutError as TookTooLong
from importlib import import_module
from itertools import islice
from multiprocessing import get_context
from typing import Any

import pebble

from armgap.errors import ArmgapError, OptionError
from armgap.fleet.manifest import Entry
from armgap.fleet.work import Outcome, answer, answer_within, took_too_long
from armgap.workers import THREADS, one_thread

__all__ = ["ENGINES", "Engine", "EngineMissingError"]

# Function that diagnoses entries and yields each with its outcome as it arrives.
Engine = Callable[..., Iterator[tuple[Entry, Outcome]]]
# Entries per worker that are submitted at a time: enough that no worker waits, few enough that memory stays bounded.
_AHEAD = 2


class EngineMissingError(ArmgapError, ImportError):
    """Error: a package that the chosen engine needs is not installed."""

    def __str__(self) -> str:
        """Return the error as one line of text."""
        return str(self.args[0])


def local(
    entries: Sequence[Entry], settings: Mapping[str, Any], *, workers: int, limit_s: float, address: str | None
) -> Iterator[tuple[Entry, Outcome]]:
    """Diagnose entries in processes of this machine, one thread each; if one dies or takes too long, only its entry fails."""
    if address is not None:
        raise OptionError("--address is for --engine ray", remedy="leave it out")
    with one_thread(), pebble.ProcessPool(max_workers=workers, context=get_context("spawn")) as pool:

        def submit(entry: Entry) -> Future[Outcome]:
            future: Future[Outcome] = pool.schedule(answer, args=[entry, dict(settings)], timeout=limit_s)
            return future

        def result(future: Future[Outcome]) -> Outcome:
            try:
                return future.result()
            except TookTooLong:
                return took_too_long(limit_s)
            except pebble.ProcessExpired as end:
                return {"lost": f"its process ended with status {end.exitcode}", "seconds": 0.0}

        try:
            yield from _as_they_come(entries, workers, submit, result, _first)
        finally:
            pool.stop()


def ray(
    entries: Sequence[Entry], settings: Mapping[str, Any], *, workers: int, limit_s: float, address: str | None
) -> Iterator[tuple[Entry, Outcome]]:
    """Diagnose entries on the Ray cluster at `address`, or on one started on this machine. Paths have to be equal on all nodes."""
    cluster = _needed("ray", "--engine ray", "ray")
    threads = dict.fromkeys(THREADS, "1")
    options = {"address": address} if address else {"num_cpus": workers}
    cluster.init(
        **options,
        ignore_reinit_error=True,
        log_to_driver=False,
        runtime_env={"env_vars": threads},
        logging_level="ERROR",
    )
    remote = cluster.remote(num_cpus=1, max_retries=0)(answer_within)

    def result(reference: Any) -> Outcome:
        try:
            outcome: Outcome = cluster.get(reference)
        except cluster.exceptions.RayError as error:
            return {"lost": f"Ray: {' '.join(str(error).split())[:200]}", "seconds": 0.0}
        return outcome

    def first(references: Sequence[Any]) -> Any:
        return cluster.wait(list(references), num_returns=1)[0][0]

    try:
        most = workers if address is None else max(workers, int(cluster.cluster_resources().get("CPU", workers)))
        yield from _as_they_come(
            entries, most, lambda entry: remote.remote(entry, dict(settings), limit_s), result, first
        )
    finally:
        cluster.shutdown()


ENGINES: dict[str, Engine] = {"local": local, "ray": ray}
"""Engines of a fleet by name: functions that diagnose entries."""


def _as_they_come(
    entries: Sequence[Entry],
    workers: int,
    submit: Callable[[Entry], Any],
    result: Callable[[Any], Outcome],
    first: Callable[[Sequence[Any]], Any],
) -> Iterator[tuple[Entry, Outcome]]:
    waiting = iter(entries)
    running = {submit(entry): entry for entry in islice(waiting, _AHEAD * workers)}
    while running:
        done = first(list(running))
        entry = running.pop(done)
        running |= {submit(next_entry): next_entry for next_entry in islice(waiting, 1)}
        yield entry, result(done)


def _first(futures: Sequence[Future[Outcome]]) -> Future[Outcome]:
    return next(iter(wait(futures, return_when=FIRST_COMPLETED).done))


def _needed(package: str, work: str, extra: str) -> Any:
    try:
        return import_module(package)
    except ImportError:
        remedy = f"pip install 'armgap[{extra}]'"
        raise EngineMissingError(f"{work} needs {package}, which is not installed", remedy=remedy) from None
