"""The diagnosis: where the gap lies, which effect causes it, how far it shrinks.

`diagnosis`  from logs and an arm to the result
`result`     the result, read from its JSON
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from armgap._renamed import old_names
from armgap.diagnosis.diagnosis import diagnose
from armgap.diagnosis.result import (
    MOST_BYTES,
    Bound,
    Cause,
    Diagnosis,
    Equivalent,
    Gap,
    GapAtHorizon,
    Location,
    RuledOut,
    Sanity,
    Value,
)

__all__ = [
    "MOST_BYTES",
    "Bound",
    "Cause",
    "Diagnosis",
    "Equivalent",
    "Gap",
    "GapAtHorizon",
    "Location",
    "RuledOut",
    "Sanity",
    "Value",
    "diagnose",
]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__)
