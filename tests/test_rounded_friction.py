"""Friction that is rounded around standstill: a nuisance whose width is fitted, and no cause."""

from __future__ import annotations

import numpy as np
import pytest

from armgap import Arm, Diagnosis, Log, diagnose, simulate
from armgap.cli.demo import CASE_FOLDER
from armgap.simulation import Effect
from swings import off, sines

LAG = Effect("actuator_lag", 1, {"time_constant": 0.006})


def diagnosed(width: float, *effects: Effect) -> Diagnosis:
    """A two-link arm of slightly other values than its file's, with friction rounded over this width [rad/s]."""
    arm = Arm.read(CASE_FOLDER / "arm.toml")
    real, t = off(arm), np.arange(4000) * arm.sample_period

    def log(seed: int) -> Log:
        kept = {"effects": effects, "smoothing": width, "noise": 2e-5, "seed": seed, "tolerance": 1e-7}
        return simulate(real, t, sines(t, seed), name=f"run {seed}", **kept)

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
    assert result.to_dict()["options"]["friction_widths"] == pytest.approx([width, width], rel=0.05)
    assert all(np.array(result.gap.after) < 2.0 * np.array(result.gap.floor))


def test_dry_friction_stays_dry(hidden, dry):
    assert [c.effect for c in dry.causes] == [e.name for e in hidden]
    assert dry.to_dict()["options"]["friction_widths"] == [0.0, 0.0]
