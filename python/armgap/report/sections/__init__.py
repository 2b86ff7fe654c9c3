"""Sections of a diagnosis report, one file per part of the page; `SECTIONS` lists them in order."""

from armgap.report.sections.all import SECTIONS
from armgap.report.sections.checks import input_checks

__all__ = ["SECTIONS", "input_checks"]
