"""Settings of servos that follow a reference, which a case may hide (Siciliano 2009, section 8.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .arms import STEP
from .effects import EFFECTS, Effect


@dataclass
class ControllerGain(Effect):
    """The proportional gain is `gain` times what the arm file says."""

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
    """The derivative gain is larger by `difference` than the arm file says; on the measured velocity this is viscous friction."""

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
    """The reference arrives `time` [s] late, a whole number of steps; what is measured does not."""

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
"""Those of arms behind servos that follow a reference."""
