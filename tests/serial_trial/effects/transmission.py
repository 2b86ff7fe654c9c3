"""Hidden effects of the transmission between motor and link (Spong 1987; Nordin 2002)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from ..arms import STEP
from .effect import Array, Effect


@dataclass
class Transmission(Effect):
    """Motor with a position of its own: the joint's rotor inertia and friction belong to the motor, and the encoder shows its position.

    The motor is integrated by the semi-implicit Euler method with step `STEP`; dry friction is an impulse that stops but does not reverse it.
    """

    rotor: float
    viscous: float
    coulomb: float
    position: float | None = field(default=None, init=False)
    speed: float = field(default=0.0, init=False)
    preload: float = field(default=0.0, init=False)

    def changed(self, robot):
        def bare(x: Array) -> Array:
            return x * (np.arange(robot.n) != self.joint)

        return replace(robot, rotor=bare(robot.rotor), viscous=bare(robot.viscous), coulomb=bare(robot.coulomb))

    def passed_on(self, deflection: float, rate: float) -> float:
        """Return the torque that the transmission puts on the link, from its deflection and deflection rate."""
        raise NotImplementedError

    def deflection(self, torque: float) -> float:
        """Return the static deflection under a constant torque."""
        raise NotImplementedError

    def begin(self, command):
        self.position, self.speed = None, 0.0
        self.preload = float(command[self.joint])

    def torque(self, now):
        j = self.joint
        if self.position is None:
            self.position = float(now.q[j]) + self.deflection(self.preload)
        passed = self.passed_on(self.position - now.q[j], self.speed - now.dq[j])
        self.speed += STEP / self.rotor * (now.delivered[j] - passed - self.viscous * self.speed)
        dry = STEP / self.rotor * self.coulomb
        self.speed = math.copysign(max(abs(self.speed) - dry, 0.0), self.speed)
        self.position += STEP * self.speed
        return self.at(j, passed - now.delivered[j], len(now.q))

    def reading(self, q):
        shown = q.copy()
        shown[self.joint] = q[self.joint] + self.deflection(self.preload) if self.position is None else self.position
        return shown

    def reading_rate(self, q, dq):
        shown = dq.copy()
        shown[self.joint] = dq[self.joint] if self.position is None else self.speed
        return shown


@dataclass
class JointElasticity(Transmission):
    """Joint elasticity: a spring and damper between motor and link."""

    stiffness: float
    damping: float
    name: ClassVar[str] = "joint_elasticity"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        twist = math.exp(rng.uniform(math.log(0.005), math.log(0.05))) * (1.0 if robot.rotary[joint] else 0.3)
        stiffness = float(use.torque[joint] / twist)
        rotor = float(robot.rotor[joint])
        damping = 2.0 * float(rng.uniform(0.05, 0.2)) * math.sqrt(stiffness * rotor)
        return cls(joint, rotor, float(robot.viscous[joint]), float(robot.coulomb[joint]), stiffness, damping)

    def passed_on(self, deflection, rate):
        return self.stiffness * deflection + self.damping * rate

    def deflection(self, torque):
        return torque / self.stiffness


@dataclass
class Backlash(Transmission):
    """Backlash between stiff flanks, whose spring gives the rotor a natural frequency of 300 rad/s."""

    gap: float
    name: ClassVar[str] = "backlash"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        gap = math.exp(rng.uniform(math.log(0.005), math.log(0.06))) * (1.0 if robot.rotary[joint] else 0.3)
        return cls(joint, float(robot.rotor[joint]), float(robot.viscous[joint]), float(robot.coulomb[joint]), gap)

    def deflection(self, torque):
        return math.copysign(self.gap / 2 + abs(torque) / (self.rotor * 300.0**2), torque)

    def passed_on(self, deflection, rate):
        depth = abs(deflection) - self.gap / 2
        if depth <= 0:
            return 0.0
        side = math.copysign(1.0, deflection)
        push = self.rotor * 300.0**2 * depth + 2 * 0.7 * self.rotor * 300.0 * side * rate
        return side * max(push, 0.0)
