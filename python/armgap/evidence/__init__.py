"""What speaks for a result besides its figures: laws drawn through data, and whether values are physically possible."""

from armgap.evidence.consistency import consistency
from armgap.evidence.laws import laws
from armgap.evidence.plausibility import plausibility

__all__ = ["consistency", "laws", "plausibility"]
