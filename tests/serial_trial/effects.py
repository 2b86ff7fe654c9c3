"""What a case hides: one class per effect, with its law and how its size is drawn. Laws are those of the textbooks named beside them.

An effect may change the arm before it is simulated, the torque that a drive delivers, the torque or the level of dry friction at a joint, and
what an encoder shows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from .arms import STEP, Link, SerialRobot, turn

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


def _signed(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


@dataclass
class Null(Effect):
    """Nothing is hidden."""

    per_joint: ClassVar[bool] = False


# ---- The arm itself ----


@dataclass
class Payload(Effect):
    """A load on the last link: its mass [kg] and centre [m]; a ball of 3 cm radius of gyration."""

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
    """The base is not as the arm file says: turned about its axes x and y [rad] (Siciliano 2009, section 7.3: gravity in the base's frame)."""

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
    """One link weighs `factor` times what the arm file says, and its inertia with it."""

    factor: float
    name: ClassVar[str] = "nominal_link"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, float(rng.uniform(1.5, 2.5) if rng.uniform() < 0.6 else rng.uniform(0.35, 0.65)))

    def changed(self, robot):
        return robot.with_link(self.joint, robot.links[self.joint].scaled(self.factor))


@dataclass
class RotorInertia(Effect):
    """A rotor that the arm file has not (`lacking`), or too small [kg m^2 or kg] (Siciliano 2009, section 5.2: geared rotors)."""

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


# ---- Friction (Armstrong 1994; Bittencourt 2012; Hamon 2010) ----


@dataclass
class Stribeck(Effect):
    """Friction ``amplitude exp(-(dq/velocity)^2)`` above the Coulomb level at low speed."""

    amplitude: float
    velocity: float
    name: ClassVar[str] = "stribeck"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, 2.5 * share * float(use.torque[joint]), float(use.speed[joint] * rng.uniform(0.1, 0.5)))

    def dry(self, now):
        return self.at(self.joint, self.amplitude * math.exp(-((now.dq[self.joint] / self.velocity) ** 2)), len(now.q))


@dataclass
class StribeckEverywhere(Effect):
    """The same on every joint, with amplitudes in proportion to its Coulomb friction."""

    amplitude: Array
    velocity: Array
    name: ClassVar[str] = "stribeck_all"
    per_joint: ClassVar[bool] = False

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(None, (0.4 + 4.0 * share) * robot.coulomb, use.speed * float(rng.uniform(0.1, 0.5)))

    def dry(self, now):
        return self.amplitude * np.exp(-((now.dq / self.velocity) ** 2))


@dataclass
class CoulombAsymmetry(Effect):
    """Coulomb friction larger by `delta` forward, smaller backward."""

    delta: float
    name: ClassVar[str] = "coulomb_asymmetry"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, _signed(rng) * min(share * use.torque[joint], 0.8 * robot.coulomb[joint]))

    def dry(self, now):
        return self.at(self.joint, self.delta * min(max(now.dq[self.joint] / STILL, -1.0), 1.0), len(now.q))


@dataclass
class ViscousAsymmetry(Effect):
    """Viscous friction larger by `delta` forward, smaller backward."""

    delta: float
    name: ClassVar[str] = "viscous_asymmetry"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        size = min(1.2 * share * use.torque[joint] / use.speed[joint], 0.8 * robot.viscous[joint])
        return cls(joint, _signed(rng) * size)

    def torque(self, now):
        return self.at(self.joint, -self.delta * abs(now.dq[self.joint]), len(now.q))


@dataclass
class QuadraticDrag(Effect):
    """Drag in proportion to the square of the speed."""

    c: float
    name: ClassVar[str] = "quadratic_drag"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, 0.8 * share * float(use.torque[joint] / use.speed[joint] ** 2))

    def torque(self, now):
        v = now.dq[self.joint]
        return self.at(self.joint, -self.c * v * abs(v), len(now.q))


@dataclass
class LoadDependentFriction(Effect):
    """Dry friction in proportion to the torque that the gear passes on, inertia's part included (Hamon 2010)."""

    mu: float
    name: ClassVar[str] = "load_dependent_friction"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, 1.2 * share)

    def dry(self, now):
        return self.at(self.joint, self.mu * abs(now.load[self.joint]), len(now.q))


@dataclass
class PositionDependentFriction(Effect):
    """Dry friction that changes over the turn by ``amplitude cos(q - position)``; along a linear joint over `period`."""

    amplitude: float
    position: float
    period: float
    name: ClassVar[str] = "position_dependent_friction"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        period = TURN if robot.rotary[joint] else 2.0 * float(use.high[joint] - use.low[joint])
        size = min(1.6 * share * use.torque[joint], 0.9 * robot.coulomb[joint])
        return cls(joint, float(size), float(rng.uniform(0, period)), period)

    def dry(self, now):
        way = TURN * (now.q[self.joint] - self.position) / self.period
        return self.at(self.joint, self.amplitude * math.cos(way), len(now.q))


@dataclass
class FrictionWarmup(Effect):
    """All friction of the joint is ``1 + amplitude exp(-t/time)`` times its warm value (Bittencourt 2012)."""

    amplitude: float
    time: float
    coulomb: float
    viscous: float
    name: ClassVar[str] = "friction_warmup"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        warm = robot.coulomb[joint] + robot.viscous[joint] * use.speed[joint]
        amplitude = min(2.5 * share * float(use.torque[joint] / warm), 2.0)
        return cls(
            joint, amplitude, float(rng.uniform(2.0, 6.0)), float(robot.coulomb[joint]), float(robot.viscous[joint])
        )

    def _more(self, now: Moment) -> float:
        return self.amplitude * math.exp(-now.t / self.time)

    def dry(self, now):
        return self.at(self.joint, self.coulomb * self._more(now), len(now.q))

    def torque(self, now):
        return self.at(self.joint, -self.viscous * self._more(now) * now.dq[self.joint], len(now.q))


# ---- Torques at the joint ----


@dataclass
class TorqueOffset(Effect):
    """A constant torque."""

    offset: float
    name: ClassVar[str] = "torque_offset"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, _signed(rng) * share * float(use.torque[joint]))

    def torque(self, now):
        return self.at(self.joint, self.offset, len(now.q))


@dataclass
class TorqueRipple(Effect):
    """Cogging: ``amplitude sin(n q + phase)``, n periods a turn (or 2 pi a metre)."""

    amplitude: float
    n: float
    phase: float
    name: ClassVar[str] = "torque_ripple"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        n = rng.uniform(3.0, 8.0) * TURN / (use.high[joint] - use.low[joint])
        n = float(round(n)) if robot.rotary[joint] else float(n)
        return cls(joint, 1.4 * share * float(use.torque[joint]), n, float(rng.uniform(0, TURN)))

    def torque(self, now):
        j = self.joint
        return self.at(j, self.amplitude * math.sin(self.n * now.q[j] + self.phase), len(now.q))


@dataclass
class JointSpring(Effect):
    """A spring on the joint, such as a hose or a counterbalance."""

    k: float
    q0: float
    name: ClassVar[str] = "joint_spring"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        low, high = float(use.low[joint]), float(use.high[joint])
        return cls(joint, 2.5 * share * float(use.torque[joint]) / (high - low), float(rng.uniform(low, high)))

    def torque(self, now):
        return self.at(self.joint, -self.k * (now.q[self.joint] - self.q0), len(now.q))


@dataclass
class Contact(Effect):
    """A stop: a stiff spring and damper beyond a position, towards larger positions (`side` 1) or smaller (-1), which never pull (Siciliano
    2009, section 9.2).
    """

    position: float
    side: float
    stiffness: float
    damping: float
    name: ClassVar[str] = "contact"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        side = _signed(rng)
        low, high = float(use.low[joint]), float(use.high[joint])
        inside = (0.08 + 0.4 * share) * (high - low)
        stiffness = 20.0 * float(use.torque[joint]) / (high - low)
        return cls(joint, high - inside if side > 0 else low + inside, side, stiffness, 0.02 * stiffness)

    def torque(self, now):
        depth = self.side * (now.q[self.joint] - self.position)
        if depth <= 0:
            return None
        push = self.stiffness * depth + self.damping * self.side * now.dq[self.joint]
        return self.at(self.joint, -self.side * max(push, 0.0), len(now.q))


# ---- Drives (Astrom 2008) ----


@dataclass
class ActuatorLag(Effect):
    """A first-order lag with time constant `time` [s] between command and torque."""

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
        # The mean over the step.
        out[self.joint] = command[self.joint] + apart * (1.0 - decay) * self.time / STEP
        self._state = command[self.joint] + apart * decay
        return out


@dataclass
class ActuatorDelay(Effect):
    """Torques come `time` [s] late, a whole number of steps."""

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
    """The drive delivers at most `level`."""

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
    """Commands below `level` give no torque, those above give less by as much."""

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
    """The drive delivers `gain` times the command."""

    gain: float
    name: ClassVar[str] = "torque_gain"
    trusted_inertia: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, 1.0 + _signed(rng) * min(max(share, 0.06), 0.25))

    def drive(self, command):
        out = command.copy()
        out[self.joint] *= self.gain
        return out


# ---- Encoders (Gawronski 2008) ----


@dataclass
class EncoderOffset(Effect):
    """The encoder shows `offset` more than the position."""

    offset: float
    name: ClassVar[str] = "encoder_offset"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, _signed(rng) * (0.02 + 0.4 * share) * (1.0 if robot.rotary[joint] else 0.1))

    def reading(self, q):
        return q + self.at(self.joint, self.offset, len(q))


@dataclass
class EncoderEccentricity(Effect):
    """The encoder's disc is off its centre: it shows ``a sin q + b cos q`` more."""

    a: float
    b: float
    name: ClassVar[str] = "encoder_eccentricity"

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        size, way = 0.02 + 0.4 * share, rng.uniform(0, TURN)
        return cls(joint, size * math.cos(way), size * math.sin(way))

    def reading(self, q):
        x = q[self.joint]
        return q + self.at(self.joint, self.a * math.sin(x) + self.b * math.cos(x), len(q))


# ---- Between motor and link (Spong 1987; Nordin and Gutman 2002) ----


@dataclass
class Transmission(Effect):
    """A motor of its own: rotor and friction of the joint turn with it, and the encoder shows its position.

    It is integrated by the semi-implicit Euler method at the simulation's step, dry friction as an impulse that stops but does not reverse.
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
        """Return the torque that the link gets."""
        raise NotImplementedError

    def deflection(self, torque: float) -> float:
        """Return the deflection under a torque that has been there for long."""
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


@dataclass
class JointElasticity(Transmission):
    """A shaft between motor and link."""

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
    """Play between stiff flanks, 300 rad/s against the rotor."""

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


# ---- What armgap's library does not have ----


@dataclass
class TorqueDrift(Effect):
    """A torque that grows with time at `rate` [N m/s], from zero in the middle of 10 s."""

    rate: float
    name: ClassVar[str] = "torque_drift"
    outside: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        return cls(joint, _signed(rng) * 0.35 * share * float(use.torque[joint]))

    def torque(self, now):
        return self.at(self.joint, self.rate * (now.t - 5.0), len(now.q))


@dataclass
class CableSpring(Effect):
    """A cable past two joints, `joint` and the next: it pulls on both with ``k (q_j + q_next - rest)``."""

    k: float
    rest: float
    name: ClassVar[str] = "cable_spring"
    outside: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        if joint + 1 == robot.n:
            joint -= 1
        pair = slice(joint, joint + 2)
        low, high = float(use.low[pair].sum()), float(use.high[pair].sum())
        return cls(joint, 3.0 * share * float(use.torque[joint]) / (high - low), float(rng.uniform(low, high)))

    def torque(self, now):
        out = np.zeros(len(now.q))
        out[self.joint : self.joint + 2] = -self.k * (now.q[self.joint] + now.q[self.joint + 1] - self.rest)
        return out


@dataclass
class LoadedCogging(Effect):
    """Cogging in proportion to the torque: ``ratio tau sin(n q + phase)``."""

    ratio: float
    n: float
    phase: float
    name: ClassVar[str] = "loaded_cogging"
    outside: ClassVar[bool] = True

    @classmethod
    def draw(cls, robot, joint, share, use, rng):
        n = rng.uniform(3.0, 8.0) * TURN / (use.high[joint] - use.low[joint])
        return cls(joint, 1.4 * share, float(n), float(rng.uniform(0, TURN)))

    def torque(self, now):
        j = self.joint
        return self.at(j, self.ratio * now.delivered[j] * math.sin(self.n * now.q[j] + self.phase), len(now.q))


EFFECTS: dict[str, type[Effect]] = {
    effect.name: effect
    for effect in (
        Payload, BaseTilt, NominalLink, RotorInertia, Stribeck, StribeckEverywhere, CoulombAsymmetry, ViscousAsymmetry, QuadraticDrag,
        LoadDependentFriction, PositionDependentFriction, FrictionWarmup, TorqueOffset, TorqueRipple, JointSpring, Contact,
        ActuatorLag, ActuatorDelay, TorqueSaturation, TorqueDeadZone, TorqueGain, EncoderOffset, EncoderEccentricity, JointElasticity, Backlash,
        TorqueDrift, CableSpring, LoadedCogging,
    )
}  # fmt: skip
"""Every effect by name; `Null` is not among them."""
