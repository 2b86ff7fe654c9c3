"""The sections of a diagnosis report, one file per part of the page; in their order in `SECTIONS`."""

from armgap.report.sections.all import SECTIONS
from armgap.report.sections.checks import input_checks

__all__ = ["SECTIONS", "input_checks"]
