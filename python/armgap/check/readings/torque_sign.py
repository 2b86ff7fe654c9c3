"""`torque_sign`: torques have reversed sign.

Reversing all torques is equivalent to reversing all positions: the equation of motion is odd in ``(q, tau)`` together, but for an axis that carries
weight (`weighs_constantly`).
"""

from __future__ import annotations

from collections.abc import Iterator

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.readings.reading import Reading, reading, weighs_constantly

__all__ = ["readings"]


def readings(arm: Arm, _travel: float) -> Iterator[Reading]:
    """Yield one reading with reversed torque per joint, and one with the torques of all joints reversed."""
    joints = range(1, arm.n_joints + 1)
    every_tau, every_q = tuple(f"tau{j}" for j in joints), tuple(f"q{j}" for j in joints)
    positions = Corrections(flip=every_q, gravity="reversed" if weighs_constantly(arm) else None)
    every = reading(
        "torque_sign", "all torques counted the other way", Corrections(flip=every_tau), positions,
        joint=1 if arm.n_joints == 1 else None,
    )  # fmt: skip
    yield every
    if arm.n_joints > 1:
        for j in joints:
            others = tuple(c for c in every_tau if c != f"tau{j}")
            yield reading(
                "torque_sign", f"torques of joint {j} counted the other way", Corrections(flip=(f"tau{j}",)),
                Corrections(flip=(*every_q, *others)), joint=j,
            )  # fmt: skip
