"""Hidden effects of the structure: masses, gravity, springs, contacts, and external disturbances."""

from __future__ import annotations

import math

from armgap.trial.effects.base import ROTARY, TWO_LINK, Draw, Parameters, effect
from armgap.trial.effects.friction import torque_law
from armgap.trial.simulation.plant import TIME_STEP, Flexure, JointState
from armgap.trial.simulation.simulated_arm import SimulatedArm


def _draw_payload(d: Draw) -> Parameters:
    last = d.arm.n_joints - 1
    distance = d.arm.length[last] * d.uniform(0.4, 1.0)
    moment = d.arm.mass[last] * d.arm.com[last] * d.between(0.2, 1.5)
    return {"mass": moment / distance, "distance": distance}


@effect("payload", _draw_payload, per_joint=False, kinds=ROTARY)
def payload(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add a point mass ``mass`` [kg] to the last link of a simulated arm, at ``distance`` [m] from the link's joint."""
    sim.config.payload = (p["mass"], p["distance"])


@effect("base_tilt", lambda d: {"angle": d.sign() * d.between(0.01, 0.15)}, per_joint=False, kinds=ROTARY)
def base_tilt(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Tilt the base of a simulated arm in the plane of motion: gravity acts as at ``q1 + angle``."""
    sim.config.tilt += p["angle"]


def _draw_spring(d: Draw) -> Parameters:
    k = d.use.torque * d.between(0.04, 0.6) / (0.5 * d.use.travel)
    return {"k": k, "q0": d.uniform(d.use.low, d.use.high)}


@effect("joint_spring", _draw_spring)
def joint_spring(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add a spring ``k (q - q0)`` to a joint, by MuJoCo's joint stiffness."""
    sim.config.spring[joint] = (p["k"], p["q0"], 0.0)


def _draw_armature(d: Draw) -> Parameters:
    # A rotor inertia of joint 1 only adds to theta1: it has to be larger than the standard deviation of theta1.
    low = 0.2 if d.joint == 0 else 0.04
    return {"inertia": d.inertia * d.between(low, 0.8)}


@effect("rotor_inertia", _draw_armature)
def rotor_inertia(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add inertia that acts on a joint's own acceleration only, by MuJoCo's armature."""
    sim.config.armature[joint] = p["inertia"]


def _draw_contact(d: Draw) -> Parameters:
    side = d.high_side()
    reach = d.use.high if side > 0 else -d.use.low
    overlap = max(reach, 0.0) * d.between(0.05, 0.35)
    stiffness = d.log_uniform(1.0, 8.0) * d.use.torque / max(overlap, 1e-3)
    damping = 2 * d.uniform(0.05, 0.4) * math.sqrt(stiffness * d.inertia)
    return {"position": side * (reach - overlap), "stiffness": stiffness, "damping": damping}


@effect("contact", _draw_contact)
def contact(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add a unilateral spring and damper to a joint beyond ``position``, on the side away from zero."""
    side = math.copysign(1.0, p["position"])

    def push(x: JointState) -> float:
        depth = side * (x.q - p["position"])
        force = p["stiffness"] * depth + p["damping"] * side * x.dq
        return -side * max(force, 0.0) if depth > 0 else 0.0

    torque_law(sim, joint, push)
    sim.config.discontinuities.setdefault(joint, []).append(p["position"])


def _draw_pulse(d: Draw) -> Parameters:
    # Both edges of the pulse lie on the grid of internal steps, so that the impulse is exact.
    grid = 2 * TIME_STEP
    return {
        "time": grid * round(d.uniform(0.1, 0.9) * d.use.duration / grid),
        "duration": grid * round(d.log_uniform(0.03, 0.3) / grid),
        "impulse": d.sign() * d.inertia * d.use.speed * d.between(0.05, 0.6),
    }


@effect("external_pulse", _draw_pulse)
def external_pulse(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add a constant torque of a given impulse to a joint, for ``duration`` around ``time``."""
    half, torque = 0.5 * p["duration"], p["impulse"] / p["duration"]
    torque_law(sim, joint, lambda x: torque if abs(x.t - p["time"]) < half else 0.0)


def _draw_hardening(d: Draw) -> Parameters:
    k, q0 = _draw_spring(d).values()
    return {"k": 0.3 * k, "q0": q0, "cubic": k / (0.5 * d.use.travel) ** 2}


@effect("hardening_spring", _draw_hardening, family="further")
def hardening_spring(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add a spring ``k (q - q0) + cubic (q - q0)^3`` to a joint, by MuJoCo's polynomial stiffness."""
    sim.config.spring[joint] = (p["k"], p["q0"], p["cubic"])


def _draw_coupling(d: Draw) -> Parameters:
    gear = d.sign() * float(d.rng.choice([4.0, 6.0, 8.0]))
    return {"inertia": d.arm.joint_inertia[1] * d.between(0.05, 0.5) / gear**2, "gear": gear}


@effect("rotor_coupling", _draw_coupling, per_joint=False, family="further", kinds=TWO_LINK)
def rotor_coupling(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add a geared rotor of joint 2 to link 1: energy ``inertia (dq1 + gear dq2)^2 / 2``, by MuJoCo's tendon armature."""
    sim.config.coupling = (p["inertia"], p["gear"])


@effect(
    "cubic_drag",
    lambda d: {"c3": (d.coulomb + d.arm.viscous[d.joint] * d.use.speed) * d.between(0.2, 1.5) / d.use.speed**3},
    family="further",
)
def cubic_drag(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add cubic drag ``c3 dq^3`` to a joint, by MuJoCo's cubic damping."""
    quadratic, cubic = sim.config.drag.get(joint, (0.0, 0.0))
    sim.config.drag[joint] = (quadratic, cubic + p["c3"])


def _draw_flexure(d: Draw) -> Parameters:
    last = d.arm.n_joints - 1
    moving = 0.2 * (d.arm.inertia[last] if d.arm.kind != "axis" else d.arm.mass[0])
    omega = 2 * math.pi * d.between(20.0, 5.0)
    return {"stiffness": moving * omega**2, "damping": 2 * 0.03 * moving * omega}


@effect("link_flexibility", _draw_flexure, per_joint=False, family="outside")
def link_flexibility(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Mount the outer part of the last link on a spring and damper, which adds one vibration mode."""
    sim.config.flexure = Flexure(p["stiffness"], p["damping"])
