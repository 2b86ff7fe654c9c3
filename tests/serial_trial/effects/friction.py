"""Hidden effects of friction (Armstrong 1994; Bittencourt 2012; Hamon 2010)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .effect import STILL, TURN, Array, Effect, Moment, signed


@dataclass
class Stribeck(Effect):
    """Stribeck friction: ``amplitude exp(-(dq/velocity)^2)`` [N m or N] above the Coulomb level."""

    amplitude: float
    velocity: float
    name: ClassVar[str] = "stribeck"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, 2.5 * share * float(use.torque[joint]), float(use.speed[joint] * rng.uniform(0.1, 0.5)))

    def dry(self, now):
        return self.at(self.joint, self.amplitude * math.exp(-((now.dq[self.joint] / self.velocity) ** 2)), len(now.q))


@dataclass
class StribeckEverywhere(Effect):
    """Stribeck friction on every joint, with amplitudes in proportion to the joint's Coulomb friction."""

    amplitude: Array
    velocity: Array
    name: ClassVar[str] = "stribeck_all"
    per_joint: ClassVar[bool] = False

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(None, (0.4 + 4.0 * share) * robot.coulomb, use.speed * float(rng.uniform(0.1, 0.5)))

    def dry(self, now):
        return self.amplitude * np.exp(-((now.dq / self.velocity) ** 2))


@dataclass
class CoulombAsymmetry(Effect):
    """Coulomb friction that is larger by `delta` [N m or N] forward and smaller by `delta` backward."""

    delta: float
    name: ClassVar[str] = "coulomb_asymmetry"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, signed(rng) * min(share * use.torque[joint], 0.8 * robot.coulomb[joint]))

    def dry(self, now):
        return self.at(self.joint, self.delta * min(max(now.dq[self.joint] / STILL, -1.0), 1.0), len(now.q))


@dataclass
class ViscousAsymmetry(Effect):
    """Viscous friction that is larger by `delta` [N m s/rad or N s/m] forward and smaller by `delta` backward."""

    delta: float
    name: ClassVar[str] = "viscous_asymmetry"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        size = min(1.2 * share * use.torque[joint] / use.speed[joint], 0.8 * robot.viscous[joint])
        return cls(joint, signed(rng) * size)

    def torque(self, now):
        return self.at(self.joint, -self.delta * abs(now.dq[self.joint]), len(now.q))


@dataclass
class QuadraticDrag(Effect):
    """Quadratic drag: friction in proportion to the square of the velocity."""

    c: float
    name: ClassVar[str] = "quadratic_drag"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, 0.8 * share * float(use.torque[joint] / use.speed[joint] ** 2))

    def torque(self, now):
        v = now.dq[self.joint]
        return self.at(self.joint, -self.c * v * abs(v), len(now.q))


@dataclass
class LoadDependentFriction(Effect):
    """Dry friction in proportion to the torque that the gear transmits, including that for the inertia (Hamon 2010)."""

    mu: float
    name: ClassVar[str] = "load_dependent_friction"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, 1.2 * share)

    def dry(self, now):
        return self.at(self.joint, self.mu * abs(now.load[self.joint]), len(now.q))


@dataclass
class PositionDependentFriction(Effect):
    """Change of dry friction with the position: ``amplitude cos(q - position)``; on a linear joint with a period in metres."""

    amplitude: float
    position: float
    period: float
    name: ClassVar[str] = "position_dependent_friction"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        period = TURN if robot.rotary[joint] else 2.0 * float(use.high[joint] - use.low[joint])
        size = min(1.6 * share * use.torque[joint], 0.9 * robot.coulomb[joint])
        return cls(joint, float(size), float(rng.uniform(0, period)), period)

    def dry(self, now):
        way = TURN * (now.q[self.joint] - self.position) / self.period
        return self.at(self.joint, self.amplitude * math.cos(way), len(now.q))


@dataclass
class FrictionWarmup(Effect):
    """Warm-up: all friction of the joint is ``1 + amplitude exp(-t/time)`` times its warm value (Bittencourt 2012)."""

    amplitude: float
    time: float
    coulomb: float
    viscous: float
    name: ClassVar[str] = "friction_warmup"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        warm = robot.coulomb[joint] + robot.viscous[joint] * use.speed[joint]
        amplitude = min(2.5 * share * float(use.torque[joint] / warm), 2.0)
        return cls(
            joint, amplitude, float(rng.uniform(2.0, 6.0)), float(robot.coulomb[joint]), float(robot.viscous[joint])
        )

    def _more(self, now: Moment) -> float:
        return self.amplitude * math.exp(-now.t / self.time)

    def dry(self, now):
        return self.at(self.joint, self.coulomb * self._more(now), len(now.q))

    def torque(self, now):
        return self.at(self.joint, -self.viscous * self._more(now) * now.dq[self.joint], len(now.q))
