"""Hidden effects on the arm itself: payload, tilt of the base, wrong link, wrong rotor inertia."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ..arms import Link, turn
from .effect import TURN, Array, Effect


@dataclass
class Payload(Effect):
    """Payload on the last link: mass [kg] and centre of mass in the link's frame [m]; a ball with a radius of gyration of 3 cm."""

    mass: float
    com: Array
    name: ClassVar[str] = "payload"
    per_joint: ClassVar[bool] = False

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        last, length = robot.links[-1], float(robot.lengths[-1])
        mass = last.mass * (0.3 + 6.0 * share)
        com = last.com / np.linalg.norm(last.com) * length * rng.uniform(0.8, 2.0) + 0.4 * length * rng.normal(size=3)
        return cls(None, mass, com)

    def changed(self, robot):
        ball = Link(self.mass, self.com, self.mass * 0.03**2 / 2 * np.eye(3))
        return robot.with_link(robot.n - 1, robot.links[-1].joined(ball))


@dataclass
class BaseTilt(Effect):
    """Base tilted about its x and y axes [rad] against the arm file (Siciliano 2009, section 7.3: gravity in the base's frame)."""

    x: float
    y: float
    name: ClassVar[str] = "base_tilt"
    per_joint: ClassVar[bool] = False

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        size, way = 0.02 + 0.5 * share, rng.uniform(0, TURN)
        return cls(None, size * math.cos(way), size * math.sin(way))

    def changed(self, robot):
        angle = math.hypot(self.x, self.y)
        return replace(robot, gravity=turn((self.x, self.y, 0.0), -angle) @ robot.gravity)


@dataclass
class NominalLink(Effect):
    """Mass and inertia of one link that are `factor` times the arm file's."""

    factor: float
    name: ClassVar[str] = "nominal_link"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, float(rng.uniform(1.5, 2.5) if rng.uniform() < 0.6 else rng.uniform(0.35, 0.65)))

    def changed(self, robot):
        return robot.with_link(self.joint, robot.links[self.joint].scaled(self.factor))


@dataclass
class RotorInertia(Effect):
    """Rotor inertia [kg m^2 or kg] that the arm file lacks (`lacking`) or states too small (Siciliano 2009, section 5.2: geared rotors)."""

    inertia: float
    lacking: bool
    name: ClassVar[str] = "rotor_inertia"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        lacking = bool(rng.uniform() < 0.5)
        inertia = float(robot.rotor[joint])
        return cls(joint, inertia if lacking else inertia * float(rng.uniform(0.8, 2.0)), lacking)

    def changed(self, robot):
        return replace(robot, rotor=robot.rotor + self.at(self.joint, self.inertia, robot.n))

    def without(self, robot):
        return (
            replace(robot, rotor=robot.rotor - self.at(self.joint, robot.rotor[self.joint], robot.n))
            if self.lacking
            else robot
        )
