"""Plausibility of the input: what contradicts the arm file, or was done to a log before it got here, said before any effect."""

from armgap.check.check import NAMES, Check, CheckName, Severity

__all__ = ["NAMES", "Check", "CheckName", "Severity"]
