"""Shifts of torques beside friction at rest, and signs of an axis that carries weight."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armgap import Arm, Log, diagnose, simulate
from armgap.check import Check, examine, time_shift
from armgap.check.equation_error import EquationError, Rows, bounds
from armgap.simulation import Effect
from swings import carried

AXIS = """\
name = "Vertical axis"
kind = "axis"
gravity = 9.81
sample_period = 0.002

[inertial]
theta = [12.8, 52.0]

[friction]
viscous = [42.0]
coulomb = [21.6]
"""


@pytest.fixture(scope="module")
def axis(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    path: Path = tmp_path_factory.mktemp("axis") / "axis.toml"
    path.write_text(AXIS)
    return Arm.read(path)


def lifts(arm: Arm, height: float) -> list[Log]:
    """Return two logs of eight seconds of an axis under its weight and three sines, which let it stick now and then."""
    t = np.arange(4000) * arm.sample_period
    logs = []
    for seed in (1, 2):
        speed, phase = np.random.default_rng(seed).uniform([[3.0], [0.0]], [[12.0], [6.28]], (2, 3))
        tau = 52.0 + height * np.sin(np.outer(t, speed) + phase).sum(axis=1)
        logs.append(simulate(arm, t, tau, noise=1e-6, seed=seed, name=f"run {seed}"))
    return logs


def checked(logs: list[Log], arm: Arm) -> list[Check]:
    return list(examine(logs[:1], logs[1:], arm).checks)


def late(logs: list[Log], rows: int) -> list[Log]:
    """Return the logs with torques that stand some rows too late."""
    return [replace(log, tau=np.vstack([np.repeat(log.tau[:1], rows, axis=0), log.tau[:-rows]])) for log in logs]


@pytest.mark.parametrize("rows", [2, 5])
def test_friction_at_rest_does_not_hide_a_shift(axis: Arm, rows: int) -> None:
    logs = lifts(axis, 30.0)
    speed = np.abs(np.diff(logs[0].q[:, 0])) / axis.sample_period
    assert 0.1 < np.mean(speed < 1e-2 * speed.max()) < 0.9, "the axis sticks for a part of the time"
    assert checked(logs, axis) == []
    assert time_shift.acausal(late(logs, rows), axis) == rows
    [check] = checked(late(logs, rows), axis)
    assert (check.check, check.remedies) == ("time_shift", (f"--shift tau=-{rows * axis.sample_period:g}",))


@pytest.mark.parametrize(
    ("column", "name", "remedies"),
    [
        ("q", "position_sign", ("--flip q1", "--flip tau1 --gravity reversed")),
        ("tau", "torque_sign", ("--flip tau1", "--flip q1 --gravity reversed")),
    ],
)
def test_weight_tells_reversed_positions_from_reversed_torques(
    axis: Arm, column: str, name: str, remedies: tuple[str, ...]
) -> None:
    logs = [replace(log, **{column: -getattr(log, column)}) for log in lifts(axis, 40.0)]
    [check] = checked(logs, axis)
    assert (check.check, check.severity, check.remedies) == (name, "error", remedies)


@pytest.mark.slow
def test_an_arm_file_that_is_too_sure_of_wrong_values_is_given_up(arm: Arm) -> None:
    wrong = np.where(np.arange(len(arm.theta)) < arm.n_inertial, 3.0, 1.0)
    sure = replace(arm, theta=wrong * arm.theta, sigma=0.05 * wrong * arm.theta)
    logs = carried(arm)
    found = diagnose(logs[:1], sure, holdout=logs[1:], max_causes=0)
    assert found.verdict == "parameters"
    assert max(found.gap.refit) < 0.01 * min(found.gap.before)


def test_a_joint_that_comes_to_rest_says_nothing_of_shifts(axis: Arm) -> None:
    t = np.arange(4000) * axis.sample_period
    logs = []
    for seed in (1, 2):
        speed, phase = np.random.default_rng(seed).uniform([[3.0], [0.0]], [[12.0], [6.28]], (2, 3))
        tau = 52.0 + (t < 3.5) * 30.0 * np.sin(np.outer(t, speed) + phase).sum(axis=1)
        logs.append(simulate(axis, t, tau, noise=1e-6, seed=seed, name=f"run {seed}"))
    assert checked(logs, axis) == []
    assert time_shift.acausal(logs, axis) is None
    assert time_shift.acausal(late(logs, 3), axis) == 3


def test_a_torque_that_never_changes_has_no_shift(axis: Arm) -> None:
    logs = [replace(log, tau=np.full_like(log.tau, 52.0)) for log in lifts(axis, 30.0)]
    assert time_shift.acausal(logs, axis) in (None, 0)


def test_a_joint_that_sticks_behind_a_limited_drive_is_of_this_arm(arm: Arm) -> None:
    logs = carried(arm, Effect("torque_saturation", 2, {"level": 1.1 * arm.theta[-1]}), scale=0.25)
    base = EquationError([Rows.of(log, arm) for log in logs], arm)
    moving = np.concatenate([rows.moving(log) for log, rows in zip(logs, base.rows, strict=True)])
    assert moving[:, 1].mean() < 0.5
    assert not any(check.severity == "error" for check in checked(logs, arm))
    within = EquationError([r.within(r.moving(log)) for log, r in zip(logs, base.rows, strict=True)], arm)
    low, high = bounds(arm)
    assert within.of_torques(within.fit(low, high)).share[1] < 0.1 * base.of_torques(base.fit(low, high)).share[1]


def dwelling(arm: Arm, held: float, weight: float) -> list[Log]:
    """Return two logs of strokes of an axis with dwells between them, whose torque is constant: `held` Coulomb frictions above the weight."""
    t = np.arange(5000) * arm.sample_period
    logs = []
    for seed in (1, 2):
        phase, cycle = np.random.default_rng(seed).uniform(0.0, 6.28), t % 2.5
        stroke = 70.0 * np.sin(2 * np.pi * cycle / 1.25) + 5.0 * np.sin(9.0 * t + phase)
        tau = weight + np.where(cycle < 1.25, stroke, held * arm.theta[-1])
        logs.append(simulate(arm, t, tau, noise=0.0, seed=seed, name=f"run {seed}"))
    return logs


@pytest.mark.parametrize("held", [0.9, -0.9])
def test_a_torque_that_holds_a_joint_against_dry_friction_is_not_missing(axis: Arm, held: float) -> None:
    arm = replace(axis, theta=np.array([12.8, 0.0, 42.0, 21.6]))
    assert not any(c.check == "dead_stretch" for c in checked(dwelling(arm, held, 0.0), arm))


def test_a_torque_that_is_missing_while_the_joint_bears_a_load_is_still_found(axis: Arm) -> None:
    arm = replace(axis, theta=np.array([12.8, 120.0, 42.0, 21.6]))
    logs = dwelling(arm, 0.9, 120.0)
    dead = logs[0].tau.copy()
    dead[np.flatnonzero((logs[0].t > 1.3) & (logs[0].t < 2.4))] = 0.0
    found = checked([replace(logs[0], tau=dead), logs[1]], arm)
    assert [c.check for c in found if c.severity == "error"] == ["dead_stretch"]
