"""Hidden effects of the drive, which act between the commanded torque and the joint."""

from __future__ import annotations

import math

from armgap.trial.effects.base import Draw, Parameters, effect
from armgap.trial.effects.friction import torque_law
from armgap.trial.simulation.actuator import DeadZone, Delay, Gain, Lag, MagneticHysteresis, Saturation, SlewLimit
from armgap.trial.simulation.plant import TIME_STEP, Rotor
from armgap.trial.simulation.simulated_arm import SimulatedArm

#: One turn of a joint, rad.
SPAN = 2.0 * math.pi


@effect("torque_offset", lambda d: {"offset": d.sign() * d.use.torque * d.between(0.01, 0.15)})
def torque_offset(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add a constant torque to the joint of a simulated arm."""
    torque_law(sim, joint, lambda x: p["offset"])


def _draw_gain(d: Draw) -> Parameters:
    return {"gain": 1.0 + d.sign() * d.between(0.1, 0.4)}


@effect("torque_gain", _draw_gain)
def torque_gain(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Multiply the command of a joint of a simulated arm by ``gain``."""
    sim.actuators[joint].add(Gain(p["gain"]))


@effect("actuator_lag", lambda d: {"time_constant": d.between(0.001, 0.02)})
def actuator_lag(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add a first-order lag of ``time_constant`` seconds to the torque of a joint."""
    sim.actuators[joint].add(Lag(p["time_constant"]))


def _draw_delay(d: Draw) -> Parameters:
    parts = math.ceil(d.arm.sample_period / TIME_STEP - 1e-9)
    dt = d.arm.sample_period / parts
    return {"delay": dt * round(d.between(0.001, 0.02) / dt)}


@effect("actuator_delay", _draw_delay)
def actuator_delay(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Delay the torque of a joint by ``delay`` seconds, a whole number of internal steps."""
    sim.actuators[joint].add(Delay(p["delay"]))


@effect("torque_saturation", lambda d: {"level": d.use.peak * (1.0 - d.between(0.06, 0.5))})
def torque_saturation(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Clip the torque of a joint at ``level``, below the peaks of every log."""
    sim.actuators[joint].add(Saturation(p["level"]))


@effect("torque_dead_zone", lambda d: {"level": d.use.torque * d.between(0.02, 0.3)})
def torque_dead_zone(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add a dead zone to the torque of a joint: zero below ``level``, the excess above it."""
    sim.actuators[joint].add(DeadZone(p["level"]))


def _draw_ripple(d: Draw) -> Parameters:
    cycles = d.log_uniform(2.0, 8.0)
    n = cycles * SPAN / d.use.travel
    return {
        "amplitude": d.use.torque * d.between(0.02, 0.3),
        "n": float(round(n)) if d.arm.kind != "axis" else n,
        "phase": d.uniform(-math.pi, math.pi),
    }


@effect("torque_ripple", _draw_ripple)
def torque_ripple(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add the cogging torque ``amplitude sin(n q + phase)`` to a joint."""
    torque_law(sim, joint, lambda x: p["amplitude"] * math.sin(p["n"] * x.q + p["phase"]))


def _draw_elasticity(d: Draw) -> Parameters:
    rotor = d.inertia * d.log_uniform(0.02, 0.1)
    reduced = 1.0 / (1.0 / rotor + 1.0 / d.inertia)
    omega = SPAN * d.between(40.0, 8.0)
    return {
        "stiffness": reduced * omega**2,
        "damping": 2 * d.log_uniform(0.02, 0.2) * reduced * omega,
        "rotor_inertia": rotor,
    }


@effect("joint_elasticity", _draw_elasticity)
def joint_elasticity(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add a rotor to the nominal arm that drives the joint through a spring and damper.

    The encoder and the friction are on the joint's side of the spring.
    """
    sim.config.rotors[joint] = Rotor(p["rotor_inertia"], p["stiffness"], p["damping"])


#: Rotor inertia on the motor side of backlash, as a share of the driven link's inertia about its centre of mass.
BACKLASH_ROTOR = 0.12


@effect("backlash", lambda d: {"gap": d.between(2e-3, 4e-2)}, kinds=("pendulum", "two-link"))
def backlash(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add backlash of total width ``gap`` between motor and joint; the encoder is on the joint's side.

    The motor's inertia is taken out of the driven link's, so that without play the arm is the nominal one.
    """
    inertia = BACKLASH_ROTOR * sim.config.arm.inertia[joint]
    sim.config.rotors[joint] = Rotor(inertia, gap=p["gap"], part_of_link=True)


@effect(
    "slew_limit",
    lambda d: {"rate": d.use.slew * d.between(0.7, 0.15)},
    family="outside",
)
def slew_limit(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Limit the rate of change of a joint's torque to ``rate`` [N m/s or N/s]."""
    sim.actuators[joint].add(SlewLimit(p["rate"]))


@effect(
    "motor_hysteresis",
    lambda d: {"width": d.use.torque * d.between(0.1, 0.6), "share": d.uniform(0.4, 0.8)},
    family="outside",
)
def motor_hysteresis(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Let the part ``share`` of a joint's torque follow the command through a play, as a model of magnetic hysteresis."""
    sim.actuators[joint].add(MagneticHysteresis(p["width"], p["share"]))


@effect(
    "torque_constant_variation",
    lambda d: {"amplitude": d.between(0.08, 0.5), "n": float(round(4 * SPAN / d.use.travel))},
    family="outside",
)
def torque_constant_variation(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Let a joint's torque constant vary with the rotor's position: ``tau (1 + amplitude sin(n q))``."""
    torque_law(sim, joint, lambda x: x.tau * p["amplitude"] * math.sin(p["n"] * x.q))


@effect(
    "speed_ripple",
    lambda d: {
        "amplitude": d.use.torque * d.between(0.06, 0.5) / d.use.speed,
        "n": float(round(5 * SPAN / d.use.travel)),
    },
    family="outside",
)
def speed_ripple(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add torque ripple that grows with speed to a joint: ``amplitude dq sin(n q)``, as by an uneven gear."""
    torque_law(sim, joint, lambda x: p["amplitude"] * x.dq * math.sin(p["n"] * x.q))
