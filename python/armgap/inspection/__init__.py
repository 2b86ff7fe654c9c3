"""What a log holds: columns, sampling, steps, saturation, motion, and what it tells about the arm's parameters."""

from armgap.inspection.inspection import Inspection, inspect

__all__ = ["Inspection", "inspect"]
