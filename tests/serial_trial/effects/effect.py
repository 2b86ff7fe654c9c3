"""What an effect is.

An effect may change the arm before it is simulated, the torque that a drive delivers, the torque or the level of dry friction at a joint, and
what an encoder shows.
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
#: Speed [rad/s or m/s] below which a joint has no direction.
STILL = 1e-3


@dataclass(frozen=True)
class Use:
    """How the joints are used in a motion, shape (n,) each: sizes of effects are stated against these.

    RMS torque and its largest value, RMS acceleration and speed, positions that 2 % of the samples lie below and above.
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
    """The state at one step: time [s], true positions and velocities, torques delivered, and torques that the links put on the joints."""

    t: float
    q: Array
    dq: Array
    delivered: Array
    load: Array


@dataclass
class Effect:
    """An effect on joint `joint`, from 0, or on the arm (None). This one does nothing.

    `draw` makes one that takes about a share `share` of the joint's RMS torque; the case checks what it makes in fact.
    """

    joint: int | None

    name: ClassVar[str] = "null"
    outside: ClassVar[bool] = False
    """Whether armgap's library has no such effect."""
    per_joint: ClassVar[bool] = True
    trusted_inertia: ClassVar[bool] = False
    """Whether the arm file of such a case trusts the inertias, because nothing else tells the effect."""

    @classmethod
    def draw(cls, robot: SerialRobot, joint: int | None, share: float, use: Use, rng: np.random.Generator) -> Effect:
        """Draw its values."""
        del robot, share, use, rng
        return cls(joint)

    @property
    def values(self) -> dict[str, Any]:
        """Its values by name, SI."""
        found = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "joint" and f.init}
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in found.items()}

    def changed(self, robot: SerialRobot) -> SerialRobot:
        """Return the arm with the effect in it."""
        return robot

    def without(self, robot: SerialRobot) -> SerialRobot:
        """Return the arm without the effect, where it has that already: nominal and simulated arms begin with it."""
        return robot

    def begin(self, command: Array) -> None:
        """Begin a log, in which drives have delivered `command` for long."""

    def drive(self, command: Array) -> Array:
        """Return the torques that drives deliver during the next `STEP`."""
        return command

    def torque(self, now: Moment) -> Array | None:
        """Return torques on the joints beside the drives'."""
        del now

    def dry(self, now: Moment) -> Array | None:
        """Return what dry friction of the joints has more than the Coulomb level."""
        del now

    def reading(self, q: Array) -> Array:
        """Return what encoders show before they round."""
        return q

    def gains(self, kp: Array, kd: Array) -> tuple[Array, Array]:
        """Return the gains that servos have where they are said to have these."""
        return kp, kd

    def arriving(self, reference: Array) -> Array:
        """Return the reference that servos know of during the next `STEP`."""
        return reference

    def at(self, j: int, value: float, n: int) -> Array:
        """Return a vector of zeros with one value."""
        out = np.zeros(n)
        out[j] = value
        return out


def signed(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


@dataclass
class Null(Effect):
    """Nothing is hidden."""

    per_joint: ClassVar[bool] = False
