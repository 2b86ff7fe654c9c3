"""Checks of the input of serial arms: torques that were not recorded, joints without a drive, an arm file without gravity."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armgap import Arm, Log, diagnose, simulate
from armgap.arm.corrections import Corrections
from armgap.check.serial.contradictions import contradictions
from armgap.check.serial.dead_stretch import find
from armgap.errors import OptionError
from armgap.simulation import Effect
from test_serial_diagnosis import PERIOD, THREE, torques

SECONDS = 8.0


@pytest.fixture(scope="module")
def arm_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("serial") / "arm.toml"
    path.write_text(THREE)
    return path


@pytest.fixture(scope="module")
def arm(arm_path: Path) -> Arm:
    return Arm.read(arm_path)


def logs(arm: Arm, *effects: Effect, driven: tuple[int, ...] = (0, 1, 2)) -> list[Log]:
    """Logs of an arm whose joints `driven`, from 0, have a drive."""
    found = []
    for number in range(3):
        t, tau = torques(number, SECONDS)
        tau[:, [j for j in range(3) if j not in driven]] = 0.0
        found.append(
            simulate(arm, t, tau, effects=effects, noise=2e-6, seed=number, tolerance=1e-8, name=f"log-{number}")
        )
    return found


@pytest.fixture(scope="module")
def quiet(arm: Arm) -> list[Log]:
    return logs(arm)


def without_torque(log: Log, joint: int, first: int = 0, last: int | None = None) -> Log:
    """The log with a torque column that holds zeros from row `first` to row `last`."""
    tau = log.tau.copy()
    tau[first:last, joint] = 0.0
    return replace(log, tau=tau)


def test_a_stretch_without_torque_is_left_out_by_the_remedy(quiet: list[Log], arm: Arm) -> None:
    rows = round(1.2 / PERIOD)
    corrections, [check] = find([without_torque(quiet[0], 1, 0, rows), *quiet[1:]], arm)
    assert (check.check, check.severity, check.joint, check.log) == ("dead_stretch", "error", 2, "log-0")
    [span] = corrections.skip
    assert check.remedies == (f"--skip {span}",)
    left = corrections.on_log(without_torque(quiet[0], 1, 0, rows))
    assert len(left) == len(quiet[0]) - rows
    assert find([left, *quiet[1:]], arm)[1] == []


def test_every_stretch_of_a_log_is_judged(quiet: list[Log], arm: Arm) -> None:
    rows = round(0.8 / PERIOD)
    twice = without_torque(without_torque(quiet[0], 1, 0, rows), 1, -rows - 100, -100)
    corrections, checks = find([twice, *quiet[1:]], arm)
    assert (len(checks), len(corrections.skip)) == (2, 2)


def test_a_torque_that_friction_holds_at_rest_was_recorded(quiet: list[Log], arm: Arm) -> None:
    assert arm.chain is not None
    rows = round(1.2 / PERIOD)
    t, tau = torques(0, SECONDS)
    tau[:rows] = [0.5 * arm.theta[12 * arm.n_joints], 0.0, 0.0]
    held = simulate(arm, t, tau, noise=2e-6, tolerance=1e-8, name="held")
    assert np.ptp(held.q[:rows, 0]) < 1e-3
    assert find([held, *quiet[1:]], arm)[1] == []
    tau[:rows, 0] *= 8.0
    assert [check.joint for check in find([replace(held, tau=tau), *quiet[1:]], arm)[1]] == [1]


@pytest.mark.slow
@pytest.mark.parametrize("joint", [1, 2])
def test_a_torque_that_no_log_holds_is_no_cause(joint: int, quiet: list[Log], arm: Arm) -> None:
    given = [without_torque(log, joint) for log in quiet]
    result = diagnose(given[:2], arm, holdout=given[2:])
    assert (result.verdict, result.causes) == ("input", ())
    [check] = [c for c in result.checks if c.severity == "error"]
    assert (check.check, check.joint) == ("dead_stretch", joint + 1)
    assert check.remedies == (f"--columns tau{joint + 1}=NAME",)
    assert all(np.isfinite(place.share) for place in result.where)


def test_a_torque_that_one_log_lacks(quiet: list[Log], arm: Arm) -> None:
    _, [check] = find([*quiet[:2], without_torque(quiet[2], 2)], arm)
    assert (check.check, check.joint, check.log) == ("dead_stretch", 3, "log-2")


@pytest.mark.parametrize("effects", [(), (Effect("stribeck", 3, {"amplitude": 0.5, "velocity": 0.15}),)])
def test_a_joint_without_a_drive_is_no_defect(effects: tuple[Effect, ...], arm: Arm) -> None:
    assert find(logs(arm, *effects, driven=(0, 1)), arm)[1] == []


def test_an_arm_file_without_gravity(quiet: list[Log], arm_path: Path) -> None:
    path = arm_path.with_name("weightless.toml")
    path.write_text(THREE.replace("gravity = [0.0, 0.0, -9.81]", "gravity = 0"))
    corrections, [check] = contradictions(quiet, Arm.read(path))
    assert (check.check, check.severity) == ("gravity_missing", "error")
    assert check.remedies == ("--gravity standard", "gravity = [0.0, 0.0, -9.81]")
    assert corrections.on_arm(Arm.read(path)).chain.gravity.tolist() == [0.0, 0.0, -9.81]


def test_an_angle_that_counts_from_the_world(quiet: list[Log], arm: Arm) -> None:
    assert arm.chain is not None
    assert arm.chain.parallel_joints == (3,)  # shoulder and elbow; the base turns about the vertical
    wrong = Corrections(relative=("q3",))
    corrections, [check] = contradictions([wrong.on_log(log) for log in quiet], arm)
    assert (check.check, check.severity, check.joint) == ("relative_angle", "error", 3)
    assert check.remedies == ("--absolute q3",)
    for log in quiet:
        np.testing.assert_allclose(corrections.on_log(wrong.on_log(log)).q, log.q, atol=1e-12)


def test_angles_from_the_world_become_relative_link_by_link(quiet: list[Log]) -> None:
    columns = ("q2", "q3")
    world = Corrections(relative=columns).on_log(quiet[0])
    np.testing.assert_allclose(world.q, np.cumsum(quiet[0].q, axis=1))
    for order in (columns, columns[::-1]):
        np.testing.assert_allclose(Corrections(absolute=order).on_log(world).q, quiet[0].q, atol=1e-12)


def test_standard_gravity_needs_masses() -> None:
    pendulum = Arm("bench", "pendulum", 9.81, 0.004, np.array([0.1, 1.0, 0.1, 0.1]), sigma=np.full(4, 0.1))
    with pytest.raises(OptionError, match="pendulum"):
        Corrections(gravity="standard").on_arm(pendulum)


def test_logs_without_any_torque(quiet: list[Log], arm: Arm) -> None:
    silent = [replace(log, tau=0.0 * log.tau) for log in quiet]
    _, checks = find(silent, arm)
    assert {check.joint for check in checks} == {1, 2, 3}


def test_an_arm_that_swings_freely_is_no_defect(arm: Arm) -> None:
    assert find(logs(arm, driven=()), arm)[1] == []


@pytest.mark.slow
def test_units_are_found_where_most_torques_are_too_small(quiet: list[Log], arm: Arm) -> None:
    scale = np.array([1 / 160, 1 / 7, -1 / 6])
    corrections, checks = contradictions([replace(log, tau=log.tau * scale) for log in quiet], arm)
    assert [(check.check, check.joint) for check in checks] == [("torque_unit", j) for j in (1, 2, 3)]
    found = [corrections.factor[f"tau{j}"] for j in (1, 2, 3)]
    # Masses are trusted to some ten percent, and a factor is known no better.
    assert found == pytest.approx(1 / scale, rel=0.3)
