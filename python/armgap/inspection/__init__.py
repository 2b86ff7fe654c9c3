"""Inspection of a log: columns, sampling, steps, saturation, motion, and excitation of the arm's parameters."""

from armgap.inspection.inspection import Inspection, inspect
from armgap.inspection.unmapped import Column, Columns, columns_of

__all__ = ["Column", "Columns", "Inspection", "columns_of", "inspect"]
