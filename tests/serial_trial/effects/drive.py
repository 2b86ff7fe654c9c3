"""Hidden effects of drives, between command and torque (Astrom 2008)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..arms import STEP
from .effect import Effect, signed


@dataclass
class ActuatorLag(Effect):
    """First-order lag with time constant `time` [s] between commanded and delivered torque."""

    time: float
    name: ClassVar[str] = "actuator_lag"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, min(max(1.5 * share * float(use.torque[joint] / use.slew[joint]), 0.006), 0.04))

    def begin(self, command):
        self._state = float(command[self.joint])

    def drive(self, command):
        apart, decay = self._state - command[self.joint], math.exp(-STEP / self.time)
        out = command.copy()
        # Mean of the lagged torque over the integration step.
        out[self.joint] = command[self.joint] + apart * (1.0 - decay) * self.time / STEP
        self._state = command[self.joint] + apart * decay
        return out


@dataclass
class ActuatorDelay(Effect):
    """Delay of one joint's torque by `time` [s], a whole number of integration steps."""

    time: float
    name: ClassVar[str] = "actuator_delay"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        late = min(max(1.5 * share * float(use.torque[joint] / use.slew[joint]), 0.004), 0.03)
        return cls(joint, round(late / STEP) * STEP)

    def begin(self, command):
        self._waiting = [float(command[self.joint])] * round(self.time / STEP)

    def drive(self, command):
        self._waiting.append(float(command[self.joint]))
        out = command.copy()
        out[self.joint] = self._waiting.pop(0)
        return out


@dataclass
class TorqueSaturation(Effect):
    """Saturation: the drive delivers at most `level` [N m or N]."""

    level: float
    name: ClassVar[str] = "torque_saturation"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, float(use.peak[joint]) * (1.0 - min(1.5 * share, 0.4)))

    def drive(self, command):
        out = command.copy()
        out[self.joint] = min(max(out[self.joint], -self.level), self.level)
        return out


@dataclass
class TorqueDeadZone(Effect):
    """Dead zone: commands below `level` [N m or N] give no torque, larger ones are reduced by `level`."""

    level: float
    name: ClassVar[str] = "torque_dead_zone"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, share * float(use.torque[joint]))

    def drive(self, command):
        out, u = command.copy(), command[self.joint]
        out[self.joint] = math.copysign(max(abs(u) - self.level, 0.0), u)
        return out


@dataclass
class TorqueGain(Effect):
    """Torque gain: the drive delivers `gain` times the command."""

    gain: float
    name: ClassVar[str] = "torque_gain"
    trusted_inertia: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, 1.0 + signed(rng) * min(max(share, 0.06), 0.25))

    def drive(self, command):
        out = command.copy()
        out[self.joint] *= self.gain
        return out
