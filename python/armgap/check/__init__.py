"""Plausibility of the input: what contradicts the arm file, or was done to a log before it got here, said before any effect."""

from armgap.arm.corrections import CORRECTIONS, Corrections
from armgap.check.check import NAMES, Check, CheckName, Severity
from armgap.check.log_checks.data import copied_holdout, data_checks
from armgap.check.stage import Examined, examine

__all__ = [
    "CORRECTIONS",
    "NAMES",
    "Check",
    "CheckName",
    "Corrections",
    "Examined",
    "Severity",
    "copied_holdout",
    "data_checks",
    "examine",
]
