"""Diagnosis of one entry of a fleet in its own process; a failure becomes one sentence and does not end the fleet."""

from __future__ import annotations

import hashlib
import json
import signal
import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from armgap._native import __version__
from armgap.arm.serial.arm_file import DESCRIPTION_KEYS
from armgap.errors import ArmgapError
from armgap.fleet.manifest import Entry, is_url

__all__ = ["Outcome", "answer", "answer_within", "content_keys", "took_too_long"]

Outcome = dict[str, Any]
"""Outcome of an entry: ``diagnosis`` (JSON text), ``error`` (one line), or ``lost`` (reason why there is neither); and ``seconds``."""
#: Time between alarms at the time limit [s]; they repeat, as an exception raised in a destructor or a callback of another library is lost.
_ALARM_AGAIN_S = 0.5
_READERS: dict[str, Callable[[str], pl.DataFrame]] = {".parquet": pl.read_parquet, ".csv": pl.read_csv}


def content_keys(entries: Sequence[Entry], settings: Mapping[str, Any]) -> dict[Entry, str]:
    """Return for each entry a hash of all that its result depends on: content of its files (of a URL the address), settings and version.

    Files are the arm file, the robot's description that it names, and the logs; a folder counts by all files in it. A file that cannot be read
    counts by its name, so that the entry is tried again once the file exists.
    """
    described = {arm: _described(arm) for arm in dict.fromkeys(entry.arm for entry in entries)}
    keys = {}
    for entry in entries:
        mark = hashlib.sha256(json.dumps([__version__, dict(settings), len(entry.logs)], sort_keys=True).encode())
        for place in entry.files:
            mark.update(_digest(place))
        mark.update(described[entry.arm])
        keys[entry] = mark.hexdigest()[:24]
    return keys


def _described(arm_file: str) -> bytes:
    """Return the arm with the description (URDF or MJCF, with included files and meshes) that its arm file names, or why it cannot be read."""
    try:
        data = tomllib.loads(Path(arm_file).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return b""
    if not any(key in data for key in DESCRIPTION_KEYS):
        return b""
    from armgap.arm.arm import Arm

    try:
        return Arm.read(Path(arm_file)).to_toml().encode()
    except ArmgapError as error:
        return str(error).encode("utf-8", "surrogateescape")


def _digest(place: str) -> bytes:
    if is_url(place):
        return hashlib.sha256(place.encode()).digest()
    path = Path(place)
    if path.is_dir():
        return _folder_digest(path)
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").digest()
    except OSError:
        return hashlib.sha256(f"missing {place}".encode()).digest()


def _folder_digest(folder: Path) -> bytes:
    """Return the hash of a folder, such as a ROS bag: relative names and content of all files in it, sorted."""
    mark = hashlib.sha256(b"folder")
    for name, path in sorted((path.relative_to(folder).as_posix(), path) for path in folder.rglob("*")):
        if path.is_file():
            mark.update(hashlib.sha256(name.encode("utf-8", "surrogateescape")).digest())
            mark.update(_digest(str(path)))
    return mark.digest()


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
