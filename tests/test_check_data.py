"""Defects that a log shows by itself: put into clean logs, they are named and mended; clean logs are left alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray

from armgap import Arm, Log, seed_torque, simulate
from armgap.check.log_checks.data import copied_holdout, data_checks
from armgap.check.log_checks.outcome import with_rows

Array = NDArray[np.float64]
PERIOD = 0.0025
TURN = 2 * np.pi


@pytest.fixture(scope="module")
def clean(arm: Arm) -> Log:
    """Six seconds of the paper's arm with its encoders."""
    t = PERIOD * np.arange(2400)
    return simulate(arm, t, seed_torque(t), sensor=True, name="clean")


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def names(log: Log, arm: Arm | None = None) -> set[str]:
    return {check.check for check in data_checks(log, arm, repair=True)[1]}


def with_q(log: Log, change: Callable[[Array], Array]) -> Log:
    return replace(log, q=np.column_stack([change(column) for column in log.q.T]))


def low_passed(q: Array, times: int) -> Array:
    """Return positions after a low-pass without delay: binomial weights."""
    for _ in range(times):
        q = np.convolve(np.pad(q, 1, "edge"), [0.25, 0.5, 0.25], "valid")
    return q


def at_rate(t: Array, q: Array, rate: float) -> Array:
    """Return positions sampled at a slower rate and joined by straight lines."""
    knots = np.arange(t[0], t[-1] + 1 / rate, 1 / rate)
    return np.interp(t, knots, q[np.clip(np.searchsorted(t, knots), 0, len(t) - 1)])


def test_a_clean_log_is_silent_and_unchanged(clean: Log, arm: Arm) -> None:
    for given in (arm, None):
        log, checks = data_checks(clean, given, repair=True)
        assert checks == []
        assert log is clean


@pytest.mark.parametrize("effect", ["noise", "no encoder", "six decimals", "single precision"])
def test_other_kinds_of_numbers_are_no_defect(arm: Arm, rng: np.random.Generator, effect: str) -> None:
    t = PERIOD * np.arange(2400)
    exact = simulate(arm, t, seed_torque(t), name="exact")
    changed = {
        "noise": lambda q: q + 3e-5 * rng.standard_normal(len(q)),
        "no encoder": lambda q: q,
        "six decimals": lambda q: np.round(q, 6),
        "single precision": lambda q: q.astype(np.float32).astype(np.float64),
    }[effect]
    assert names(with_q(exact, changed)) == set()


def test_turns_are_taken_out(clean: Log, arm: Arm) -> None:
    wrapped = replace(clean, q=np.mod(clean.q + np.pi - clean.q.mean(axis=0), TURN))
    log, checks = data_checks(wrapped, arm, repair=True)
    assert checks == []  # the range does not reach the edge
    wrapped = replace(clean, q=np.mod(clean.q - clean.q.mean(axis=0), TURN))
    log, checks = data_checks(wrapped, arm, repair=True)
    assert {(c.check, c.severity) for c in checks} == {("wrapped_positions", "repaired")}
    assert np.ptp(log.q - clean.q, axis=0) == pytest.approx([0.0, 0.0], abs=1e-12)


def test_a_wrapped_encoder_that_turns_fast_is_read_and_unwrapped() -> None:
    t = 0.002 * np.arange(4000)
    count = TURN / 20_000
    turned = np.round((19 * t + 0.5 * np.sin(5 * t)) / count) * count
    frame = {"t": t, "q1": np.mod(turned, TURN), "dq1": 19 + 2.5 * np.cos(5 * t), "tau1": np.sin(3 * t)}
    log, checks = data_checks(Log.from_frame(pl.DataFrame(frame)), None, repair=True)
    assert [c.check for c in checks] == ["wrapped_positions"]
    assert np.ptp(log.q[:, 0] - turned) == pytest.approx(0.0, abs=1e-9)
    degrees = Log.from_frame(pl.DataFrame(frame | {"q1": np.degrees(frame["q1"])}))
    assert [f.kind for f in degrees.findings] == ["units"]
    assert np.ptp(data_checks(degrees, None, repair=True)[0].q[:, 0] - turned) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("rows", "value"), [((700,), 25.0), ((700, 701, 702), 25.0), ((0,), 9.0), ((2399,), -9.0)])
def test_wild_positions_are_left_out(clean: Log, arm: Arm, rows: tuple[int, ...], value: float) -> None:
    q = clean.q.copy()
    q[list(rows), 1] = value
    log, checks = data_checks(replace(clean, q=q), arm, repair=True)
    assert [(c.check, c.joint, c.rows) for c in checks] == [("spike", 2, ((rows[0], rows[-1]),))]
    kept = np.setdiff1d(np.arange(len(clean)), rows)
    assert np.array_equal(log.q, clean.q[kept])


@pytest.mark.parametrize("value", [1e6, -1e300, 4e4])
def test_the_log_is_broken_at_absurd_torques(clean: Log, value: float) -> None:
    tau = clean.tau.copy()
    tau[900, 0] = value
    log, checks = data_checks(replace(clean, tau=tau), None, repair=True)
    assert [(c.check, c.joint, c.rows) for c in checks] == [("spike", 1, ((900, 900),))]
    kept = np.isin(clean.t, log.t)
    assert not kept[900]
    assert np.flatnonzero(~kept).tolist() == list(range(np.argmin(kept), len(kept) - np.argmin(kept[::-1])))
    assert 10 * clean.sample_period < np.diff(log.t).max() < 0.1
    beside = [np.argmin(kept) - 1]
    assert np.array_equal(log.tau[: beside[0]], clean.tau[: beside[0]])


def test_wild_rows_pass_the_reader(clean: Log, arm: Arm) -> None:
    q, tau = clean.q.copy(), clean.tau.copy()
    q[500, 0], tau[800, 1] = 1e9, 1e12
    log = Log.from_arrays(clean.t, q, tau, arm=arm)
    assert [c.check for c in data_checks(log, arm, repair=True)[1]] == ["spike", "spike"]


def test_blows_and_torque_steps_are_no_spikes(clean: Log) -> None:
    """A joint that bounces, one that starts at once, a torque that jumps and stays."""
    t = clean.t
    bouncing = np.abs(np.mod(t, 0.4) - 0.2) * 5
    steps = np.where(np.mod(t, 1.0) < 0.5, 10.0, -10.0)
    count = 1e-5
    log = Log.from_arrays(t, np.round(bouncing / count) * count, steps)
    assert "spike" not in names(log)


@pytest.mark.parametrize("scatter", [0.05, 0.1, 0.3])
def test_even_times_replace_stamps_that_scatter(clean: Log, rng: np.random.Generator, scatter: float) -> None:
    t = np.maximum.accumulate(clean.t + scatter * PERIOD * rng.standard_normal(len(clean)))
    t += 2e-9 * np.arange(len(t))
    log, checks = data_checks(replace(clean, t=t), None, repair=True)
    assert [(c.check, c.severity) for c in checks] == [("stamp_jitter", "repaired")]
    assert np.std(np.diff(log.t)) < 0.01 * PERIOD
    assert log.sample_period == pytest.approx(PERIOD, rel=1e-3)


def test_even_times_have_room_for_missing_rows(clean: Log, rng: np.random.Generator) -> None:
    kept = np.sort(rng.permutation(len(clean))[:2380])
    t = (clean.t + 0.2 * PERIOD * rng.uniform(-1, 1, len(clean)))[kept]
    log, checks = data_checks(Log.from_arrays(t, clean.q[kept], clean.tau[kept]), None, repair=True)
    assert [c.check for c in checks] == ["stamp_jitter"]
    assert np.array_equal(np.round(np.diff(log.t) / PERIOD), np.diff(kept))


def test_uneven_sampling_stays(arm: Arm, rng: np.random.Generator) -> None:
    t = np.sort(PERIOD * (np.arange(2400) + rng.uniform(-0.3, 0.3, 2400)))
    log = simulate(arm, t, seed_torque(t), sensor=True)
    assert data_checks(log, arm, repair=True)[0] is log
    assert names(log, arm) == set()


@pytest.mark.parametrize("hold", [2, 3, 5])
def test_held_rows_are_left_out(clean: Log, arm: Arm, hold: int) -> None:
    fresh = (np.arange(len(clean)) // hold) * hold
    log, checks = data_checks(replace(clean, q=clean.q[fresh]), arm, repair=True)
    assert {(c.check, c.severity) for c in checks} == {("repeated_positions", "repaired")}
    rows = np.arange(0, len(clean), hold)
    assert np.array_equal(log.q, clean.q[rows])
    assert log.tau[10] == pytest.approx(clean.tau[10 * hold : 11 * hold].mean(axis=0))


def test_rows_repeated_now_and_then_are_left_out(clean: Log, rng: np.random.Generator) -> None:
    stale = rng.random(len(clean)) < 0.25
    q = clean.q.copy()
    for k in np.flatnonzero(stale[1:]) + 1:
        q[k] = q[k - 1]
    log, checks = data_checks(replace(clean, q=q), None, repair=True)
    assert {c.check for c in checks} == {"repeated_positions"}
    assert len(log) == pytest.approx(np.sum(~stale), rel=0.03)


def test_joints_held_in_different_rows_are_only_said(clean: Log) -> None:
    rows = np.arange(len(clean))
    q = clean.q.copy()
    q[:, 0], q[:, 1] = q[rows // 3 * 3, 0], q[np.maximum((rows - 1) // 3 * 3 + 1, 0), 1]
    log, checks = data_checks(replace(clean, q=q), None, repair=True)
    assert {(c.check, c.severity, c.joint) for c in checks} == {
        ("repeated_positions", "warning", 1),
        ("repeated_positions", "warning", 2),
    }
    assert np.array_equal(log.q, q)


def test_a_coarse_encoder_at_slow_speed_is_not_held() -> None:
    t = 0.001 * np.arange(6000)
    count = TURN / 4096
    log = Log.from_arrays(t, np.round(0.6 * np.sin(2 * t) / count) * count, np.cos(2 * t))
    assert names(log) == set()


@pytest.mark.parametrize("times", [3, 30])
def test_low_passed_positions_are_said(clean: Log, arm: Arm, times: int) -> None:
    smooth = with_q(clean, lambda q: low_passed(q, times))
    for given in (arm, None):
        found = data_checks(smooth, given, repair=True)[1]
        assert {(c.check, c.severity, c.joint) for c in found} == {
            ("filtered_positions", "warning", 1),
            ("filtered_positions", "warning", 2),
        }


def test_one_pole_is_seen_against_the_encoder_s_step(clean: Log, arm: Arm) -> None:
    def one_pole(q: Array) -> Array:
        q = q.copy()
        for k in range(1, len(q)):
            q[k] = q[k - 1] + 0.2 * (q[k] - q[k - 1])
        return q

    assert names(with_q(clean, one_pole), arm) == {"filtered_positions"}


def test_interpolated_positions_are_said(clean: Log, arm: Arm) -> None:
    joined = with_q(clean, lambda q: at_rate(clean.t, q, 42.0))
    for given in (arm, None):
        assert names(joined, given) == {"filtered_positions"}


@pytest.mark.parametrize(("share", "said"), [(0.3, True), (0.005, False)])
def test_torque_steps_are_said_where_they_matter(clean: Log, share: float, said: bool) -> None:
    step = share * np.std(clean.tau, axis=0)
    assert ("quantized_torque" in names(replace(clean, tau=np.round(clean.tau / step) * step))) == said


def test_a_command_of_few_levels_is_not_rounded(clean: Log, rng: np.random.Generator) -> None:
    levels = np.repeat(rng.integers(-10, 11, 60), 40)[:, None] * np.array([0.5, 0.1])
    assert "quantized_torque" not in names(replace(clean, tau=levels))


def test_nothing_is_changed_where_nothing_is_to_be_repaired(clean: Log) -> None:
    q = np.mod(clean.q - clean.q.mean(axis=0), TURN)
    q[700] = 25.0
    broken = replace(clean, q=q)
    log, checks = data_checks(broken, None, repair=False)
    assert log is broken
    assert {c.severity for c in checks} == {"warning"}
    repaired, done = data_checks(broken, None, repair=True)
    assert [(c.check, c.joint, c.rows) for c in checks] == [(c.check, c.joint, c.rows) for c in done]
    assert len(repaired) == len(broken) - 1


def test_rows_are_those_of_the_log_as_given(clean: Log) -> None:
    """Rows that a first repair leaves out do not shift what a later check says."""
    hold = np.arange(len(clean)) // 3 * 3
    q = clean.q[hold].copy()
    q[31:34] = 25.0
    checks = data_checks(replace(clean, q=q), None, repair=True)[1]
    held = next(c for c in checks if c.check == "repeated_positions")
    rows = np.concatenate([np.arange(a, b + 1) for a, b in held.rows])
    assert len(rows) > 300
    assert np.all(hold[rows] != rows)


def test_rows_left_out_keep_the_impulse(clean: Log) -> None:
    kept = np.flatnonzero(np.arange(len(clean)) % 7 != 3)
    held = np.append(np.diff(clean.t), PERIOD)
    fewer = with_rows(clean, kept)
    longer = np.append(np.diff(fewer.t), clean.t[-1] + PERIOD - fewer.t[-1])
    assert longer @ fewer.tau == pytest.approx(held @ clean.tau)


def test_rows_are_left_out_of_a_log_without_torques(clean: Log) -> None:
    """Logs of a position controller hold references in place of torques, and no moments of torques either."""
    commanded = replace(clean, tau=np.empty((len(clean), 0)), q_ref=clean.q)
    fewer = with_rows(commanded, np.flatnonzero(np.arange(len(clean)) % 7 != 3))
    assert fewer.tau.shape == (len(fewer), 0)
    assert fewer.moment is None
    assert fewer.q_ref is not None


def test_copies_are_found_by_content(clean: Log, arm: Arm) -> None:
    t = clean.t
    other = simulate(arm, t, 0.8 * seed_torque(t), sensor=True, name="other")
    renamed = replace(clean, name="renamed", t=clean.t + 3.0)
    part = clean.part(400, 900, "part")
    thinned = Log.from_arrays(t[::2], clean.q[::2], clean.tau[::2], name="thinned")
    found = copied_holdout([other, clean], [other, renamed, part, thinned])
    assert [(c.log, c.severity, c.rows) for c in found] == [
        ("other", "warning", ((0, 2399),)),
        ("renamed", "warning", ((0, 2399),)),
        ("part", "warning", ((0, 499),)),
        ("thinned", "warning", ((0, 1199),)),
    ]
    assert copied_holdout([clean], [other]) == []


def test_rest_is_no_copy(clean: Log, arm: Arm) -> None:
    def resting(log: Log) -> Log:
        q, tau = log.q.copy(), log.tau.copy()
        q[:1200], tau[:1200] = 0.1, 0.0
        return replace(log, q=q, tau=tau)

    other = simulate(arm, clean.t, 0.8 * seed_torque(clean.t), sensor=True, name="other")
    assert copied_holdout([resting(clean)], [resting(other)]) == []
