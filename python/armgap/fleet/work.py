"""Diagnosis of one entry of a fleet in its own process; a failure becomes one sentence and does not end the fleet."""

from __future__ import annotations

import hashlib
import json
import signal
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import polars as pl

from armgap._native import __version__
from armgap.errors import ArmgapError
from armgap.fleet.manifest import Entry, is_url

__all__ = ["Outcome", "answer", "answer_within", "content_key", "took_too_long"]

Outcome = dict[str, Any]
"""Outcome of an entry: ``diagnosis`` (JSON text), ``error`` (one line), or ``lost`` (reason why there is neither); and ``seconds``."""
#: Time between alarms at the time limit [s]; they repeat, as an exception raised in a destructor or a callback of another library is lost.
_ALARM_AGAIN_S = 0.5
_READERS: dict[str, Callable[[str], pl.DataFrame]] = {".parquet": pl.read_parquet, ".csv": pl.read_csv}


def content_key(entry: Entry, settings: Mapping[str, Any]) -> str:
    """Return a hash of all that an entry's result depends on: content of its files (of a URL the address), settings and version.

    A file that cannot be read counts by its name, so that the entry is tried again once the file exists.
    """
    mark = hashlib.sha256(json.dumps([__version__, dict(settings), len(entry.logs)], sort_keys=True).encode())
    for place in entry.files:
        mark.update(_digest(place))
    return mark.hexdigest()[:24]


def _digest(place: str) -> bytes:
    if is_url(place):
        return hashlib.sha256(place.encode()).digest()
    try:
        with Path(place).open("rb") as file:
            return hashlib.file_digest(file, "sha256").digest()
    except OSError:
        return hashlib.sha256(f"missing {place}".encode()).digest()


def answer(entry: Entry, settings: Mapping[str, Any]) -> Outcome:
    """Diagnose one entry of a fleet and return its outcome.

    Parameters
    ----------
    entry : Entry
        Entry with the arm file and the logs.
    settings : mapping
        Keyword arguments of `armgap.diagnose`.
    """
    from armgap.diagnosis.diagnosis import diagnose

    start = time.perf_counter()
    try:
        logs, holdout = ([_source(place) for place in places] for places in (entry.logs, entry.holdout))
        found = diagnose(logs, Path(entry.arm), holdout=holdout or None, **settings)
        outcome: Outcome = {"diagnosis": found.to_json()}
    except ArmgapError as error:
        outcome = {"error": str(error)}
    except Exception as error:  # an error in one entry must not end the others; it is stated in the entry's row
        outcome = {"error": f"{type(error).__name__}: {' '.join(str(error).split())}"}
    return {**outcome, "seconds": time.perf_counter() - start}


def took_too_long(limit_s: float) -> Outcome:
    """Return the outcome of an entry that was stopped after `limit_s` [s]; the next run tries the entry again."""
    return {"lost": f"took longer than {limit_s:g} s", "seconds": limit_s}


class _TimeIsUp(BaseException):
    """Exception of the alarm at the time limit; no `Exception`, so that no handler takes it for a defect of the entry."""


def answer_within(entry: Entry, settings: Mapping[str, Any], limit_s: float) -> Outcome:
    """Diagnose an entry in the main thread of a process, for at most `limit_s` [s]; without limit on systems without ``SIGALRM`` (Windows).

    Parameters
    ----------
    entry, settings
        Entry of the manifest, and keyword arguments of `armgap.diagnose`.
    limit_s : float
        Time limit [s], above 0.
    """
    if not hasattr(signal, "SIGALRM"):
        return answer(entry, settings)

    def stop(*_: object) -> None:
        raise _TimeIsUp

    before = signal.signal(signal.SIGALRM, stop)
    try:
        signal.setitimer(signal.ITIMER_REAL, limit_s, _ALARM_AGAIN_S)
        return answer(entry, settings)
    except _TimeIsUp:
        return took_too_long(limit_s)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _source(place: str) -> Any:
    """Return a path as it is; for a URL the table that polars reads from it."""
    if not is_url(place):
        return Path(place)
    suffix = Path(place.partition("?")[0]).suffix.lower()
    if suffix not in _READERS:
        raise ArmgapError(f"`{place}` is no log that is read from a URL", remedy=f"use {' or '.join(_READERS)}")
    return _READERS[suffix](place)
