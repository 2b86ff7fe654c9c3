"""Models of actuators and encoders, outside the physics engine.

Command, held from sample to sample -> delay -> gain -> dead zone -> saturation -> lag -> joint; joint -> eccentricity
and offset of the encoder -> whole counts. Each block is called once per internal step of length ``dt`` and keeps its
own state.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Protocol


class ActuatorBlock(Protocol):
    """One block of an actuator model."""

    def __call__(self, u: float, dt: float) -> float:
        """Torque out for torque in, over the next ``dt`` seconds."""
        ...


@dataclass
class Delay:
    """``u(t - delay)``; before the first command that command is taken to have been held."""

    delay: float
    _past: deque[float] = field(default_factory=deque)

    def __call__(self, u: float, dt: float) -> float:
        """The command of ``delay`` ago."""
        if not self._past:
            self._past.extend([u] * round(self.delay / dt))
        self._past.append(u)
        return self._past.popleft()


@dataclass
class Gain:
    """``gain u``."""

    gain: float

    def __call__(self, u: float, dt: float) -> float:
        """The scaled command."""
        return self.gain * u


@dataclass
class DeadZone:
    """Nothing below ``level``, the excess over it above."""

    level: float

    def __call__(self, u: float, dt: float) -> float:
        """The excess over the level."""
        return math.copysign(max(abs(u) - self.level, 0.0), u)


@dataclass
class Saturation:
    """``u`` clipped to ``[-level, level]``."""

    level: float

    def __call__(self, u: float, dt: float) -> float:
        """The clipped command."""
        return min(max(u, -self.level), self.level)


@dataclass
class Lag:
    """First-order lag; gives the exact mean over the step."""

    time_constant: float
    _y: float | None = None

    def __call__(self, u: float, dt: float) -> float:
        """Mean of the lagged command over the step."""
        y = u if self._y is None else self._y
        decay = math.exp(-dt / self.time_constant)
        self._y = u + (y - u) * decay
        return u + (y - u) * self.time_constant / dt * (1.0 - decay)


@dataclass
class SlewLimit:
    """Torque that changes by no more than ``rate`` per second."""

    rate: float
    _y: float | None = None

    def __call__(self, u: float, dt: float) -> float:
        """The command as far as the rate allows."""
        y = u if self._y is None else self._y
        self._y = y + min(max(u - y, -self.rate * dt), self.rate * dt)
        return self._y


@dataclass
class MagneticHysteresis:
    """Torque short of the command by a rate-independent loop: a play of ``width`` behind a gain of ``share``."""

    width: float
    share: float
    _z: float = 0.0

    def __call__(self, u: float, dt: float) -> float:
        """The torque on the loop."""
        self._z = min(max(self._z, u - self.width), u + self.width)
        return (1.0 - self.share) * u + self.share * self._z


#: Order of the blocks from command to joint.
ORDER = (Delay, Gain, DeadZone, MagneticHysteresis, Saturation, SlewLimit, Lag)


@dataclass
class Actuator:
    """The actuator of one joint: blocks in series, which run in :data:`ORDER` whatever the order they came in."""

    blocks: list[ActuatorBlock] = field(default_factory=list)

    def add(self, block: ActuatorBlock) -> None:
        """Put a block where it belongs."""
        self.blocks.append(block)
        self.blocks.sort(key=lambda s: ORDER.index(type(s)))

    @property
    def constant(self) -> bool:
        """Whether a held command gives a held torque."""
        return all(isinstance(s, Gain | DeadZone | Saturation) for s in self.blocks)

    def __call__(self, u: float, dt: float) -> float:
        """Torque at the joint."""
        for block in self.blocks:
            u = block(u, dt)
        return u


@dataclass
class Encoder:
    """Position as the encoder shows it: ``q + a sin q + b cos q + offset`` in whole steps."""

    step: float
    offset: float = 0.0
    a: float = 0.0
    b: float = 0.0

    def __call__(self, q: float) -> float:
        """What the encoder shows at ``q``."""
        shown = q + self.a * math.sin(q) + self.b * math.cos(q) + self.offset
        return round(shown / self.step) * self.step
