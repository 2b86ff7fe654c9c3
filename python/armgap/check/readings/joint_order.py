"""`joint_order`: columns of two joints are exchanged: positions, torques, or both."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.readings.reading import Reading, reading

__all__ = ["readings"]


def readings(arm: Arm, _travel: float) -> Iterator[Reading]:
    """Yield readings with positions, torques or both exchanged, for every pair of joints."""
    for i, j in combinations(range(1, arm.n_joints + 1), 2):
        q, tau = (f"q{i}", f"q{j}"), (f"tau{i}", f"tau{j}")
        for swap, what in (((q,), "positions"), ((tau,), "torques"), ((q, tau), "positions and torques")):
            yield reading("joint_order", f"the {what} of joints {i} and {j} are exchanged", Corrections(swap=swap))
