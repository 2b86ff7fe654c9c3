"""`gravity_sign`: weights of the arm file act against the log's gravity.

Where joint 1 turns this is a zero half a turn off (`position_zero`), except that an arm file whose weights are negative says itself that
the sign is what is odd.
"""

from __future__ import annotations

from collections.abc import Iterator

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.readings.reading import Reading, reading

__all__ = ["readings"]


def readings(arm: Arm, _travel: float) -> Iterator[Reading]:
    """Yield the arm with its gravity turned over, where it has any that no other check speaks of."""
    if arm.chain is not None:
        if arm.chain.gravity.any():
            yield reading(
                "gravity_sign", "gravity acts the other way than the arm file says", Corrections(gravity="reversed")
            )
        return
    weights = arm.theta[arm.gravity_parameters]
    if not weights.any() or (arm.rotary and arm.expects_weight):
        return
    others = [Corrections(zero={"q1": 3.141592653589793})] if arm.rotary else []
    others += [Corrections(flip=("q1", "tau1"))] if not arm.rotary else []
    yield reading(
        "gravity_sign", "gravity acts the other way than the arm file says", Corrections(gravity="reversed"), *others
    )
