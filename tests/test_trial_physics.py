"""Hidden effects act as their equations say: MuJoCo against an integration that shares no code with it."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="making cases needs armgap[trial]")
pytest.importorskip("scipy")

from armgap.trial.cases.case import make_case, simulated_arm_of
from armgap.trial.cases.key import HiddenEffect
from armgap.trial.effects import REGISTRY
from armgap.trial.simulation.arms import DIRECT_DRIVE, GEARED, TrialArm
from armgap.trial.simulation.excitation import Tracked, rings
from armgap.trial.simulation.plant import PlantConfig
from armgap.trial.simulation.simulated_arm import CommandSource, SimulatedArm, Trace, run
from dry_friction import DryArm

TH = np.array(DIRECT_DRIVE.theta)
PAYLOAD = np.array([0.45**2 + 0.2**2, 0.45 * 0.2, 0.2**2, 9.81 * 0.45, 9.81 * 0.2, 0, 0, 0, 0])  # per kg at 0.2 m

ORACLES = {
    "stribeck": (
        {"amplitude": 1.0, "velocity": 0.3},
        DryArm(TH, level=lambda t, q, v: np.array([0, np.exp(-((v[1] / 0.3) ** 2))])),
    ),
    "quadratic_drag": ({"c": 0.05}, DryArm(TH, extra=lambda t, q, v: np.array([0, -0.05 * v[1] * abs(v[1])]))),
    "torque_offset": ({"offset": 0.3}, DryArm(TH, extra=lambda t, q, v: np.array([0, 0.3]))),
    "coulomb_asymmetry": ({"delta": 0.3}, DryArm(TH, extra=lambda t, q, v: np.array([0, -0.3]))),
    "position_dependent_friction": (
        {"a": 0.4, "b": 0.5},
        DryArm(TH, level=lambda t, q, v: np.array([0, 0.4 * np.cos(q[1]) + 0.5 * np.sin(q[1])])),
    ),
    "friction_warmup": (
        {"amplitude": 0.5, "time_constant": 1.0},
        DryArm(
            TH,
            level=lambda t, q, v: np.array([0, TH[8] * 0.5 * np.exp(-t)]),
            extra=lambda t, q, v: np.array([0, -TH[6] * v[1] * 0.5 * np.exp(-t)]),
        ),
    ),
    "torque_ripple": (
        {"amplitude": 1.0, "n": 12.0, "phase": 0.3},
        DryArm(TH, extra=lambda t, q, v: np.array([0, np.sin(12 * q[1] + 0.3)])),
    ),
    "joint_spring": ({"k": 2.0, "q0": 0.1}, DryArm(TH, extra=lambda t, q, v: np.array([0, -2 * (q[1] - 0.1)]))),
    "contact": (
        {"position": 0.3, "stiffness": 60.0, "damping": 0.5},
        DryArm(TH, extra=lambda t, q, v: np.array([0, -max(60 * (q[1] - 0.3) + 0.5 * v[1], 0) * (q[1] > 0.3)])),
    ),
    "rotor_inertia": ({"inertia": 0.05}, DryArm(TH, armature=(0.0, 0.05))),
    "base_tilt": ({"angle": 0.1}, DryArm(TH, tilt=0.1)),
    "payload": ({"mass": 0.4, "distance": 0.2}, DryArm(TH + 0.4 * PAYLOAD)),
}


def paper_torque(scale: tuple[float, float] = (1.0, 1.0)) -> CommandSource:
    """Equations (31)-(32) of Reyes and Kelly (1997), scaled per joint."""

    def command(t: float, _q: list[float]) -> list[float]:
        first = (1 - math.exp(-0.8 * t)) * 29 + 68 * math.sin(16 * t + 0.1) + 9 * math.sin(20 * t + 0.15)
        second = (1 - math.exp(-1.8 * t)) * 1.2 + 8 * math.sin(26 * t + 0.08) + 2 * math.sin(12 * t + 0.34)
        return [scale[0] * first, scale[1] * second]

    return command


def worst_deviation(arm: TrialArm, trace: Trace, oracle: DryArm, window: int = 100) -> float:
    """Largest deviation over windows of 0.25 s that start from the engine's state, in encoder steps."""
    worst = 0.0
    for s in range(0, len(trace.t) - window, window):
        part = slice(s, s + window + 1)
        q = oracle.window(trace.t[part], trace.tau[part], trace.q_true[s], trace.dq_true[s])
        worst = max(worst, float(np.max(np.abs(q - trace.q_true[part]) / np.array(arm.step))))
    return worst


@pytest.mark.parametrize(("arm", "scale"), [(DIRECT_DRIVE, (1.0, 1.0)), (GEARED, (0.035, 0.12))])
def test_the_nominal_arm_to_a_fraction_of_an_encoder_step(arm: TrialArm, scale: tuple[float, float]) -> None:
    trace = run(SimulatedArm(PlantConfig(arm)), paper_torque(scale), 3.0)
    moving = np.sign(trace.dq_true[np.abs(trace.dq_true[:, 1]) > 0.02, 1])
    assert np.sum(moving[1:] != moving[:-1]) > 10  # or dry friction would not be tested
    assert worst_deviation(arm, trace, DryArm(arm.theta)) < 0.25


@pytest.mark.parametrize("name", ORACLES)
def test_an_effect_to_half_an_encoder_step(name: str) -> None:
    parameters, oracle = ORACLES[name]
    hidden = HiddenEffect(name, 2 if REGISTRY[name].per_joint else None, parameters)
    trace = run(simulated_arm_of(DIRECT_DRIVE, [hidden]), paper_torque(), 1.8)
    assert worst_deviation(DIRECT_DRIVE, trace, oracle) < 0.5
    assert worst_deviation(DIRECT_DRIVE, trace, DryArm(TH)) > 20  # the nominal arm would not do


def test_a_loop_that_oscillates_on_an_elastic_joint_is_made_softer() -> None:
    hidden = [("joint_elasticity", 2)]
    made = make_case([9029, 1], hidden, model="geared", size=0.0, style="tracked", sample_period=0.0025, duration=3.0)
    assert not any(rings(trace) for trace in made.logs.values())
    stiff = Tracked(
        centre=np.array([0.2, 0.4]),
        amplitude=np.full((2, 1), 0.3),
        omega=np.full((2, 1), 4.0),
        phase=np.zeros((2, 1)),
        stiffness=np.array(GEARED.joint_inertia) * 18.0**2,
        damping=1.4 * np.array(GEARED.joint_inertia) * 18.0,
        limit=np.array(GEARED.torque_limit),
    )
    spring = [HiddenEffect("joint_elasticity", 2, {"stiffness": 127.0, "damping": 0.046, "rotor_inertia": 0.0021})]
    before, after = (
        run(simulated_arm_of(GEARED, spring), m.source(GEARED), 2.0) for m in (stiff, stiff.softer().softer())
    )
    assert rings(before)
    assert not rings(after)
