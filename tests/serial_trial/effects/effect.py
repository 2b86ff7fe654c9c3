"""Base class of the hidden effects of the trial, and the quantities that effects depend on.

An effect may change the arm before it is simulated, the torque that a drive delivers, the torque or the level of dry friction at a joint, and
the position that an encoder shows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..arms import SerialRobot

Array = NDArray[np.float64]
TURN = 2.0 * math.pi
#: Speed [rad/s or m/s] below which a joint counts as at rest and dry friction has no direction.
STILL = 1e-3


@dataclass(frozen=True)
class Use:
    """Statistics of the joints' motion, shape (n,) each, by which the sizes of effects are chosen.

    RMS and largest torque, RMS acceleration and speed, 2 % and 98 % quantiles of position, RMS rate of the torque.
    """

    torque: Array
    peak: Array
    acceleration: Array
    speed: Array
    low: Array
    high: Array
    slew: Array


@dataclass
class Moment:
    """State at one integration step: time [s], true positions and velocities, delivered torques, and load torques from the links."""

    t: float
    q: Array
    dq: Array
    delivered: Array
    load: Array


@dataclass
class Effect:
    """Hidden effect on joint `joint`, counted from 0, or on the whole arm (None). This base class has no effect.

    `draw` aims at a change of about `share` of the joint's RMS torque; `case.make_case` measures the change that results.
    """

    joint: int | None

    name: ClassVar[str] = "null"
    outside: ClassVar[bool] = False
    """Whether armgap's library has no such effect."""
    per_joint: ClassVar[bool] = True
    trusted_inertia: ClassVar[bool] = False
    """Whether the arm file states small standard deviations of inertia, because otherwise no log reveals the effect."""

    @classmethod
    def draw(cls, robot: SerialRobot, joint: int | None, share: float, use: Use, rng: np.random.Generator) -> Effect:
        """Draw an effect of a size that changes the torque of a joint by about `share` of its RMS."""
        del robot, share, use, rng
        return cls(joint)

    @property
    def values(self) -> dict[str, Any]:
        """Values of the effect's parameters by name, in SI units."""
        found = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "joint" and f.init}
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in found.items()}

    def changed(self, robot: SerialRobot) -> SerialRobot:
        """Return the arm with the effect in it."""
        return robot

    def without(self, robot: SerialRobot) -> SerialRobot:
        """Return the arm without the effect, if nominal and simulated arms contain it already."""
        return robot

    def begin(self, command: Array) -> None:
        """Reset the effect's state for a new log, before which the drives have delivered the constant torques `command`."""

    def drive(self, command: Array) -> Array:
        """Return the torques that drives deliver for `command` during the next integration step `STEP`."""
        return command

    def torque(self, now: Moment) -> Array | None:
        """Return torques on the joints in addition to those of the drives; None for none."""
        del now

    def dry(self, now: Moment) -> Array | None:
        """Return the level of dry friction above the Coulomb level; None if it is unchanged."""
        del now

    def reading(self, q: Array) -> Array:
        """Return the positions that encoders show before rounding."""
        return q

    def reading_rate(self, q: Array, dq: Array) -> Array:
        """Return the rates of change of the positions that encoders show."""
        moved = 1e-6
        return (self.reading(q + moved * dq) - self.reading(q)) / moved

    def gains(self, kp: Array, kd: Array) -> tuple[Array, Array]:
        """Return the gains that the servos really have, for the gains `kp` and `kd` that the arm file states."""
        return kp, kd

    def arriving(self, reference: Array) -> Array:
        """Return the reference that the servos have received, for the reference of the next integration step `STEP`."""
        return reference

    def at(self, j: int, value: float, n: int) -> Array:
        """Return a vector of `n` zeros with `value` at index `j`."""
        out = np.zeros(n)
        out[j] = value
        return out


def signed(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


@dataclass
class Null(Effect):
    """No effect: nothing is hidden."""

    per_joint: ClassVar[bool] = False
