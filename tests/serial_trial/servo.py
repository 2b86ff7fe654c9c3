"""Hidden effects on the settings of servos that follow a reference (Siciliano 2009, section 8.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .arms import STEP
from .effects import EFFECTS, Effect


@dataclass
class ControllerGain(Effect):
    """Proportional gain of a joint's servo that is `gain` times the arm file's."""

    gain: float
    name: ClassVar[str] = "controller_gain"
    trusted_inertia: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        size = min(max(share, 0.06), 0.3)
        return cls(joint, 1.0 + size if rng.uniform() < 0.5 else 1.0 / (1.0 + size))

    def gains(self, kp, kd):
        scaled = kp.copy()
        scaled[self.joint] *= self.gain
        return scaled, kd


@dataclass
class ControllerDamping(Effect):
    """Derivative gain of a joint's servo above the arm file's by `difference`; on the measured velocity this acts as viscous friction."""

    difference: float
    name: ClassVar[str] = "controller_damping"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(
            joint, (1.0 + 6.0 * share) * float(use.torque[joint] / use.speed[joint]) * float(rng.uniform(0.2, 0.6))
        )

    def gains(self, kp, kd):
        return kp, kd + self.at(self.joint, self.difference, len(kd))


@dataclass
class ReferenceDelay(Effect):
    """Delay of the reference by `time` [s], a whole number of integration steps; measured positions are not delayed."""

    time: float
    name: ClassVar[str] = "reference_delay"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, round(float(rng.uniform(0.012, 0.05)) / STEP) * STEP)

    def arriving(self, reference):
        if not hasattr(self, "_waiting"):
            self._waiting = [float(reference[self.joint])] * round(self.time / STEP)
        self._waiting.append(float(reference[self.joint]))
        out = reference.copy()
        out[self.joint] = self._waiting.pop(0)
        return out

    def begin(self, command):
        del command
        self.__dict__.pop("_waiting", None)


COMMANDED: dict[str, type[Effect]] = EFFECTS | {
    effect.name: effect for effect in (ControllerGain, ControllerDamping, ReferenceDelay)
}
"""Classes of the effects that are hidden in arms whose servos follow a reference, by name."""
