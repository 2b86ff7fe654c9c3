"""Hidden effects of encoders (Gawronski 2008)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from .effect import TURN, Effect, signed


@dataclass
class EncoderOffset(Effect):
    """Encoder offset: the encoder shows the position plus `offset` [rad or m]."""

    offset: float
    name: ClassVar[str] = "encoder_offset"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, signed(rng) * (0.02 + 0.4 * share) * (1.0 if robot.rotary[joint] else 0.1))

    def reading(self, q):
        return q + self.at(self.joint, self.offset, len(q))


@dataclass
class EncoderEccentricity(Effect):
    """Encoder eccentricity: the encoder shows the position plus ``a sin q + b cos q`` [rad], because its disc is off centre."""

    a: float
    b: float
    name: ClassVar[str] = "encoder_eccentricity"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        size, way = 0.02 + 0.4 * share, rng.uniform(0, TURN)
        return cls(joint, size * math.cos(way), size * math.sin(way))

    def reading(self, q):
        x = q[self.joint]
        return q + self.at(self.joint, self.a * math.sin(x) + self.b * math.cos(x), len(q))
