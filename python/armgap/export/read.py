"""Reading of a diagnosis from its JSON file."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from armgap.diagnosis.result import MOST_BYTES, Diagnosis
from armgap.export.errors import DiagnosisFileError
from armgap.files.reading import read_bounded

__all__ = ["read_diagnosis"]

_REMEDY = "give the JSON that `armgap diagnose --json` wrote"
_SCHEMA = "armgap.diagnosis/1"


def read_diagnosis(path: str | Path) -> Diagnosis:
    """Read a diagnosis from its JSON file and check it.

    Parameters
    ----------
    path : path-like
        JSON file of schema ``armgap.diagnosis/1``; ``-`` reads standard input.

    Raises
    ------
    DiagnosisFileError
        If the file is missing, not JSON, or not a diagnosis.
    """
    data = _load(path)
    if not isinstance(data, dict) or data.get("schema") != _SCHEMA:
        found = data.get("schema") if isinstance(data, dict) else type(data).__name__
        raise DiagnosisFileError(f"is not a diagnosis of schema {_SCHEMA} (found {found!r})", remedy=_REMEDY, file=path)
    try:
        diagnosis = Diagnosis.from_dict(data)
        _check_numbers(diagnosis)
    except (KeyError, TypeError, IndexError, AttributeError, ValueError) as error:
        raise DiagnosisFileError(f"is damaged: {_reason(error)}", remedy=_REMEDY, file=path) from None
    return diagnosis


def _load(path: str | Path) -> Any:
    try:
        return json.loads(read_bounded(path, MOST_BYTES))
    except OSError as error:
        raise DiagnosisFileError(f"cannot be read ({error.strerror or error})", remedy=_REMEDY, file=path) from None
    except (ValueError, RecursionError) as error:
        raise DiagnosisFileError(f"is not JSON ({error})", remedy=_REMEDY, file=path) from None


def _check_numbers(diagnosis: Diagnosis) -> None:
    sets = [(stage, values) for stage, values in diagnosis.parameters.items()]
    sets += [(cause.effect, single.parameters) for cause in diagnosis.causes for single in cause.by_joint()]
    for place, values in sets:
        for name, value in values.items():
            if not (_is_finite(value.value) and _is_finite(value.sigma)):
                raise ValueError(f"{place}.{name} is not a finite number")


def _is_finite(x: object) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x)


def _reason(error: Exception) -> str:
    return f"`{error.args[0]}` is missing" if isinstance(error, KeyError) else str(error)
