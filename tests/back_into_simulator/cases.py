"""Five arms of three to seven joints with one hidden effect each, of kinds that MuJoCo can represent in its model files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from tests.serial_trial.arms import SerialRobot
from tests.serial_trial.case import Case, make_case
from tests.serial_trial.effects import Effect

#: Family of the arm, number of joints, and hidden effect of each case.
CASES = (
    ("R-P-R", 3, "joint_spring"),
    ("SO-101-like", 4, "friction_change"),
    ("SO-101-like", 5, "rotor_inertia"),
    ("UR10-like", 6, "payload"),
    ("Panda-like", 7, "base_tilt"),
)


@dataclass
class FrictionChange(Effect):
    """Viscous and Coulomb friction of one joint are multiples of the arm file's values."""

    viscous: float
    coulomb: float
    name: ClassVar[str] = "friction_change"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, float(rng.uniform(1.5, 2.5)), float(rng.uniform(1.5, 2.5)))

    def changed(self, robot: SerialRobot) -> SerialRobot:
        assert self.joint is not None
        here = np.arange(robot.n) == self.joint
        return replace(
            robot,
            viscous=np.where(here, self.viscous, 1.0) * robot.viscous,
            coulomb=np.where(here, self.coulomb, 1.0) * robot.coulomb,
        )


def make(seed: int, number: int) -> Case:
    """Make the case of one of the `CASES`, given by its number."""
    family, joints, effect = CASES[number]
    hidden = FrictionChange if effect == FrictionChange.name else effect
    return make_case(seed, number, hidden, family=family, joints=joints)
