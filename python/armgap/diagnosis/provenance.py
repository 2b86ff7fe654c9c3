"""Provenance of a result: hashes of the inputs, options, and the version."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypedDict

import numpy as np

from armgap import _native
from armgap.arm.arm import Arm
from armgap.log.log import Log

__all__ = ["Provenance", "provenance"]


class HashedInput(TypedDict):
    """An input file of a diagnosis and its SHA-256."""

    file: Annotated[str | None, "File it was read from; null without one."]
    sha256: Annotated[str, "SHA-256 of the file, or of the text or columns of what came from none."]


class HashedLog(HashedInput):
    """A log of a diagnosis and its SHA-256."""

    name: str
    set: Annotated[str, "What it was used for: training or holdout."]


class Provenance(TypedDict):
    """Provenance of a diagnosis: hashes of the inputs, options, and version."""

    version: Annotated[str, "Version of this library."]
    options: Annotated[dict[str, Any], "What was asked for."]
    arm: HashedInput
    logs: list[HashedLog]


def provenance(arm: Arm, logs: Mapping[str, Sequence[Log]], options: Mapping[str, Any]) -> Provenance:
    """Return version, options, and the SHA-256 of every input.

    Parameters
    ----------
    arm : Arm
        The nominal model, hashed by its file, or by its text as an arm file. A serial arm is always hashed by its text, which
        includes the robot's description.
    logs : mapping of str to sequence of Log
        Logs as they were read, by their use. A log is hashed by its file, or by its columns if it came from
        no regular file.
    options : mapping
        Options of the command or function.
    """
    return {
        "version": _native.__version__,
        "options": dict(options),
        "arm": _arm(arm),
        "logs": [
            {"name": log.name, "set": use, **_input(log.path, _columns(log))}
            for use, group in logs.items()
            for log in group
        ],
    }


def _arm(arm: Arm) -> HashedInput:
    text = arm.to_toml().encode()
    if arm.chain is None:
        return _input(arm.path, text)
    return {"file": None if arm.path is None else str(arm.path), "sha256": hashlib.sha256(text).hexdigest()}


def _input(path: Path | None, content: bytes) -> HashedInput:
    if path is not None and path.is_file():
        with path.open("rb") as file:
            return {"file": str(path), "sha256": hashlib.file_digest(file, "sha256").hexdigest()}
    return {"file": None if path is None else str(path), "sha256": hashlib.sha256(content).hexdigest()}


def _columns(log: Log) -> bytes:
    if log.path is not None and log.path.is_file():
        return b""
    optional = (log.dq, log.q_ref, log.dq_ref, log.tau_meas, log.q_link)
    arrays = [log.t, log.q, log.tau, *(x for x in optional if x is not None)]
    return b"".join(np.ascontiguousarray(x).tobytes() for x in arrays)
