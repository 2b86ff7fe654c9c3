"""Effects with states that no encoder shows, and pushes: each is named, located and sized; without them nothing is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armgap import Arm, Log, diagnose, simulate
from armgap.simulation import Effect

REAL = np.array([0.052, 0.58, 0.018, 0.11])  # kg m^2, N m, N m s/rad, N m
ARM = Arm("bench", "pendulum", 9.81, 0.002, 1.03 * REAL, sigma=0.1 * REAL)
TRUE = Arm("bench", "pendulum", 9.81, 0.002, REAL, sigma=0.1 * REAL)
NOISE = 2e-5  # rad
TOLERANCE = 5e-5  # rad, over eight seconds: flanks that meet and part converge slowly

CASES = {
    "presliding": {"amplitude": 0.06, "stiffness": 2.0},
    "joint_elasticity": {"stiffness": 14.0, "damping": 0.02, "rotor_inertia": 0.003},
    "backlash": {"gap": 0.006, "rotor_share": 0.08, "riding": 1.0},
}


def run(seed: int, *effects: Effect, name: str = "log") -> Log:
    """Eight seconds of a multisine of its own."""
    t = np.arange(4000) * TRUE.sample_period
    draw = np.random.default_rng(seed).uniform(size=(3, 6))
    tau = ((0.1 + 0.3 * draw[0]) * np.sin(np.outer(t, 1.0 + 20.0 * draw[1]) + 6 * draw[2])).sum(axis=1)
    return simulate(TRUE, t, tau, effects=list(effects), noise=NOISE, seed=seed, tolerance=TOLERANCE, name=name)


@pytest.mark.parametrize("name", ["joint_elasticity", "backlash"])
def test_encoder_and_friction_at_the_motor(name: str) -> None:
    at_motor = Effect(name, 1, {**CASES[name], "encoder_at_motor": 1.0, "friction_at_motor": 1.0})
    found = diagnose(run(1, at_motor), ARM, holdout=run(2, at_motor))
    cause = found.causes[0]
    assert (cause.effect, cause.joint) == (name, 1)
    assert cause.sides == {"encoder": "motor", "friction": "motor", "rotor": "geared"}
    size = next(iter(CASES[name]))
    assert cause.parameters[size].value == pytest.approx(CASES[name][size], rel=0.2)


def test_only_the_sides_of_the_arm_file_are_tried() -> None:
    effect = Effect("joint_elasticity", 1, CASES["joint_elasticity"])
    known = replace(ARM, encoder_side=("link",), friction_side=("link",))
    cause = diagnose(run(1, effect), known, holdout=run(2, effect)).causes[0]
    assert cause.sides == {"encoder": "link", "friction": "link", "rotor": "geared"}


@pytest.mark.parametrize("name", CASES)
def test_a_hidden_state_is_named_and_sized(name: str) -> None:
    effect = Effect(name, 1, CASES[name])
    found = diagnose(run(1, effect), ARM, holdout=run(2, effect))
    assert found.verdict == "effect"
    cause = found.causes[0]
    assert (cause.effect, cause.joint) == (name, 1)
    for key in ("amplitude", "stiffness", "gap"):
        if key in CASES[name]:
            assert cause.parameters[key].value == pytest.approx(CASES[name][key], rel=0.15)
    assert found.gap.closed > 0.8


def test_pushes_are_found_in_the_log_they_belong_to() -> None:
    pushes = [(2.0, 0.1, 0.05), (5.5, 0.06, -0.04)]
    effects = [Effect("external_pulse", 1, {"time": t, "duration": d, "impulse": i}) for t, d, i in pushes]
    found = diagnose(run(1, *effects, name="pushed"), ARM, holdout=run(2))
    assert [(c.effect, c.joint, c.log) for c in found.causes] == [("external_pulse", 1, "pushed")] * 2
    named = sorted((c.parameters["time"].value, c.parameters["impulse"].value) for c in found.causes)
    for (time, impulse), (true_time, _, true_impulse) in zip(named, pushes, strict=True):
        assert time == pytest.approx(true_time, abs=0.01)
        assert impulse == pytest.approx(true_impulse, rel=0.05)


def test_a_push_is_found_without_a_holdout() -> None:
    effect = Effect("external_pulse", 1, {"time": 6.5, "duration": 0.1, "impulse": 0.06})
    [cause] = diagnose(run(3, effect, name="alone"), ARM).causes
    assert (cause.effect, cause.log) == ("external_pulse", "alone")
    assert cause.parameters["time"].value == pytest.approx(6.5, abs=0.01)


def test_nothing_is_named_where_nothing_is_hidden() -> None:
    found = diagnose(run(1), ARM, holdout=run(2))
    assert (found.verdict, found.causes) == ("parameters", ())
