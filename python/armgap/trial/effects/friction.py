"""Hidden effects of friction; Coulomb levels are set on MuJoCo's ``frictionloss`` step by step."""

from __future__ import annotations

import math

from armgap.trial.effects.base import ANY, TWO_LINK, Draw, Parameters, effect
from armgap.trial.simulation.plant import FrictionLaw, JointState, TorqueLaw
from armgap.trial.simulation.simulated_arm import SimulatedArm


def torque_law(sim: SimulatedArm, joint: int, law: TorqueLaw) -> None:
    """Add a function of the joint's state for an additional torque [N m or N] to a joint of a simulated arm."""
    sim.config.torque_laws.setdefault(joint, []).append(law)


def friction_law(sim: SimulatedArm, joint: int, law: FrictionLaw) -> None:
    """Add a function of the joint's state for an additional Coulomb friction level [N m or N] to a joint of a simulated arm."""
    sim.config.friction_laws.setdefault(joint, []).append(law)


@effect("coulomb_asymmetry", lambda d: {"delta": d.sign() * d.coulomb * d.between(0.05, 0.5)})
def coulomb_asymmetry(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Set Coulomb friction of a joint to ``fc + delta`` forward and ``fc - delta`` backward.

    At rest friction takes any value between the two, so asymmetric friction equals symmetric friction plus the torque ``-delta``.
    """
    torque_law(sim, joint, lambda x: -p["delta"])


def _draw_stribeck(d: Draw) -> Parameters:
    return {
        "amplitude": d.coulomb * d.between(0.15, 1.0),
        "velocity": d.use.speed * d.log_uniform(0.04, 0.3),
    }


@effect("stribeck", _draw_stribeck)
def stribeck(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add the Stribeck term ``amplitude exp(-(dq / velocity)^2)`` to the Coulomb friction of a joint."""
    friction_law(sim, joint, lambda x, level: p["amplitude"] * math.exp(-((x.dq / p["velocity"]) ** 2)))


def _draw_quadratic(d: Draw) -> Parameters:
    viscous = d.arm.viscous[d.joint] * d.use.speed
    return {"c": (d.coulomb + viscous) * d.between(0.1, 1.0) / d.use.speed**2}


@effect("quadratic_drag", _draw_quadratic)
def quadratic_drag(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add quadratic drag ``c dq |dq|`` to a joint, MuJoCo's quadratic damping."""
    quadratic, cubic = sim.config.drag.get(joint, (0.0, 0.0))
    sim.config.drag[joint] = (quadratic + p["c"], cubic)


@effect("load_dependent_friction", lambda d: {"mu": d.between(0.05, 0.4)}, kinds=("pendulum", "two-link"))
def load_dependent_friction(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add ``mu |C dq + g|`` to the Coulomb friction of a joint: a share of the load by gravity and Coriolis forces."""
    friction_law(sim, joint, lambda x, level: p["mu"] * abs(x.load))


def _draw_position(d: Draw) -> Parameters:
    size, angle = d.coulomb * d.between(0.15, 0.75), d.uniform(-math.pi, math.pi)
    return {"a": size * math.cos(angle), "b": size * math.sin(angle)}


@effect("position_dependent_friction", _draw_position, kinds=("pendulum", "two-link"))
def position_dependent_friction(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add ``a cos q + b sin q`` to the Coulomb friction of a joint."""
    friction_law(sim, joint, lambda x, level: p["a"] * math.cos(x.q) + p["b"] * math.sin(x.q))


def _draw_warmup(d: Draw) -> Parameters:
    return {
        "amplitude": d.between(0.15, 1.0),
        "time_constant": d.use.duration * d.uniform(0.15, 0.6),
    }


@effect("friction_warmup", _draw_warmup)
def friction_warmup(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Multiply viscous and Coulomb friction of a joint by ``1 + amplitude exp(-t / time_constant)``, from the start of each log."""
    viscous = sim.config.arm.viscous[joint]

    def excess(t: float) -> float:
        return p["amplitude"] * math.exp(-t / p["time_constant"])

    friction_law(sim, joint, lambda x, level: level * excess(x.t))
    torque_law(sim, joint, lambda x: -viscous * x.dq * excess(x.t))


def _draw_presliding(d: Draw) -> Parameters:
    amplitude = d.coulomb * d.between(0.2, 1.0)
    return {"amplitude": amplitude, "stiffness": amplitude / (d.use.travel * d.log_uniform(3e-3, 3e-2))}


@effect("presliding", _draw_presliding)
def presliding(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add Dahl friction to the Coulomb friction of a joint: ``dz/dt = stiffness dq (1 - sgn(dq) z / amplitude)``."""
    torque_law(sim, joint, Dahl(p["amplitude"], p["stiffness"]))


class Dahl:
    """Dahl friction torque ``-z`` of a joint, integrated exactly: `z` tends to the amplitude with the distance travelled.

    After a simulation step that is undone, the next call is for an earlier time; the state before the undone step is then restored.
    """

    def __init__(self, amplitude: float, stiffness: float) -> None:
        self._amplitude, self._length = amplitude, amplitude / stiffness
        self._now = self._before = (-math.inf, 0.0, 0.0)  # t, q, z

    def __call__(self, x: JointState) -> float:
        """Return the friction torque on the joint [N m or N]."""
        start = self._before if x.t <= self._now[0] else self._now
        _, q, z = start
        goal = math.copysign(self._amplitude, x.q - q)
        z = goal + (z - goal) * math.exp(-abs(x.q - q) / self._length)
        self._before, self._now = start, (x.t, x.q, z)
        return -z


def _draw_asymmetric(d: Draw) -> Parameters:
    viscous = max(d.arm.viscous[d.joint], 0.2 * d.coulomb / d.use.speed)
    return {"delta": d.sign() * viscous * d.between(0.2, 0.9)}


@effect("viscous_asymmetry", _draw_asymmetric, family="further")
def viscous_asymmetry(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Set the viscous coefficient of a joint to ``b + delta`` forward and ``b - delta`` backward."""
    torque_law(sim, joint, lambda x: -p["delta"] * abs(x.dq))


@effect("gear_efficiency", lambda d: {"loss": d.between(0.03, 0.3)}, family="further", kinds=ANY)
def gear_efficiency(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Let the share ``loss`` of a motor's torque be lost while the motor drives the joint (``tau dq > 0``), none while the joint drives the motor."""
    torque_law(sim, joint, lambda x: -p["loss"] * x.tau if x.tau * x.dq > 0 else 0.0)


@effect(
    "cross_friction",
    lambda d: {"level": d.coulomb * d.between(0.1, 0.7)},
    family="further",
    kinds=TWO_LINK,
)
def cross_friction(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add friction ``level sgn(dq)`` to a joint of a two-link arm, with ``dq`` the other joint's velocity, as in wrists that share a gear."""
    other = 1 - joint
    torque_law(sim, joint, lambda x: -p["level"] * math.tanh(x.others[other][1] / 0.01))
