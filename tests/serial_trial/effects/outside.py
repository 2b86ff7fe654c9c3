"""Hidden effects that armgap's library does not have."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .effect import TURN, Effect, signed


@dataclass
class TorqueDrift(Effect):
    """Torque that grows linearly with time, at `rate` [N m/s], and is zero at 5 s."""

    rate: float
    name: ClassVar[str] = "torque_drift"
    outside: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, signed(rng) * 0.35 * share * float(use.torque[joint]))

    def torque(self, now):
        return self.at(self.joint, self.rate * (now.t - 5.0), len(now.q))


@dataclass
class CableSpring(Effect):
    """Cable along two neighbouring joints, `joint` and the next, that pulls on both with ``k (q_j + q_next - rest)``."""

    k: float
    rest: float
    name: ClassVar[str] = "cable_spring"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        if joint + 1 == robot.n:
            joint -= 1
        pair = slice(joint, joint + 2)
        low, high = float(use.low[pair].sum()), float(use.high[pair].sum())
        return cls(joint, 3.0 * share * float(use.torque[joint]) / (high - low), float(rng.uniform(low, high)))

    def torque(self, now):
        out = np.zeros(len(now.q))
        out[self.joint : self.joint + 2] = -self.k * (now.q[self.joint] + now.q[self.joint + 1] - self.rest)
        return out


@dataclass
class LoadedCogging(Effect):
    """Torque ripple in proportion to the delivered torque: ``ratio tau sin(n q + phase)``."""

    ratio: float
    n: float
    phase: float
    name: ClassVar[str] = "loaded_cogging"
    outside: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        n = rng.uniform(3.0, 8.0) * TURN / (use.high[joint] - use.low[joint])
        return cls(joint, 1.4 * share, float(n), float(rng.uniform(0, TURN)))

    def torque(self, now):
        j = self.joint
        return self.at(j, self.ratio * now.delivered[j] * math.sin(self.n * now.q[j] + self.phase), len(now.q))
