"""Logs of position-commanded arms: references are read in place of torques, kept, checked, and diagnosed with the controller in the model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from armgap import Arm, Log, diagnose, identify
from armgap.arm.controller import Controller
from armgap.check import Corrections, data_checks
from armgap.check.serial.contradictions import contradictions
from armgap.diagnosis.prepared_input import split
from armgap.errors import ArmFileError, ColumnError, UnitError
from armgap.log.stretches import choose

#: Two links in a vertical plane behind a PD controller.
ARM = """\
name = "two joints"
kind = "serial"
gravity = [0.0, -9.81, 0.0]
sample_period = 0.01
trust = "published"

[[link]]
joint = "shoulder"
mass = 2.0
com = [0.0, -0.2, 0.0]
inertia = {ixx = 0.03, iyy = 0.01, izz = 0.03}

[[link]]
joint = "elbow"
placement = {xyz = [0.0, -0.4, 0.0], rpy = [0.0, 0.0, 0.0]}
mass = 1.0
com = [0.0, -0.15, 0.0]
inertia = {ixx = 0.01, iyy = 0.004, izz = 0.01}
"""
CONTROLLER = '\n[controller]\nkind = "pd"\nkp = [60.0, 30.0]\nkd = [2.0, 1.0]\n'
COUNT, PERIOD = 1200, 0.01
#: Share to which delays of all references at once come out: friction of `kp` times the delay imitates each, up to the change of the torque meanwhile.
DELAY = 0.2


def arm_of(folder: Path, text: str = ARM + CONTROLLER) -> Arm:
    path = folder / "arm.toml"
    path.write_text(text)
    return Arm.read(path)


@pytest.fixture
def arm(tmp_path: Path) -> Arm:
    return arm_of(tmp_path)


@pytest.fixture
def frame() -> pl.DataFrame:
    t = PERIOD * np.arange(COUNT)
    wave = {f"q{j}": 0.5 * np.sin((1.0 + j) * t) for j in (1, 2)}
    return pl.DataFrame({"t": t, **wave, **{f"q_ref{j}": wave[f"q{j}"] + 0.02 * np.cos(3.0 * t) for j in (1, 2)}})


# Reading


def test_references_stand_in_place_of_torques(frame: pl.DataFrame, arm: Arm, tmp_path: Path) -> None:
    frame.write_csv(tmp_path / "run.csv")
    for log in (Log.read(tmp_path / "run.csv", arm=arm), Log.from_frame(frame)):
        assert not log.has_torques
        assert log.tau.shape == (COUNT, 0)
        assert log.q_ref is not None
        np.testing.assert_allclose(log.q_ref[:, 1], frame["q_ref2"])
        assert log.dq_ref is None
        assert log.columns["q_ref2"] == "q_ref2"
        assert log.units["q_ref2"].startswith("rad")


def test_references_are_written_and_read_again(frame: pl.DataFrame, arm: Arm, tmp_path: Path) -> None:
    more = frame.with_columns(pl.col("q_ref1").alias("dq_ref1"), pl.col("q_ref2").alias("dq_ref2"))
    log = Log.from_frame(more, arm=arm)
    log.write(tmp_path / "again.parquet")
    again = Log.read(tmp_path / "again.parquet", arm=arm)
    for name in ("q_ref", "dq_ref"):
        np.testing.assert_array_equal(getattr(again, name), getattr(log, name))


def test_columns_by_the_joints_names(frame: pl.DataFrame, arm: Arm) -> None:
    joints = {1: "shoulder", 2: "elbow"}
    named = {"t": "t"} | {f"q{j}": f"{name}/position" for j, name in joints.items()}
    named |= {f"q_ref{j}": f"{name}/reference" for j, name in joints.items()}
    columns = ["t", "q2", "q1", "q_ref2", "q_ref1"]
    log = Log.from_frame(frame.select(columns).rename(named), arm=arm)
    np.testing.assert_array_equal(log.q_ref, Log.from_frame(frame).q_ref)
    mapped = Log.from_frame(frame.rename({"q_ref1": "goal"}), columns={"q_ref1": "goal"}, arm=arm)
    np.testing.assert_array_equal(mapped.q_ref, log.q_ref)


def test_torques_come_first(frame: pl.DataFrame, arm: Arm) -> None:
    both = frame.with_columns(pl.col("q1").alias("tau1"), pl.col("q2").alias("tau2"))
    log = Log.from_frame(both, arm=arm)
    assert log.has_torques
    assert log.q_ref is None


def test_references_have_the_unit_of_the_positions(frame: pl.DataFrame, arm: Arm) -> None:
    degrees = frame.with_columns(np.degrees(pl.col("q1", "q2", "q_ref1", "q_ref2")))
    log = Log.from_frame(degrees, arm=arm, units={"q": "deg"})
    np.testing.assert_allclose(log.q_ref, Log.from_frame(frame).q_ref, atol=1e-12)
    assert log.units["q_ref1"] == "deg"
    mixed = frame.with_columns(np.degrees(pl.col("q_ref1")))
    with pytest.raises(UnitError, match=r"column `q_ref1`.*57.*times farther than `q1`") as caught:
        Log.from_frame(mixed, arm=arm)
    assert "\n" not in str(caught.value)


# What is missing


def errors(problem: Callable[[], object], *said: str) -> None:
    with pytest.raises((ColumnError, ArmFileError)) as caught:
        problem()
    text = str(caught.value)
    assert "\n" not in text
    for word in said:
        assert word in text


def test_neither_torques_nor_references(frame: pl.DataFrame, arm: Arm) -> None:
    bare = frame.select("t", "q1", "q2")
    errors(lambda: Log.from_frame(bare, arm=arm), "tau1", "--columns tau1=NAME", "q_ref1", "[controller]")


def test_references_without_a_controller(frame: pl.DataFrame, tmp_path: Path) -> None:
    arm = arm_of(tmp_path, ARM)
    said = ("tau1", "arm.toml", "no [controller]", "kp and kd")
    errors(lambda: Log.from_frame(frame, arm=arm), *said)
    errors(lambda: diagnose(Log.from_frame(frame), arm), *said)


def test_a_controller_without_gains(tmp_path: Path) -> None:
    errors(lambda: arm_of(tmp_path, ARM + '\n[controller]\nkind = "pd"\nkp = [1.0, 1.0]\n'), "controller.kd")


def test_a_reference_of_one_joint_only(frame: pl.DataFrame, arm: Arm) -> None:
    errors(lambda: Log.from_frame(frame.drop("q_ref2"), arm=arm), "q_ref2", "missing")


def test_what_needs_torques_says_so(frame: pl.DataFrame, pendulum: Arm) -> None:
    log = Log.from_frame(frame.select("t", "q1", "q_ref1"))
    errors(lambda: identify(log, pendulum), "tau1", "identification needs torques")
    errors(lambda: diagnose(log, pendulum), "tau1", "pendulum")


# Kept through what happens to a log


def test_parts_stretches_and_repairs_keep_references(frame: pl.DataFrame, arm: Arm) -> None:
    log = Log.from_frame(frame, arm=arm)
    assert log.q_ref is not None
    [training], [held] = split([log])
    np.testing.assert_array_equal(np.vstack([training.q_ref, held.q_ref]), log.q_ref)
    pieces = choose([log], budget=600)
    assert sum(map(len, pieces)) <= 600
    for piece in pieces:
        np.testing.assert_array_equal(piece.q_ref, log.q_ref[piece.first_row : piece.first_row + len(piece)])
    wild = log.q.copy()
    wild[500, 0] += 3.0
    repaired, checks = data_checks(replace(log, q=wild), arm, repair=True)
    assert "spike" in {check.check for check in checks}
    assert len(repaired) == COUNT - 1
    # The row before has the mean of both references, as it is held over both.
    np.testing.assert_allclose(repaired.q_ref[499], log.q_ref[499:501].mean(axis=0))
    np.testing.assert_array_equal(repaired.q_ref[500:], log.q_ref[501:])


def test_references_are_corrected_with_the_positions(frame: pl.DataFrame, arm: Arm) -> None:
    log = Log.from_frame(frame, arm=arm)
    read = Corrections.parse(flip=["q1"], zero=["q2=90deg"]).on_log(log)
    np.testing.assert_array_equal(read.q_ref[:, 0], -log.q_ref[:, 0])
    np.testing.assert_allclose(read.q_ref[:, 1] - log.q_ref[:, 1], np.pi / 2)
    swapped = Corrections.parse(swap=["q1,q2", "tau1,tau2"]).on_log(log)
    np.testing.assert_array_equal(swapped.q_ref[:, ::-1], log.q_ref)


# The controller


def test_deviations_of_the_gains(arm: Arm, tmp_path: Path) -> None:
    assert arm.controller is not None
    assert {name: values.tolist() for name, values in arm.controller.sigmas.items()} == {
        "sigma_kp": [0.0, 0.0], "sigma_kd": [0.0, 0.0], "sigma_ki": [0.0, 0.0],
    }  # fmt: skip
    trusted = arm_of(tmp_path, ARM + CONTROLLER + "sigma_kp = [6.0, 6.0]\n").controller
    assert trusted is not None
    np.testing.assert_allclose(trusted.sigmas["sigma_kd"], [0.2, 0.2])


@pytest.mark.parametrize("kd_on", ["measurement", "error"])
def test_the_mean_torque_of_a_controller(kd_on) -> None:
    """Over each interval the position is a parabola here, so that a servo of many steps has the same mean."""
    t = PERIOD * np.arange(50)
    q, q_ref = 0.3 * t[:, None] ** 2, 0.2 * t[:, None]
    controller = Controller(np.array([50.0]), np.array([2.0]), kd_on)
    fine = np.linspace(0.0, PERIOD, 2001)[:-1] + PERIOD / 4000
    rate = 0.2 if kd_on == "error" else 0.0
    for k in range(1, 48):
        now = t[k] + fine
        wanted = np.mean(50.0 * (q_ref[k] - 0.3 * now**2) + 2.0 * (rate - 0.6 * now))
        # The trapezoid's error of a parabola.
        miss = 50.0 * 0.3 * PERIOD**2 / 6
        assert abs(controller.torque(t, q, q_ref)[k, 0] - wanted) < 1.01 * miss
    assert controller.torque(t, q, q_ref, limit=np.array([0.1])).max() == 0.1


# Against an independent physics engine


def case(effect: str | None = None, **options):
    pytest.importorskip("mujoco")
    from serial_trial.case import NULLS, make_case

    return make_case(11, 0 if effect else NULLS, effect, commanded=True, **options)


@pytest.fixture(scope="module")
def null():
    return case(family="SO-101-like", duration=6.0)


def test_a_right_arm_has_no_cause_and_is_predicted_in_closed_loop(null) -> None:
    result = diagnose(null.training, null.arm, holdout=null.holdout)
    assert not result.causes
    gap = result.gap
    assert all(refit < 0.5 * before for before, refit in zip(gap.before, gap.refit, strict=True))
    # The controller holds the arm: a run of the whole log stays as near as a window does.
    assert all(free < 3.0 * window for free, window in zip(gap.free_run_after, gap.after, strict=True))


def test_gains_that_are_not_trusted_are_estimated(null) -> None:
    controller = null.arm.controller
    wrong = replace(controller, kp=1.15 * controller.kp, sigma_kp=0.2 * controller.kp)
    trusted = replace(null.arm, controller=wrong, sigma=0.1 * null.arm.sigma)
    result = diagnose(null.training, trusted, holdout=null.holdout, max_causes=0)
    [note] = [note for note in result.extra["notes"] if note.startswith("gains of the controller")]
    found = float(note.partition("kp2 ")[2].split()[0])
    assert found == pytest.approx(controller.kp[1], rel=0.05)


def test_a_late_reference_is_named(null) -> None:
    rows = 6

    def late(log: Log) -> Log:
        """The servo follows what the log says six rows before it is logged."""
        assert log.q_ref is not None
        early = np.vstack([log.q_ref[rows:], np.repeat(log.q_ref[-1:], rows, axis=0)])
        return replace(log, q_ref=early)

    result = diagnose([late(log) for log in null.training], null.arm, holdout=[late(log) for log in null.holdout])
    assert {cause.effect for cause in result.causes} == {"reference_delay"}
    joint_by_joint = [single for cause in result.causes for single in cause.by_joint()]
    for cause in joint_by_joint:
        assert cause.parameters["delay"].value == pytest.approx(rows * null.arm.sample_period, rel=DELAY)
    assert sorted(cause.joint for cause in joint_by_joint) == list(range(1, null.arm.n_joints + 1))


def test_an_order_that_contradicts_the_arm_file(null) -> None:
    assert not contradictions([*null.training, *null.holdout], null.arm)[1]
    order = [1, 0, *range(2, null.arm.n_joints)]
    swapped = [replace(log, q=log.q[:, order], q_ref=log.q_ref[:, order]) for log in null.training]
    _, [error] = contradictions(swapped, null.arm)
    assert (error.check, error.severity) == ("joint_order", "error")
    assert "--swap q1,q2" in error.remedies[0]
