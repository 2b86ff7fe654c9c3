"""Errors of an export from a diagnosis to a simulator."""

from __future__ import annotations

from armgap.errors import OptionError

__all__ = ["DiagnosisFileError", "ExportError"]


class DiagnosisFileError(OptionError):
    """Error: a diagnosis file is missing, not JSON, or not a diagnosis."""


class ExportError(OptionError):
    """Error: a diagnosis does not belong to the arm file, or its values describe no physically possible arm."""
