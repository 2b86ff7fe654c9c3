"""One entry diagnosed in a process of its own; what goes wrong with it is a sentence, not the end of the fleet."""

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
"""``diagnosis``, the JSON text, or ``error``, one line, or ``lost``, why there is neither; and ``seconds``."""
#: Time between alarms [s]: an exception raised inside a destructor or a callback of another library is swallowed there.
_ALARM_AGAIN_S = 0.5
_READERS: dict[str, Callable[[str], pl.DataFrame]] = {".parquet": pl.read_parquet, ".csv": pl.read_csv}


def content_key(entry: Entry, settings: Mapping[str, Any]) -> str:
    """Return what a result belongs to: the content of the files, the settings and the version; of a URL its text.

    A file that cannot be read counts by its name, so that the entry is tried again once it is there.
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
    """Diagnose an entry.

    Parameters
    ----------
    entry : Entry
        Arm and logs.
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
    except Exception as error:  # one entry must not end the others; what it was stands in its row
        outcome = {"error": f"{type(error).__name__}: {' '.join(str(error).split())}"}
    return {**outcome, "seconds": time.perf_counter() - start}


def took_too_long(limit_s: float) -> Outcome:
    """Return the outcome of an entry that was stopped after its time [s]; the next run tries it again."""
    return {"lost": f"took longer than {limit_s:g} s", "seconds": limit_s}


class _TimeIsUp(BaseException):
    """Raised by the alarm; no `Exception`, so that nothing on the way takes it for a defect of the entry."""


def answer_within(entry: Entry, settings: Mapping[str, Any], limit_s: float) -> Outcome:
    """Diagnose an entry in the main thread of a process, for so long at most [s]; without limit where there is no ``SIGALRM`` (Windows).

    Parameters
    ----------
    entry, settings
        As for `answer`.
    limit_s : float
        Above 0.
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
    """A path as it is; of a URL the table that polars reads there."""
    if not is_url(place):
        return Path(place)
    suffix = Path(place.partition("?")[0]).suffix.lower()
    if suffix not in _READERS:
        raise ArmgapError(f"`{place}` is no log that is read from a URL", remedy=f"use {' or '.join(_READERS)}")
    return _READERS[suffix](place)
