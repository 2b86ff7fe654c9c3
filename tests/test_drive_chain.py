"""Measured torques and second encoders: read, corrected, and what they say of the chain from command to position; logs by equations of this file."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray

from armgap import Arm, Diagnosis, Log, diagnose
from armgap.check import Corrections
from armgap.diagnosis import diagnosis_schema
from armgap.diagnosis.drive import Drive
from armgap.diagnosis.drive_chain import LEAST_SHARE, ChainEntry, drive_chain
from armgap.diagnosis.encoders import error_of_encoder
from armgap.errors import ColumnError
from armgap.report.output import diagnosis_report

Array = NDArray[np.float64]
Torque = Callable[[Array, Array], Array]

# theta1 to theta5, viscous and Coulomb friction of the two joints
THETA = np.array([0.12, 0.03, 0.05, 2.2, 1.5, 0.05, 0.03, 0.1, 0.06])
ARM = Arm("own", "two-link", 9.81, 0.004, THETA, sigma=np.repeat([0.1, 0.5], [5, 4]) * THETA)
STEP = 0.001  # of the integration [s]
NOISE = 1e-4  # of positions [rad]
DELAY, GAIN, INERTIA = 0.011, 0.96, 0.008  # of the drive of joint 2


def nothing(q: Array, dq: Array) -> Array:
    return np.zeros(2)


def spring(q: Array, dq: Array) -> Array:
    """A hardening spring on joint 2, which no drive knows of."""
    return np.array([0.0, -0.3 * q[1] ** 3])


def acceleration(q: Array, dq: Array, tau: Array, rotor: float) -> Array:
    """The two-link arm, joint 2 relative to link 1, with an inertia on joint 2 alone."""
    th = THETA
    m11, m12 = th[0] + 2 * th[1] * np.cos(q[1]), th[2] + th[1] * np.cos(q[1])
    m22 = th[2] + rotor
    h = th[1] * np.sin(q[1])
    tip = th[4] * np.sin(q[0] + q[1])
    r1 = (
        tau[0]
        + h * (2 * dq[0] * dq[1] + dq[1] ** 2)
        - th[3] * np.sin(q[0])
        - tip
        - th[5] * dq[0]
        - th[7] * np.tanh(dq[0] / 0.02)
    )
    r2 = tau[1] - h * dq[0] ** 2 - tip - th[6] * dq[1] - th[8] * np.tanh(dq[1] / 0.02)
    det = m11 * m22 - m12 * m12
    return np.array([m22 * r1 - m12 * r2, m11 * r2 - m12 * r1]) / det


@functools.cache
def run(seed: int, *, drive: bool, extra: Torque = nothing, seconds: float = 5.0) -> Log:
    """A log under held sines; `drive` gives joint 2 a late and weak drive that carries an inertia, `extra` a torque behind the drives."""
    rng = np.random.default_rng(seed)
    period, inner = ARM.sample_period, round(ARM.sample_period / STEP)
    n = round(seconds / period)
    t = np.arange(n) * period
    size, rate, phase = rng.uniform(0.2, 0.7, (5, 2)), rng.uniform(1.0, 16.0, (5, 2)), rng.uniform(0, 6, (5, 2))
    tau = np.sum(size * np.sin(t[:, None, None] * rate + phase), axis=1)
    late = round(DELAY / STEP) if drive else 0
    fine = np.repeat(tau, inner, axis=0)
    given = fine.copy()
    if drive:
        given[:, 1] = GAIN * np.concatenate([np.repeat(tau[:1, 1], late), fine[: len(fine) - late, 1]])
    rotor = INERTIA if drive else 0.0
    state = np.zeros(4)
    q, measured = np.empty((n, 2)), np.empty((n, 2))

    def rate_of(x: Array, u: Array) -> Array:
        return np.concatenate([x[2:], acceleration(x[:2], x[2:], u + extra(x[:2], x[2:]), rotor)])

    for k in range(n * inner):
        u = given[k]
        k1 = rate_of(state, u)
        if k % inner == 0:
            q[k // inner], measured[k // inner] = state[:2], u - np.array([0.0, rotor * k1[3]])
        k2 = rate_of(state + 0.5 * STEP * k1, u)
        k3 = rate_of(state + 0.5 * STEP * k2, u)
        state = state + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + rate_of(state + STEP * k3, u))
    noisy = rng.normal(size=(2, n, 2))
    return Log.from_arrays(t, q + NOISE * noisy[0], tau, tau_meas=measured + 0.005 * noisy[1], name=f"run {seed}")


def logs(*, drive: bool, extra: Torque = nothing) -> tuple[list[Log], list[Log]]:
    return [run(s, drive=drive, extra=extra) for s in (1, 2)], [run(3, drive=drive, extra=extra)]


def chain(training: list[Log], holdout: list[Log]) -> list[ChainEntry]:
    return drive_chain(ARM, training, holdout, horizon=0.2, floor=[5e-4, 1e-3])


def by_place(entries: list[ChainEntry]) -> dict[tuple[str, int], ChainEntry]:
    return {(e["stage"], e["joint"]): e for e in entries}


def test_the_drive_is_found_with_its_figures() -> None:
    training, holdout = logs(drive=True)
    drive = Drive.identify(training, 1)
    assert drive is not None
    delay, gain, offset, viscous, inertia = drive.values
    # Samples do not tell when between them a torque changes.
    assert delay == pytest.approx(DELAY, abs=0.5 * ARM.sample_period)
    assert delay == pytest.approx(DELAY, abs=3 * drive.sigma[0])
    assert (gain, offset, viscous) == pytest.approx((GAIN, 0.0, 0.0), abs=2e-3)
    assert inertia == pytest.approx(INERTIA, rel=0.02)
    apart, left = drive.left(holdout)
    assert left < 0.02 * apart


def test_delays_are_told_to_parts_of_a_sample() -> None:
    """A measured torque that is smooth between its samples shows the delay itself."""
    t = np.arange(0, 6, 0.004)
    q = 0.3 * np.sin(5 * t)

    def command(at: Array) -> Array:
        return np.sin(9 * at) + 0.5 * np.sin(17 * at + 1)

    for delay in (0.0005, 0.0062, 0.0147):
        held_late = 0.5 * 0.004  # a held command is half a period late
        log = Log.from_arrays(t, q, command(t), tau_meas=0.9 * command(t - delay - held_late) + 0.1)
        drive = Drive.identify([log], 0)
        assert drive is not None
        assert drive.values[0] == pytest.approx(delay, abs=2e-5)
        assert drive.values[1:3] == pytest.approx((0.9, 0.1), abs=1e-3)


def test_the_drive_leads_where_the_drive_is_late() -> None:
    entries = chain(*logs(drive=True))
    assert (entries[0]["stage"], entries[0]["joint"]) == ("drive", 2)
    assert entries[0]["share"] > 0.9
    first = by_place(entries)["drive", 1]
    assert first["share"] == 0.0
    assert "within the period of a sample" in first["detail"]


@pytest.mark.slow
def test_mechanics_lead_where_the_torque_acts_behind_the_drives() -> None:
    entries = chain(*logs(drive=False, extra=spring))
    assert (entries[0]["stage"], entries[0]["joint"]) == ("mechanics", 2)
    assert all(e["share"] < LEAST_SHARE for e in entries if e["stage"] == "drive")


@pytest.mark.slow
def test_shares_are_parts_of_one_whole() -> None:
    for kind in ({"drive": True}, {"drive": False, "extra": spring}, {"drive": False}):
        entries = chain(*logs(**kind))  # type: ignore[arg-type]
        assert all(0.0 <= e["share"] <= 1.0 for e in entries)
        assert 1.0 - 4 * LEAST_SHARE < sum(e["share"] for e in entries) <= 1.0 + 1e-9
        assert [e["share"] for e in entries] == sorted((e["share"] for e in entries), reverse=True)


def test_an_ideal_arm_leaves_noise() -> None:
    entries = chain(*logs(drive=False))
    assert {e["stage"] for e in entries if e["share"] > 0} == {"sensor"}


def test_a_soft_transmission_shows_in_the_second_encoder() -> None:
    """A light motor behind a spring: the link goes by the torque, the motor's encoder by the spring as well."""
    arm = Arm(
        "own", "pendulum", 9.81, 0.004, np.array([0.05, 0.6, 0.02, 0.0]), sigma=np.array([0.005, 0.06, 0.02, 0.001])
    )

    def swing(seed: int) -> Log:
        rng = np.random.default_rng(seed)
        t = np.arange(1500) * 0.004
        size, rate, phase = rng.uniform(0.1, 0.4, 5), rng.uniform(0.5, 9.0, 5), rng.uniform(0, 6, 5)
        tau = np.sum(size * np.sin(t[:, None] * rate + phase), axis=1)
        state, q = np.zeros(2), np.empty(1500)

        def rate_of(x: Array, u: float) -> Array:
            return np.array([x[1], (u - 0.6 * np.sin(x[0]) - 0.02 * x[1]) / 0.05])

        for k, u in enumerate(tau):
            q[k] = state[0]
            for _ in range(4):
                k1 = rate_of(state, u)
                k2 = rate_of(state + 5e-4 * k1, u)
                k3 = rate_of(state + 5e-4 * k2, u)
                state = state + 1e-3 / 6 * (k1 + 2 * k2 + 2 * k3 + rate_of(state + 1e-3 * k3, u))
        motor = q + (tau - np.mean(tau)) / 12.0  # of a spring of 12 N m/rad
        return Log.from_arrays(
            t,
            motor + NOISE * rng.normal(size=1500),
            tau,
            q_link=q + 0.7 + NOISE * rng.normal(size=1500),
            name=f"{seed}",
        )

    entries = drive_chain(arm, [swing(1), swing(2)], [swing(3)], horizon=0.25, floor=[5e-4])
    assert (entries[0]["stage"], entries[0]["joint"]) == ("transmission", 1)
    assert entries[0]["share"] > 0.5
    assert "parameters" not in entries[0]


@pytest.mark.parametrize(
    ("kind", "words"),
    [("late", "first encoder is 6 ms behind the second"), ("off centre", "8 mrad times a sine"), ("soft", None)],
)
def test_an_encoder_in_error_is_told_from_a_transmission(kind: str, words: str | None) -> None:
    rng = np.random.default_rng(4)
    t = np.arange(2500) * 0.004
    size, rate, phase = rng.uniform(0.1, 0.4, 5), rng.uniform(0.5, 9.0, 5), rng.uniform(0, 6, 5)

    def angle(t: Array) -> Array:
        return np.sum(size * np.sin(t[:, None] * rate + phase), axis=1)

    link = angle(t)
    speed = np.gradient(link, t)
    tau = 0.05 * np.gradient(speed, t) + 0.6 * np.sin(link) + 0.02 * speed + 0.1 * np.tanh(speed / 0.02)
    first = {"late": angle(t - 0.006), "off centre": link + 0.008 * np.sin(link + 0.4), "soft": link + tau / 12.0}[kind]
    noisy = [x + NOISE * rng.normal(size=len(t)) for x in (first, link)]
    log = Log.from_arrays(t, noisy[0], tau, q_link=noisy[1], name=kind)
    said = error_of_encoder([log], 0)
    assert said is None if words is None else said is not None and words in said
    assert error_of_encoder([log.part(0, 40, kind)], 0) is None, "too short to tell"


def test_drives_that_are_late_alike_are_found_together() -> None:
    """A delay of one drive is none beside the other drive's command: only both measured torques together make predictions better."""

    def late(log: Log) -> Log:
        early = np.concatenate([log.tau[3:], np.repeat(log.tau[-1:], 3, axis=0)])
        return replace(log, tau=early, tau_meas=log.tau)

    training, holdout = logs(drive=False)
    entries = chain([late(log) for log in training], [late(log) for log in holdout])
    shares = {(e["stage"], e["joint"]): e["share"] for e in entries}
    assert shares["drive", 1] + shares["drive", 2] > 0.8


def test_a_serial_arm_is_judged_by_its_torques(tmp_path: Path) -> None:
    """One link that stands up: torques that its motion needs are measured, those that were commanded lack a part."""
    path = tmp_path / "arm.toml"
    path.write_text(
        'kind = "serial"\nsample_period = 0.004\n[[link]]\njoint = "one"\naxis = [0, 1, 0]\nmass = 2.0\ncom = [0, 0, 0.2]\n'
        "inertia = {ixx = 0.03, iyy = 0.03, izz = 0.01}\n"
    )
    arm = Arm.read(path)

    def needed(seed: int) -> Log:
        rng = np.random.default_rng(seed)
        t = np.arange(2000) * 0.004
        size, rate, phase = rng.uniform(0.1, 0.3, 4), rng.uniform(1.0, 6.0, 4), rng.uniform(0, 6, 4)
        angle = t[:, None] * rate + phase
        q, dq, ddq = (
            np.sum(part, axis=1)
            for part in (size * np.sin(angle), size * rate * np.cos(angle), -size * rate**2 * np.sin(angle))
        )
        tau = (0.03 + 2.0 * 0.2**2) * ddq - 2.0 * 9.81 * 0.2 * np.sin(q) + 0.1 * dq + 0.2 * np.tanh(dq / 0.01)
        lacking = 1.5 * np.sin(9.0 * q)
        return Log.from_arrays(
            t, q + 1e-5 * rng.normal(size=2000), tau - lacking, tau_meas=tau, arm=arm, name=f"{seed}"
        )

    entries = drive_chain(arm, [needed(1)], [needed(2)], horizon=0.25, floor=[1e-3])
    assert (entries[0]["stage"], entries[0]["joint"]) == ("drive", 1)
    assert entries[0]["share"] > 0.9


def test_without_further_columns_there_is_no_chain() -> None:
    log = run(1, drive=False)
    bare = replace(log, tau_meas=None)
    assert chain([bare], [bare]) == []
    copied = replace(log, tau_meas=log.tau)
    assert chain([copied], [copied]) == []


def test_a_command_that_rests_shows_no_drive() -> None:
    log = run(1, drive=False)
    still = replace(log, tau=np.zeros_like(log.tau))
    assert Drive.identify([still], 0) is None


@functools.cache
def diagnosed() -> Diagnosis:
    training, holdout = logs(drive=True)
    return diagnose(training, ARM, holdout=holdout, horizon=0.2, max_causes=1)


@pytest.mark.slow
def test_a_diagnosis_has_the_chain_and_reads_it_back() -> None:
    result = diagnosed()
    part = result.chain[0]
    assert (part.stage, part.joint) == ("drive", 2)
    assert part.parameters["delay"].unit == "s"
    assert part.parameters["inertia"].unit == "kg m^2"
    assert Diagnosis.from_dict(json.loads(result.to_json())) == result
    assert "chain" in diagnosis_schema()["properties"]


@pytest.mark.slow
def test_the_report_has_the_chain() -> None:
    result = diagnosed()
    text = diagnosis_report(result, "page.md")
    assert "Along the chain" in text
    assert "measured torque of joint 2" in text
    bare = Diagnosis.from_dict({k: v for k, v in result.to_dict().items() if k != "chain"})
    assert "Along the chain" not in diagnosis_report(bare, "page.md")


def table(**more: Array) -> pl.DataFrame:
    log = run(1, drive=False)
    assert log.tau_meas is not None
    data = {"t": log.t, "q1": log.q[:, 0], "q2": log.q[:, 1], "tau1": log.tau[:, 0], "tau2": log.tau[:, 1]}
    return pl.DataFrame(data | more)


COLUMN = np.linspace(0.0, 1.0, 1250)


def test_further_columns_are_read_and_written() -> None:
    log = Log.from_frame(table(tau_meas1=COLUMN, tau_meas2=-COLUMN, q_link1=COLUMN, q_link2=COLUMN))
    assert log.tau_meas is not None
    assert log.q_link is not None
    assert np.array_equal(log.tau_meas[:, 1], -COLUMN)
    assert log.units["tau_meas1"] == "Nm or N"
    again = Log.from_frame(log.to_polars())
    assert again.tau_meas is not None
    assert np.array_equal(again.tau_meas, log.tau_meas)
    part = log.part(10, 60, "part")
    assert part.tau_meas is not None
    assert np.array_equal(part.tau_meas, log.tau_meas[10:60])


def test_columns_are_mapped_on_the_call_and_in_the_arm_file(tmp_path: Path) -> None:
    frame = table(i1=COLUMN, i2=COLUMN)
    mapped = Log.from_frame(frame, columns={"tau_meas1": "i1", "tau_meas2": "i2"})
    assert mapped.columns["tau_meas2"] == "i2"
    path = tmp_path / "arm.toml"
    path.write_text(ARM.to_toml() + '\n[columns]\ntau_meas1 = "i1"\ntau_meas2 = "i2"\n')
    read = Log.from_frame(frame, arm=Arm.read(path))
    assert read.tau_meas is not None
    assert np.array_equal(read.tau_meas[:, 0], COLUMN)


def test_measured_torques_of_some_joints_are_not_used_and_said() -> None:
    log = Log.from_frame(table(tau_meas2=COLUMN))
    assert log.tau_meas is None
    assert any("`tau_meas2` not used: measured torques of other joints are missing" in f.message for f in log.findings)
    with pytest.raises(ColumnError, match="tau_meas1"):
        Log.from_frame(table(i2=COLUMN), columns={"tau_meas2": "i2"})


def test_a_measured_torque_can_stand_for_the_commanded_one() -> None:
    log = Log.from_frame(table(tau_meas1=COLUMN, tau_meas2=-COLUMN), columns={"tau1": "tau_meas1", "tau2": "tau_meas2"})
    assert np.array_equal(log.tau[:, 0], COLUMN)
    assert log.tau_meas is None
    assert not any("not used" in f.message for f in log.findings)


def test_units_of_measured_columns_are_converted() -> None:
    frame = table(
        **{"tau_meas1 [mNm]": COLUMN, "tau_meas2 [mNm]": COLUMN, "q_link1_deg": COLUMN, "q_link2_deg": COLUMN}
    )
    log = Log.from_frame(frame)
    assert log.tau_meas is not None
    assert log.q_link is not None
    assert log.tau_meas[-1, 0] == pytest.approx(1e-3)
    assert log.q_link[-1, 0] == pytest.approx(np.pi / 180)
    assert np.array_equal(log.tau, Log.from_frame(table()).tau)


def test_corrections_of_a_joint_take_what_is_measured_there_along() -> None:
    log = Log.from_frame(table(tau_meas1=COLUMN, tau_meas2=2 * COLUMN, q_link1=COLUMN, q_link2=2 * COLUMN))

    def after(**given: object) -> tuple[Array, Array, Array]:
        found = Corrections.parse(**given).on_log(log)
        assert found.tau_meas is not None
        assert found.q_link is not None
        return found.tau_meas, found.q_link, found.tau

    tau_meas, _, tau = after(flip=["tau1"])
    assert np.array_equal(tau_meas[:, 0], -COLUMN)
    assert np.array_equal(tau[:, 0], -log.tau[:, 0])
    tau_meas, _, tau = after(flip=["tau_meas1"])
    assert np.array_equal(tau_meas[:, 0], -COLUMN)
    assert np.array_equal(tau, log.tau)
    assert np.array_equal(after(swap=["tau1,tau2"])[0][:, 0], 2 * COLUMN)
    assert np.array_equal(after(flip=["q2"])[1][:, 1], -2 * COLUMN)
    assert np.allclose(after(zero=["q1=1rad"])[1][:, 0], COLUMN + 1)
    assert np.allclose(after(zero=["q_link1=1rad"])[1][:, 0], COLUMN + 1)
    assert np.allclose(after(relative=["q2"])[1][:, 1], 3 * COLUMN)
    # A measured torque has a unit of its own, and is measured beside the positions.
    tau_meas, _, tau = after(factor=["tau=2"])
    assert np.array_equal(tau_meas[:, 0], COLUMN)
    assert np.array_equal(tau, 2 * log.tau)
    assert np.array_equal(after(factor=["tau_meas=3"])[0][:, 1], 6 * COLUMN)
    tau_meas, _, tau = after(shift=["tau=0.008"])
    assert np.array_equal(tau_meas[:, 0], COLUMN[2:])
    assert np.array_equal(tau, log.tau[:-2])
    assert len(after(skip=["0-1"])[0]) == len(log) - 251
