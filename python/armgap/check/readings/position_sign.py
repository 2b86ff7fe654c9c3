"""`position_sign`: positions of one joint, or positions and torques of the joint, have reversed sign.

For an arm of one joint `position_sign` is equivalent to `torque_sign`, but for an axis that carries weight.
"""

from __future__ import annotations

from collections.abc import Iterator

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.readings.reading import Reading, reading, weighs_constantly

__all__ = ["readings"]


def readings(arm: Arm, _travel: float) -> Iterator[Reading]:
    """Yield readings with reversed positions, and with reversed positions and torques, for each joint of an arm of several joints.

    Of an axis that carries weight a reading with reversed positions.
    """
    if weighs_constantly(arm):
        others = Corrections(flip=("tau1",), gravity="reversed")
        yield reading("position_sign", "positions counted the other way", Corrections(flip=("q1",)), others, joint=1)
    if arm.n_joints == 1:
        return
    joints = range(1, arm.n_joints + 1)
    every = [f"{kind}{j}" for kind in ("q", "tau") for j in joints]
    for j in joints:
        for flip, what in (
            ((f"q{j}",), f"positions of joint {j} counted the other way"),
            ((f"q{j}", f"tau{j}"), f"positions and torques of joint {j} counted the other way"),
        ):
            if arm.n_joints == 2 and len(flip) == 2 and j == 1:
                # All signs of both joints reversed are no defect, so all signs of joint 1 reversed are equivalent to all signs of joint 2 reversed.
                continue
            rest = tuple(column for column in every if column not in flip)
            yield reading("position_sign", what, Corrections(flip=flip), Corrections(flip=rest), joint=j)
