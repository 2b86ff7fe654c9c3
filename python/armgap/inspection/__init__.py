"""What a log holds: columns, sampling, steps, saturation, motion, and what it tells about the arm's parameters."""

from armgap.inspection.inspection import Inspection, inspect
from armgap.inspection.unmapped import Column, Columns, columns_of

__all__ = ["Column", "Columns", "Inspection", "columns_of", "inspect"]
