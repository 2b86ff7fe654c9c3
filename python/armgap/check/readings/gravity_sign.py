"""`gravity_sign`: gravity parameters of the arm file have the wrong sign for the log.

For a rotary joint 1 reversed gravity is equivalent to an encoder zero that is half a turn off (`position_zero`); with negative gravity
parameters in the arm file the defect is reported as `gravity_sign`.
"""

from __future__ import annotations

from collections.abc import Iterator

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.readings.reading import Reading, reading

__all__ = ["readings"]


def readings(arm: Arm, _travel: float) -> Iterator[Reading]:
    """Yield a reading with reversed gravity, if the arm has gravity parameters and `position_zero` does not cover the case."""
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
