"""Hidden effects that armgap's library does not have."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..arms import STEP
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


@dataclass
class NeighbourRipple(Effect):
    """Torque on `joint` that depends on another joint's position, ``amplitude sin(n q_other + phase)`` (a hose that is dragged along)."""

    amplitude: float
    other: int
    n: float
    phase: float
    name: ClassVar[str] = "neighbour_ripple"
    outside: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        other = int(rng.choice([j for j in range(robot.n) if j != joint]))
        n = rng.uniform(0.8, 2.0) * TURN / (use.high[other] - use.low[other])
        return cls(joint, 1.4 * share * float(use.torque[joint]), other, float(n), float(rng.uniform(0, TURN)))

    def torque(self, now):
        return self.at(self.joint, self.amplitude * math.sin(self.n * now.q[self.other] + self.phase), len(now.q))


@dataclass
class FrictionJump(Effect):
    """Coulomb friction that grows by `step` [N m or N] at the time `when` [s]."""

    step: float
    when: float
    name: ClassVar[str] = "friction_jump"
    outside: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, 1.6 * share * float(use.torque[joint]), float(rng.uniform(4.0, 8.0)))

    def dry(self, now):
        return self.at(self.joint, self.step if now.t > self.when else 0.0, len(now.q))


@dataclass
class FrictionOverTurns(Effect):
    """Coulomb friction that varies with several periods over the travel: ``amplitude cos(n q + phase)`` above its level."""

    amplitude: float
    n: float
    phase: float
    name: ClassVar[str] = "friction_over_turns"
    outside: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        n = rng.uniform(1.5, 4.0) * TURN / (use.high[joint] - use.low[joint])
        size = 1.5 * share * float(use.torque[joint])
        return cls(joint, min(size, float(robot.coulomb[joint])), float(n), float(rng.uniform(0, TURN)))

    def dry(self, now):
        return self.at(self.joint, self.amplitude * math.cos(self.n * now.q[self.joint] + self.phase), len(now.q))


@dataclass
class FadingTorque(Effect):
    """Drive whose torque constant falls linearly with time, by the share `rate` [1/s] of its value."""

    rate: float
    name: ClassVar[str] = "fading_torque"
    outside: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, min(0.3 * share, 0.05))

    def begin(self, command):
        self._time = 0.0

    def drive(self, command):
        out = command.copy()
        out[self.joint] *= 1.0 - self.rate * self._time
        self._time += STEP
        return out


@dataclass
class DriveHysteresis(Effect):
    """Drive that keeps back a stop operator of its command (Prandtl and Ishlinskii), of radius `radius` [N m or N]."""

    radius: float
    name: ClassVar[str] = "drive_hysteresis"
    outside: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, share * float(use.torque[joint]))

    def begin(self, command):
        self._before, self._stop = float(command[self.joint]), 0.0

    def drive(self, command):
        out, now = command.copy(), float(command[self.joint])
        self._stop = min(max(self._stop + now - self._before, -self.radius), self.radius)
        self._before = now
        out[self.joint] = now - self._stop
        return out


@dataclass
class SlewLimit(Effect):
    """Drive whose torque changes by at most `rate` [N m/s or N/s]."""

    rate: float
    name: ClassVar[str] = "slew_limit"
    outside: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, float(use.slew[joint]) * (1.2 - min(3.0 * share, 0.8)))

    def begin(self, command):
        self._torque = float(command[self.joint])

    def drive(self, command):
        out, most = command.copy(), self.rate * STEP
        self._torque += min(max(float(command[self.joint]) - self._torque, -most), most)
        out[self.joint] = self._torque
        return out


@dataclass
class SpeedRipple(Effect):
    """Viscous friction that varies over the travel: torque ``-amplitude dq sin(n q + phase)``."""

    amplitude: float
    n: float
    phase: float
    name: ClassVar[str] = "speed_ripple"
    outside: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        n = rng.uniform(1.0, 4.0) * TURN / (use.high[joint] - use.low[joint])
        size = 1.6 * share * float(use.torque[joint] / use.speed[joint])
        return cls(joint, size, float(n), float(rng.uniform(0, TURN)))

    def torque(self, now):
        j = self.joint
        return self.at(j, -self.amplitude * now.dq[j] * math.sin(self.n * now.q[j] + self.phase), len(now.q))


@dataclass
class BentDriveCurve(Effect):
    """Drive whose torque falls behind its command in proportion to the command's square: ``u (1 - share |u| / peak)`` (magnetic saturation)."""

    share: float
    peak: float
    name: ClassVar[str] = "bent_drive_curve"
    outside: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, min(1.6 * share, 0.45), float(use.peak[joint]))

    def drive(self, command):
        out, u = command.copy(), float(command[self.joint])
        out[self.joint] = u * (1.0 - self.share * min(abs(u) / self.peak, 1.5))
        return out


@dataclass
class DampedCable(Effect):
    """Cable with a damper in series: a spring of stiffness `k` whose deflection fades with the time constant `time` [s] (Maxwell)."""

    k: float
    time: float
    name: ClassVar[str] = "damped_cable"
    outside: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        time = float(np.exp(rng.uniform(math.log(0.1), math.log(1.0))))
        return cls(joint, 1.6 * share * float(use.torque[joint] / use.speed[joint]) * (1.0 / time + 2.0), time)

    def begin(self, command):
        self._stretch = 0.0

    def torque(self, now):
        j = self.joint
        self._stretch += STEP * (now.dq[j] - self._stretch / self.time)
        return self.at(j, -self.k * self._stretch, len(now.q))


@dataclass
class ProductTorque(Effect):
    """Torque in proportion to the product of two joints' positions, less their means: ``k (q_j - a) (q_other - b)``."""

    k: float
    other: int
    a: float
    b: float
    name: ClassVar[str] = "product_torque"
    outside: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        other = int(rng.choice([j for j in range(robot.n) if j != joint]))
        middle, half = (use.low + use.high) / 2, (use.high - use.low) / 2
        size = 3.0 * share * float(use.torque[joint] / half[joint] / half[other])
        return cls(joint, signed(rng) * size, other, float(middle[joint]), float(middle[other]))

    def torque(self, now):
        apart = (now.q[self.joint] - self.a) * (now.q[self.other] - self.b)
        return self.at(self.joint, self.k * float(apart), len(now.q))
