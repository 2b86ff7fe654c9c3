"""Experiment of Reyes and Kelly (1997), repeated on a simulated arm: Table II, Figures 2 to 7, and causes of their deviations.

F. Reyes and R. Kelly, *Experimental evaluation of identification schemes on a direct drive robot*, Robotica 15 (1997) 563-571.
"""

from armgap.reproduction.experiment import (
    LADDER,
    PAPER_ESTIMATES,
    PAPER_MEASURED,
    Reproduction,
    reproduce,
    seed_arm,
    seed_run,
)

__all__ = [
    "LADDER",
    "PAPER_ESTIMATES",
    "PAPER_MEASURED",
    "Reproduction",
    "reproduce",
    "seed_arm",
    "seed_run",
]
