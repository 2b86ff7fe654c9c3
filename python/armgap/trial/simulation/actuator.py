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
    """Interface of one block of an actuator model, such as a delay, a gain or a lag."""

    def __call__(self, u: float, dt: float) -> float:
        """Return the mean output torque for input torque `u`, over the next ``dt`` seconds."""
        ...


@dataclass
class Delay:
    """Delay block of an actuator: ``u(t - delay)``, with `delay` in s; before the start the command equals the first one."""

    delay: float
    _past: deque[float] = field(default_factory=deque)

    def __call__(self, u: float, dt: float) -> float:
        """Return the command of ``delay`` seconds ago."""
        if not self._past:
            self._past.extend([u] * round(self.delay / dt))
        self._past.append(u)
        return self._past.popleft()


@dataclass
class Gain:
    """Gain block of an actuator: ``gain u``."""

    gain: float

    def __call__(self, u: float, dt: float) -> float:
        """Return the command times the gain."""
        return self.gain * u


@dataclass
class DeadZone:
    """Dead-zone block of an actuator: zero torque for commands below ``level`` [N m or N], the excess over the level above it."""

    level: float

    def __call__(self, u: float, dt: float) -> float:
        """Return the excess of the command over the level."""
        return math.copysign(max(abs(u) - self.level, 0.0), u)


@dataclass
class Saturation:
    """Saturation block of an actuator: ``u`` clipped to ``[-level, level]``."""

    level: float

    def __call__(self, u: float, dt: float) -> float:
        """Return the command clipped to the level."""
        return min(max(u, -self.level), self.level)


@dataclass
class Lag:
    """First-order lag block of an actuator with ``time_constant`` in s, which returns the exact mean over each step."""

    time_constant: float
    _y: float | None = None

    def __call__(self, u: float, dt: float) -> float:
        """Return the mean of the lagged command over the step."""
        y = u if self._y is None else self._y
        decay = math.exp(-dt / self.time_constant)
        self._y = u + (y - u) * decay
        return u + (y - u) * self.time_constant / dt * (1.0 - decay)


@dataclass
class SlewLimit:
    """Rate-limit block of an actuator: the torque changes by no more than ``rate`` [N m/s or N/s]."""

    rate: float
    _y: float | None = None

    def __call__(self, u: float, dt: float) -> float:
        """Return the command with its rate of change limited."""
        y = u if self._y is None else self._y
        self._y = y + min(max(u - y, -self.rate * dt), self.rate * dt)
        return self._y


@dataclass
class MagneticHysteresis:
    """Hysteresis block of an actuator: ``(1 - share) u + share z``, with `z` the command `u` behind a play of half width ``width`` [N m or N]."""

    width: float
    share: float
    _z: float = 0.0

    def __call__(self, u: float, dt: float) -> float:
        """Return the torque on the hysteresis loop for command `u`."""
        self._z = min(max(self._z, u - self.width), u + self.width)
        return (1.0 - self.share) * u + self.share * self._z


#: Order of an actuator's blocks from command to joint.
ORDER = (Delay, Gain, DeadZone, MagneticHysteresis, Saturation, SlewLimit, Lag)


@dataclass
class Actuator:
    """The actuator of one joint: blocks in series, in the order of :data:`ORDER`."""

    blocks: list[ActuatorBlock] = field(default_factory=list)

    def add(self, block: ActuatorBlock) -> None:
        """Add a block to the actuator, at its place in the order of blocks."""
        self.blocks.append(block)
        self.blocks.sort(key=lambda s: ORDER.index(type(s)))

    @property
    def constant(self) -> bool:
        """Whether a constant command to the actuator gives a constant torque."""
        return all(isinstance(s, Gain | DeadZone | Saturation) for s in self.blocks)

    def __call__(self, u: float, dt: float) -> float:
        """Return the torque at the joint for command `u`."""
        for block in self.blocks:
            u = block(u, dt)
        return u


@dataclass
class Encoder:
    """Encoder of one joint, which reads ``q + a sin q + b cos q + offset`` [rad or m], rounded to whole steps of size ``step``."""

    step: float
    offset: float = 0.0
    a: float = 0.0
    b: float = 0.0

    def __call__(self, q: float) -> float:
        """Return the encoder reading at position ``q``."""
        shown = q + self.a * math.sin(q) + self.b * math.cos(q) + self.offset
        return round(shown / self.step) * self.step
