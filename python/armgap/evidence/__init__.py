"""Evidence for a diagnosis: residual torques drawn over a cause's variable, and checks that parameters are physically possible."""

from armgap.evidence.consistency import consistency
from armgap.evidence.laws import laws
from armgap.evidence.plausibility import plausibility

__all__ = ["consistency", "laws", "plausibility"]
