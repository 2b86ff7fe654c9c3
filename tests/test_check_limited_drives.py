"""Drives that are limited in size or in rate: no other unit and no other columns, alone or behind columns in another unit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from armgap import Arm, Log, simulate
from armgap.check import Check, Corrections, dead_stretch, drive_limit, examine
from armgap.check.contradiction import screen
from armgap.check.equation_error import EquationError, Rows, bounds
from armgap.simulation import Effect
from swings import carried, off


def checked(logs: list[Log], arm: Arm) -> tuple[Check, ...]:
    return examine(logs[:1], logs[1:], arm).checks


def test_a_drive_that_saturates_far_below_its_command_has_no_other_unit(arm: Arm) -> None:
    logs = carried(arm, Effect("torque_saturation", 2, {"level": 0.6}), scale=3.0)
    base = EquationError([Rows.of(log, arm) for log in logs], arm)
    assert (
        not 0.5
        < base.size_of(base.with_factors(*bounds(arm, 2.0), base.expected()).theta)[1] * base.expected()[1]
        < 2.0
    )
    assert not any(c.check == "torque_unit" for c in checked(logs, arm))


@pytest.mark.parametrize("level", [0.6, 1.5])
def test_columns_in_another_unit_before_a_drive_that_saturates(arm: Arm, level: float) -> None:
    logs = carried(arm, Effect("torque_saturation", 2, {"level": level}), scale=3.0)
    [check] = checked([Corrections(factor={"tau": 12.5}).on_log(log) for log in logs], arm)
    assert (check.check, check.severity) == ("torque_unit", "repaired")
    assert float(check.remedies[0].removeprefix("--factor tau=")) == pytest.approx(0.08, rel=0.05)


def switched(t: np.ndarray, seed: int) -> np.ndarray:
    """Torques that switch between two levels and nothing at random instants, before 0.4 s have passed."""
    rng = np.random.default_rng(seed)
    tau = np.zeros((len(t), 2))
    for j, level in enumerate((45.0, 4.5)):
        starts = np.cumsum(rng.uniform(0.15, 0.38, 100))
        tau[:, j] = rng.choice([-level, -0.5 * level, 0.5 * level, level], 101)[np.searchsorted(starts, t)]
    return tau


@pytest.mark.slow
def test_a_drive_that_slews_far_behind_its_command_has_no_other_columns(arm: Arm) -> None:
    t = np.arange(2400) * arm.sample_period
    logs = []
    for seed in (3, 4):
        command = switched(t, seed)
        delivered = command.copy()
        for k in range(1, len(t)):
            step = 60.0 * (t[k] - t[k - 1])
            delivered[k, 0] = delivered[k - 1, 0] + np.clip(command[k, 0] - delivered[k - 1, 0], -step, step)
        moved = simulate(off(arm), t, delivered, noise=2e-5, seed=seed, name=f"run {seed}")
        logs.append(replace(moved, tau=command))
    base = EquationError([Rows.of(log, arm) for log in logs], arm)
    assert screen(base, logs, arm)[0].fit.share[0] > 0.5
    assert not any(c.severity in ("error", "repaired") for c in checked(logs, arm))
    exchanged = [replace(log, tau=-log.tau[::-1].copy()) for log in logs]
    assert any(c.check == "joint_order" for c in checked(exchanged, arm)), "torques of another run belong to no arm"


@pytest.mark.parametrize(
    ("defect", "name", "remedy"),
    [
        ({"flip": "tau2"}, "torque_sign", "--flip tau2"),
        ({"zero": "q2=90deg"}, "position_zero", "--zero q2=-90deg"),
        ({"swap": "q1,q2"}, "joint_order", "--swap q1,q2"),
    ],
)
def test_a_drive_that_saturates_hides_no_defect(arm: Arm, defect: dict[str, str], name: str, remedy: str) -> None:
    logs = carried(arm, Effect("torque_saturation", 2, {"level": 0.6}), scale=3.0)
    assert checked(logs, arm) == ()
    corrections = Corrections.parse(**defect)
    [check] = checked([corrections.on_log(log) for log in logs], arm)
    assert (check.check, check.severity) == (name, "error")
    assert remedy in check.remedies


def test_torques_that_come_late_before_a_drive_that_saturates(arm: Arm) -> None:
    logs = carried(arm, Effect("torque_saturation", 2, {"level": 0.6}), scale=3.0)
    late = [replace(log, tau=np.vstack([np.repeat(log.tau[:1], 3, axis=0), log.tau[:-3]])) for log in logs]
    [check] = checked(late, arm)
    assert (check.check, check.severity) == ("time_shift", "repaired")
    assert check.remedies == ("--shift tau=-0.0075",)


def test_levels_are_those_of_the_drives(arm: Arm) -> None:
    limited, free = (
        carried(arm, *hidden, scale=3.0) for hidden in ([Effect("torque_saturation", 2, {"level": 0.6})], [])
    )
    found = drive_limit.delivered(limited, arm)
    assert found.levels[0] == np.inf
    assert found.levels[1] == pytest.approx(0.6, rel=0.05)
    assert found.unexplained.max() < drive_limit.TRIED
    assert np.isinf(drive_limit.delivered(free, arm).levels).all()
    assert drive_limit.deliver(free, np.full(2, np.inf)) == free


def test_noise_above_a_limited_torque_is_no_sign_of_other_columns(arm: Arm) -> None:
    logs = carried(arm, Effect("torque_saturation", 2, {"level": 0.6}), scale=3.0)
    drawn = np.random.default_rng(1)
    noisy = [replace(log, q=log.q + drawn.normal(0.0, 4e-3, log.q.shape)) for log in logs]
    base = EquationError([Rows.of(log, arm) for log in noisy], arm)
    noise = base.noise_square(noisy)
    assert noise[1] > 0.3 * 0.6**2, "noise hides what the torque does"
    assert not any(c.severity == "error" for c in checked(noisy, arm))


def test_the_torque_that_noise_leaves_is_that_of_the_noise(arm: Arm) -> None:
    [log, _] = carried(arm, scale=3.0)
    drawn = np.random.default_rng(2).normal(0.0, 1e-3, log.q.shape)
    noisy = replace(log, q=log.q + drawn)
    rows = [Rows.of(x, arm) for x in (log, noisy)]
    left = np.mean(((rows[1].psi - rows[0].psi) @ arm.theta) ** 2, axis=0)
    found = EquationError(rows[1:], arm).noise_square([noisy])
    np.testing.assert_allclose(found, left, rtol=0.3)


def test_dead_stretches_of_both_joints_beside_a_drive_that_saturates(arm: Arm) -> None:
    logs = carried(arm, Effect("torque_saturation", 2, {"level": 0.6}), scale=3.0)
    dead = []
    for log in logs:
        tau = log.tau.copy()
        tau[800:1500] = 0.0
        dead.append(replace(log, tau=tau))
    assert [(c.check, c.severity) for c in dead_stretch.find(dead, arm)] == [("dead_stretch", "error")] * 2
    assert len(dead_stretch.without_constant(dead[0])) == len(dead[0]) - 700


def test_no_drive_has_a_level_of_zero(arm: Arm) -> None:
    [log, _] = carried(arm)
    seldom = replace(log, tau=np.where(np.arange(len(log))[:, None] % 10 < 3, log.tau, 0.0))
    assert np.all(drive_limit.delivered([seldom], arm).levels > 0)
    assert np.isinf(drive_limit.delivered([replace(log, tau=np.zeros_like(log.tau))], arm).levels).all()


def test_levels_are_tried_downwards_until_one_explains_less_than_no_limit() -> None:
    log = Log.from_frame(
        {"t": np.arange(100) * 0.01, "q": np.sin(np.arange(100) * 0.1), "tau": np.linspace(-10.0, 10.0, 100)}
    )
    tried: list[float] = []

    def found(share: Callable[[float], float]) -> float:
        tried.clear()
        return drive_limit.at_best_level(lambda x: tried.append(x) or x, [log], 0, share, 0.5)

    assert found(lambda level: 0.5 + 0.01 * (10.0 - level)) == max(tried)
    assert len(tried) == 1
    assert found(lambda level: 0.01 + abs(level - 2.3) / 20.0) == pytest.approx(2.3, abs=0.05)
    assert len(tried) > 10
    # A level that is far from acceptable is not refined.
    found(lambda level: 0.45 + abs(level - 2.3) / 200.0)
    assert len(tried) == 11
