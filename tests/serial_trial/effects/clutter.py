"""Several hidden effects at once: a main effect beside smaller ones, as real arms have them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from .effect import Array, Effect, Moment


@dataclass
class Clutter(Effect):
    """A main effect, whose joint, name and values the key has, and further effects `beside` it, each acting on what the ones before it leave."""

    main: Effect
    beside: list[Effect] = field(default_factory=list)
    name: ClassVar[str] = "clutter"

    @property
    def members(self) -> list[Effect]:
        """The main effect and those beside it."""
        return [self.main, *self.beside]

    @property
    def values(self) -> dict[str, Any]:
        return self.main.values

    def changed(self, robot):
        for effect in self.members:
            robot = effect.changed(robot)
        return robot

    def without(self, robot):
        for effect in self.members:
            robot = effect.without(robot)
        return robot

    def begin(self, command: Array) -> None:
        for effect in self.members:
            effect.begin(command)

    def drive(self, command: Array) -> Array:
        for effect in self.members:
            command = effect.drive(command)
        return command

    def torque(self, now: Moment) -> Array | None:
        return _sum([effect.torque(now) for effect in self.members])

    def dry(self, now: Moment) -> Array | None:
        return _sum([effect.dry(now) for effect in self.members])

    def reading(self, q: Array) -> Array:
        for effect in self.members:
            q = effect.reading(q)
        return q

    def reading_rate(self, q: Array, dq: Array) -> Array:
        for effect in self.members:
            q, dq = effect.reading(q), effect.reading_rate(q, dq)
        return dq

    def gains(self, kp: Array, kd: Array) -> tuple[Array, Array]:
        for effect in self.members:
            kp, kd = effect.gains(kp, kd)
        return kp, kd

    def arriving(self, reference: Array) -> Array:
        for effect in self.members:
            reference = effect.arriving(reference)
        return reference


def _sum(parts: list[Array | None]) -> Array | None:
    present = [part for part in parts if part is not None]
    return np.sum(present, axis=0) if present else None
