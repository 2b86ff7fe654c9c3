"""`position_zero`: the zero of a joint's positions lies 90 or 180 degrees off the model's zero.

For joint 1 half a turn is equivalent to reversed gravity, or a ceiling mount; a quarter turn is equivalent to a wall mount.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.readings.reading import Reading, reading

__all__ = ["OFFSETS", "readings"]

#: Usual zeros of positions other than the model's own [degrees].
OFFSETS = (180, 90, -90)


def readings(arm: Arm, _travel: float) -> Iterator[Reading]:
    """Yield readings with the zero of positions at each of `OFFSETS`, for every joint of an arm with rotary joints."""
    if not arm.rotary:
        return
    for j in range(1, arm.n_joints + 1):
        for degrees in OFFSETS:
            corrections = Corrections(zero={f"q{j}": math.radians(degrees)})
            what = f"`q{j}` counts from {degrees} degrees of the model's joint {j}"
            if j == 1 and degrees == 180:
                if arm.expects_weight:
                    upright = Corrections(gravity="reversed")
                    yield reading(
                        "position_zero", f"{what} (or the arm hangs from a ceiling)", corrections, upright, joint=j
                    )
            elif j == 1:
                yield reading("position_zero", f"{what} (or the arm is mounted on a wall)", corrections, joint=j)
            else:
                yield reading("position_zero", what, corrections, joint=j)
