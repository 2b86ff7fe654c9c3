"""Plausibility checks of the input before a diagnosis: contradictions between logs and arm file, and traces of earlier processing in a log."""

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
