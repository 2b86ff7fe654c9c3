"""Hidden effects on several joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..arms import STEP
from .effect import Array, Effect, signed


@dataclass
class DelayEverywhere(Effect):
    """Delay of all torques by `time` [s], a whole number of integration steps."""

    time: float
    name: ClassVar[str] = "actuator_delay_all"
    per_joint: ClassVar[bool] = False

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        late = min(max(1.5 * share * float(np.median(use.torque / use.slew)), 0.006), 0.02)
        return cls(None, round(late / STEP) * STEP)

    def begin(self, command):
        self._waiting = [command.copy() for _ in range(round(self.time / STEP))]

    def drive(self, command):
        self._waiting.append(command.copy())
        return self._waiting.pop(0)


@dataclass
class LoadFrictionEverywhere(Effect):
    """Load-dependent friction on every joint: dry friction in proportion to the torque that the gear transmits (Hamon 2010)."""

    mu: Array
    name: ClassVar[str] = "load_dependent_friction_all"
    per_joint: ClassVar[bool] = False

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(None, 1.2 * share * rng.uniform(0.6, 1.4, robot.n))

    def dry(self, now):
        return self.mu * np.abs(now.load)


@dataclass
class CoupledTransmission(Effect):
    """Friction of a part that turns with a combination of two joints, ``v = dq_j + factor dq_next`` (Siciliano 2009, section 5.1): its torque
    ``viscous v + coulomb sign(v)`` acts against `joint`, and `factor` times this torque against the next joint.
    """

    factor: float
    viscous: float
    coulomb: float
    width: float
    name: ClassVar[str] = "coupled_transmission"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        joint = cls.pair(robot, joint)
        size = 2.0 * share * float(use.torque[joint : joint + 2].min())
        speed = float(np.hypot(*use.speed[joint : joint + 2]))
        part = float(rng.uniform(0.2, 0.8))
        return cls(joint, signed(rng), part * size / speed, (1.0 - part) * size, 0.02 * speed)

    @staticmethod
    def pair(robot, joint):
        """Return the first of two neighbouring joints of one kind: `joint`, or the nearest that has such a neighbour."""
        pairs = [j for j in range(robot.n - 1) if robot.kinds[j] == robot.kinds[j + 1]] or [0]
        return min(pairs, key=lambda j: abs(j - joint))

    def torque(self, now):
        j = self.joint
        speed = now.dq[j] + self.factor * now.dq[j + 1]
        along = self.viscous * speed + self.coulomb * np.tanh(speed / self.width)
        out = np.zeros(len(now.q))
        out[j], out[j + 1] = -along, -self.factor * along
        return out
