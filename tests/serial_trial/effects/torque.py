"""Hidden effects that are torques at a joint."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from .effect import TURN, Effect, signed


@dataclass
class TorqueOffset(Effect):
    """Torque offset: a constant torque on the joint [N m or N]."""

    offset: float
    name: ClassVar[str] = "torque_offset"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, signed(rng) * share * float(use.torque[joint]))

    def torque(self, now):
        return self.at(self.joint, self.offset, len(now.q))


@dataclass
class TorqueRipple(Effect):
    """Torque ripple (cogging): ``amplitude sin(n q + phase)``, with n periods per turn, or per 2 pi metres on a linear joint."""

    amplitude: float
    n: float
    phase: float
    name: ClassVar[str] = "torque_ripple"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        n = rng.uniform(3.0, 8.0) * TURN / (use.high[joint] - use.low[joint])
        n = float(round(n)) if robot.rotary[joint] else float(n)
        return cls(joint, 1.4 * share * float(use.torque[joint]), n, float(rng.uniform(0, TURN)))

    def torque(self, now):
        j = self.joint
        return self.at(j, self.amplitude * math.sin(self.n * now.q[j] + self.phase), len(now.q))


@dataclass
class JointSpring(Effect):
    """Spring that acts on the joint, such as a hose or a counterbalance."""

    k: float
    q0: float
    name: ClassVar[str] = "joint_spring"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        low, high = float(use.low[joint]), float(use.high[joint])
        return cls(joint, 2.5 * share * float(use.torque[joint]) / (high - low), float(rng.uniform(low, high)))

    def torque(self, now):
        return self.at(self.joint, -self.k * (now.q[self.joint] - self.q0), len(now.q))


@dataclass
class Contact(Effect):
    """Contact at a joint limit: a stiff spring and damper beyond a position, towards larger (`side` 1) or smaller (-1) positions, which never
    pull (Siciliano 2009, section 9.2).
    """

    position: float
    side: float
    stiffness: float
    damping: float
    name: ClassVar[str] = "contact"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        side = signed(rng)
        low, high = float(use.low[joint]), float(use.high[joint])
        inside = (0.08 + 0.4 * share) * (high - low)
        stiffness = 20.0 * float(use.torque[joint]) / (high - low)
        return cls(joint, high - inside if side > 0 else low + inside, side, stiffness, 0.02 * stiffness)

    def torque(self, now):
        depth = self.side * (now.q[self.joint] - self.position)
        if depth <= 0:
            return None
        push = self.stiffness * depth + self.damping * self.side * now.dq[self.joint]
        return self.at(self.joint, -self.side * max(push, 0.0), len(now.q))
