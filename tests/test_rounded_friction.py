"""Friction that is rounded around standstill: a nuisance whose width is fitted, and no cause."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armgap import Arm, Diagnosis, Log, diagnose, simulate
from armgap.cli.demo import CASE_FOLDER
from armgap.simulation import Effect

LAG = Effect("actuator_lag", 1, {"time_constant": 0.006})


def sines(arm: Arm, seed: int) -> np.ndarray:
    """Ten seconds of five sines on each joint, drawn from a seed."""
    t = np.arange(4000) * arm.sample_period
    draw = np.random.default_rng(seed)
    speed, phase = 2 * np.pi * draw.uniform(0.4, 2.6, (2, 5)), draw.uniform(0, 6.28, (2, 5))
    waves = np.sin(t[:, None, None] * speed + phase).sum(axis=2)
    return waves * [18.0, 2.1]


def diagnosed(width: float, *effects: Effect) -> Diagnosis:
    """A two-link arm of slightly other values than its file's, with friction rounded over this width [rad/s]."""
    arm = Arm.read(CASE_FOLDER / "arm.toml")
    real = replace(arm, theta=arm.theta * np.random.default_rng(5).uniform(0.95, 1.05, len(arm.theta)))

    def log(seed: int) -> Log:
        t, tau = np.arange(4000) * arm.sample_period, sines(arm, seed)
        kept = {"effects": effects, "smoothing": width, "noise": 2e-5, "seed": seed, "tolerance": 1e-7}
        return simulate(real, t, tau, name=f"run {seed}", **kept)

    return diagnose(log(1), arm, holdout=log(2))


@pytest.fixture(scope="module", params=[(), (LAG,)], ids=["nothing hidden", "lag hidden"])
def hidden(request) -> tuple[Effect, ...]:
    return request.param


@pytest.fixture(scope="module")
def dry(hidden) -> Diagnosis:
    return diagnosed(0.0, *hidden)


@pytest.mark.parametrize("width", [0.01, 0.05, 0.2])
def test_the_width_is_found_and_gets_no_name(width, hidden, dry):
    result = diagnosed(width, *hidden)
    assert [c.effect for c in result.causes] == [e.name for e in hidden]
    assert result.to_dict()["options"]["friction_smoothing"] == pytest.approx(width, rel=0.05)
    assert all(np.array(result.gap.after) < 1.5 * np.array(dry.gap.after))


def test_dry_friction_stays_dry(hidden, dry):
    assert [c.effect for c in dry.causes] == [e.name for e in hidden]
    assert dry.to_dict()["options"]["friction_smoothing"] == 0.0
