"""The diagnosis: at which joint and in which motion the gap lies, which effect causes it, how far it shrinks.

`diagnosis`  from logs and an arm to the result
`result`     the result, read from its JSON
`schema`     the JSON Schema of the result
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from armgap._renamed import old_names
from armgap.diagnosis.diagnosis import diagnose
from armgap.diagnosis.result import (
    MOST_BYTES,
    Bound,
    Cause,
    ChainPart,
    Diagnosis,
    Equivalent,
    Gap,
    GapAtHorizon,
    Location,
    RuledOut,
    Sanity,
    Value,
    Values,
)
from armgap.diagnosis.schema import diagnosis_schema

__all__ = [
    "MOST_BYTES",
    "Bound",
    "Cause",
    "ChainPart",
    "Diagnosis",
    "Equivalent",
    "Gap",
    "GapAtHorizon",
    "Location",
    "RuledOut",
    "Sanity",
    "Value",
    "Values",
    "diagnose",
    "diagnosis_schema",
]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__)
