"""Errors of an export from a diagnosis to a simulator."""

from __future__ import annotations

from armgap.errors import OptionError

__all__ = ["DiagnosisFileError", "ExportError"]


class DiagnosisFileError(OptionError):
    """A diagnosis file is missing, not JSON, or not a diagnosis."""


class ExportError(OptionError):
    """A diagnosis does not belong to the arm file, or its values describe no arm that could be built."""
