"""What drifts in a fleet, and which robot is the odd one: every decision of the test, and the study of it."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from armgap.fleet.drift import FALSE_ALARMS, drifts, fleet_autocorrelation, fleet_scatter, relative, threshold
from armgap.fleet.outliers import odd_ones
from armgap.fleet.series import moving, series_of
from armgap.fleet.tables import PARAMETERS
from fleet_drift.judging import ask, in_time, report
from fleet_drift.rows import FRICTION, table
from fleet_drift.truth import Design, draw, robot_name
from fleets import fleet_of


def test_friction_that_rises_is_found_and_nothing_else() -> None:
    rng = np.random.default_rng(2)
    found, false = 0, 0
    for _ in range(50):
        robot = int(rng.integers(20))
        named = [d.robot for d in drifts(fleet_of(rng, robot), tests=180)]
        found += robot in named
        false += any(r != robot for r in named)
    assert found >= 45
    assert false <= 2


def test_constant_friction_does_not_drift() -> None:
    """Fifty fleets, asked after every visit: one false alarm is expected at most, three have a probability below 2 %."""
    rng = np.random.default_rng(4)
    false = 0
    for _ in range(50):
        values = fleet_of(rng, None)
        false += any(drifts(values[:, :seen]) for seen in range(6, 31))
    assert 50 * 25 * FALSE_ALARMS < 3
    assert false <= 2


def test_a_drift_says_since_when_and_how_fast() -> None:
    [drift] = drifts(fleet_of(np.random.default_rng(5), 7))
    assert drift.robot == 7
    assert abs(drift.onset - 10) <= 4
    assert drift.rate == pytest.approx(0.03, rel=0.4)
    assert drift.evidence > drift.threshold
    # Friction that falls drifts as well.
    [falls] = drifts(1.0 / fleet_of(np.random.default_rng(5), 7))
    assert falls.rate == pytest.approx(-0.03, rel=0.4)


def test_nothing_is_found_before_the_onset_and_the_drift_soon_after() -> None:
    """A test of one series with a known onset needs 8 visits; the evidence grows with the power 3/2 of their number."""
    rng = np.random.default_rng(8)
    first = []
    for _ in range(20):
        values = fleet_of(rng, 3)
        seen = [k for k in range(6, 31) if any(d.robot == 3 for d in drifts(values[:, :k]))]
        first.append(seen[0] - 10)
    assert min(first) > 3
    assert np.median(first) <= 13


def test_few_visits_say_nothing() -> None:
    steep = np.exp(0.01 * np.random.default_rng(1).standard_normal((20, 6)))
    steep[4, 3:] *= 1.5 ** np.arange(1, 4)
    assert drifts(steep[:, :5]) == []
    assert [d.robot for d in drifts(steep)] == [4]
    # Six visits of one robot alone are not enough to know its scatter.
    noise = np.exp(0.1 * np.random.default_rng(2).standard_normal((400, 6)))
    assert sum(bool(drifts(row[None, :])) for row in noise) <= 400 * FALSE_ALARMS + 3


def test_the_scatter_is_that_of_the_fleet_whatever_one_robot_does() -> None:
    rng = np.random.default_rng(6)
    values = fleet_of(rng, None, common=0.0)
    zero = np.zeros_like(values)
    calm, dispersion, _ = fleet_scatter(relative(values)[0], zero)
    assert calm == pytest.approx(0.1, rel=0.1)
    assert dispersion == pytest.approx(1.0, abs=0.4)
    values[5, 10:] *= 1.03 ** np.arange(1, 21)
    drifting, _, _ = fleet_scatter(relative(values)[0], zero)
    assert drifting == pytest.approx(calm, rel=0.02)
    values[5] *= np.exp(rng.standard_normal(30))
    wild, dispersion, _ = fleet_scatter(relative(values)[0], zero)
    assert wild == pytest.approx(calm, rel=0.05)
    assert np.argmax(dispersion) == 5


def test_a_robot_that_scatters_more_is_judged_by_its_own_scatter() -> None:
    rng = np.random.default_rng(9)
    scatter = np.full(20, 0.05)
    scatter[::2] = 0.2
    false = 0
    for _ in range(30):
        values = np.exp(scatter[:, None] * rng.standard_normal((20, 30)))
        false += bool(drifts(values))
    assert false <= 2


def test_standard_errors_count_as_scatter() -> None:
    """Where visits differ in what their motions tell, a few poor ones at the end are no drift."""
    rng = np.random.default_rng(10)
    sigma = np.full((20, 30), 0.01)
    sigma[:, 25:] = 0.15
    known, unknown = 0, 0
    for _ in range(30):
        values = 1.0 + sigma * rng.standard_normal((20, 30))
        known += bool(drifts(values, sigma))
        unknown += bool(drifts(values))
    assert known <= 2
    assert unknown > 15
    # And an estimate that says nothing is no value.
    values = 1.0 + 0.01 * rng.standard_normal((20, 30))
    values[3, 26:] = 3.0
    sigma = np.where(values > 2.0, 2.0, 0.01)
    assert drifts(values, sigma) == []


def lasting(rng: np.random.Generator, correlation: float, robots: int = 20, visits: int = 30) -> np.ndarray:
    """Logarithms that scatter by one and follow a first-order autoregression."""
    logs = rng.standard_normal((robots, visits))
    for k in range(1, visits):
        logs[:, k] = correlation * logs[:, k - 1] + np.sqrt(1.0 - correlation**2) * logs[:, k]
    return logs


def test_scatter_that_lasts_until_the_next_visit_is_no_drift() -> None:
    rng = np.random.default_rng(16)
    assert fleet_autocorrelation(lasting(rng, 0.0, visits=200)) == pytest.approx(0.0, abs=0.03)
    assert fleet_autocorrelation(lasting(rng, 0.5, visits=200)) == pytest.approx(0.5, abs=0.05)
    false = sum(bool(drifts(np.exp(0.1 * lasting(rng, 0.5)))) for _ in range(30))
    assert false <= 2
    # Nor does it hide one: friction that rises by 6 % per visit.
    values = np.exp(0.1 * lasting(rng, 0.5))
    values[7, 10:] *= 1.06 ** np.arange(1, 21)
    assert drifts(values)[0].robot == 7


def test_one_wild_visit_is_no_drift() -> None:
    for visit in (0, 14, 27, 28, 29):
        values = fleet_of(np.random.default_rng(11), None)
        values[3, visit] *= 5.0
        assert drifts(values) == []


def test_what_all_robots_do_is_no_drift() -> None:
    values = fleet_of(np.random.default_rng(12), None) * 1.03 ** np.arange(30)
    assert drifts(values) == []
    # Three robots are no fleet: each is judged by itself.
    assert len(drifts(values[:3])) == 3


def test_parameters_of_both_signs_are_left_out() -> None:
    values = fleet_of(np.random.default_rng(5), 7)
    values[7, 2] *= -1.0
    assert drifts(values) == []
    assert [d.robot for d in drifts(-fleet_of(np.random.default_rng(5), 7))] == [7]


def test_constants_do_not_drift() -> None:
    assert drifts(np.ones((20, 30))) == []
    assert drifts(np.full((20, 30), np.nan)) == []


def test_noise_exceeds_the_threshold_as_rarely_as_it_says() -> None:
    """Monte Carlo over ramps from every onset in 30 visits; the bound is at most four times too wide."""
    rng = np.random.default_rng(13)
    onsets = np.arange(3, 28)
    ramps = np.maximum(np.arange(30) - onsets[:, None] + 1.0, 0.0)
    ramps -= ramps.mean(axis=1, keepdims=True)
    ramps /= np.linalg.norm(ramps, axis=1, keepdims=True)
    length = float(np.arccos(np.sum(ramps[1:] * ramps[:-1], axis=1)).sum())
    noise = rng.standard_normal((100_000, 30))
    largest = np.abs(noise @ ramps.T).max(axis=1)
    for allowed in (0.05, 0.01, 0.002):
        rare = np.mean(largest > threshold(allowed, length, 1e6))
        assert allowed / 4 < rare < allowed
        # With the scatter from 12 degrees of freedom.
        scatter = np.sqrt(rng.chisquare(12, len(largest)) / 12)
        rare = np.mean(largest / scatter > threshold(allowed, length, 12.0))
        assert allowed / 4 < rare < allowed


def test_more_series_need_more_evidence() -> None:
    values = fleet_of(np.random.default_rng(5), 7)
    few, many = (drifts(values, tests=tests)[0].threshold for tests in (20, 20_000))
    assert many == pytest.approx(np.sqrt(few**2 + 2 * np.log(1000)), rel=0.02)


def rows_of(values: np.ndarray, hour: int = 0) -> pl.DataFrame:
    rows = [
        (robot_name(i), f"2026-01-{k + 1:02d}T{hour:02d}:{i:02d}:00", "arm", "coulomb1", float(v), 0.01, "N m")
        for i, row in enumerate(values)
        for k, v in enumerate(row)
    ]
    return pl.DataFrame(rows, schema=PARAMETERS, orient="row")


def test_visits_are_compared_by_day() -> None:
    """A robot without a diagnosis on one day does not shift its later visits against the others'."""
    days = np.exp(np.random.default_rng(14).standard_normal(30))
    values = np.exp(0.05 * np.random.default_rng(15).standard_normal((8, 30))) * days
    rows = rows_of(values).filter(~((pl.col("robot") == robot_name(2)) & pl.col("time").str.starts_with("2026-01-04")))
    [series] = series_of(rows)
    assert series.values.shape == (8, 30)
    assert np.flatnonzero(np.isnan(series.values[2])).tolist() == [3]
    assert list(moving(rows)) == []
    # Two visits on a day are two.
    [twice] = series_of(pl.concat([rows, rows_of(values, hour=5)]))
    assert twice.values.shape == (8, 60)
    # Without times visits are counted.
    [counted] = series_of(rows.with_columns(time=pl.lit(None, pl.String)))
    assert np.isnan(counted.values[2, 29])


def test_a_drift_says_when_or_at_which_visit() -> None:
    values = fleet_of(np.random.default_rng(5), 7)
    [dated] = moving(rows_of(values))
    assert dated.since.startswith("2026-01-")
    assert int(dated.since[8:10]) == dated.visit
    [counted] = moving(rows_of(values).with_columns(time=pl.lit(None, pl.String)))
    assert (counted.since, counted.visit) == ("", dated.visit)


def test_a_drift_is_counted_in_all_visits_of_the_robot() -> None:
    """Every second visit has no estimate: the friction rises by 3 % per visit all the same."""
    values = fleet_of(np.random.default_rng(5), 7, visits=60)
    rows = rows_of(values[:, :30])
    full = [move.drift.rate for move in moving(rows)]
    other = rows.with_columns(name=pl.lit("theta1"), value=pl.lit(1.0))
    late = pl.col("time").str.slice(8, 2).cast(pl.Int64) % 2 == 0
    [move] = moving(pl.concat([rows.filter((pl.col("robot") != robot_name(7)) | late), other]))
    assert full == [pytest.approx(0.03, rel=0.4)]
    assert move.drift.rate == pytest.approx(full[0], rel=0.4)
    assert int(move.since[8:10]) == move.visit


def test_a_robot_far_from_the_others_is_odd() -> None:
    values = fleet_of(np.random.default_rng(3), None)
    assert odd_ones(values) == []
    values[4] *= 2.0
    [found] = odd_ones(values)
    assert found.robot == 4
    assert found.usual == pytest.approx(2.0 * found.others, rel=0.2)
    assert found.chance < 1e-6
    assert odd_ones(values[:3]) == []
    # Two odd robots do not hide each other.
    values[9] *= 2.0
    assert {one.robot for one in odd_ones(values)} == {4, 9}
    # A third of the robots are not odd but another model.
    values[8:15] *= 2.0
    assert odd_ones(values) == []


@pytest.mark.parametrize("robots", [4, 5, 10, 20])
def test_of_like_robots_none_is_odd(robots: int) -> None:
    """Of 150 fleets with nine parameters 4 % are expected at most, so that 14 have a probability below 1 %."""
    rng = np.random.default_rng(robots)
    fleets = (rng.normal(1.0, 0.04, (9, robots, 1)) for _ in range(150))
    assert sum(any(odd_ones(values, tests=9 * robots) for values in fleet) for fleet in fleets) < 14


@pytest.mark.parametrize("robots", [5, 20])
def test_three_times_the_friction_is_odd_in_small_fleets_too(robots: int) -> None:
    rng = np.random.default_rng(robots)
    found = 0
    for _ in range(20):
        values = rng.normal(1.0, 0.04, (robots, 2))
        values[2] *= 3.0
        found += [one.robot for one in odd_ones(values, tests=9 * robots)] == [2]
    assert found >= 18


def test_visits_and_standard_errors_bound_what_is_odd() -> None:
    """Four robots that agree by chance: what the visits scatter by, or the estimates say of themselves, is not undercut."""
    rng = np.random.default_rng(17)
    level = np.array([1.0, 1.00001, 0.99999, 1.02])[:, None]
    scatter = np.array([[0.03, -0.03]])
    assert [one.robot for one in odd_ones(np.hstack([level, level]))] == [3]
    assert odd_ones(level + scatter) == []
    assert odd_ones(level, np.full((4, 1), 0.02)) == []
    assert odd_ones(np.ones((5, 3))) == []
    # Values of both signs have no logarithm.
    offsets = rng.standard_normal((20, 3))
    offsets[6] += 20.0
    assert [one.robot for one in odd_ones(offsets)] == [6]


def test_the_study_judges_answers() -> None:
    """A test that names all, one that names nothing, and one that knows the answer from the twelfth visit on."""
    design = Design(robots=4, visits=20, rate=0.2)
    truth = draw(np.random.default_rng(1), design, len(FRICTION))
    assert truth.rising is not None
    name = (robot_name(truth.rising[1]), FRICTION[truth.rising[0]])
    rows = table(np.random.default_rng(2), design, truth)
    late = ask(rows, design, name, lambda seen: [name] if seen.height >= 12 * 9 * 4 else [])
    assert (late.found, late.false, in_time(late.found, late.known)) == (2, frozenset(), True)
    assert late.known is not None
    assert 2 <= late.known <= 4
    never = ask(rows, design, name, lambda seen: [])
    assert (never.found, in_time(never.found, never.known)) == (None, False)
    always = ask(rows, design, name, lambda seen: [name])
    assert (always.found, always.false) == (1, frozenset({name}))
    told = report([late, never, always], [never, always])
    assert "with a drift: 3; with something else named: 1" in told
    assert "robot and parameter too: 2" in told
    assert "without a drift: 2; with something named: 1" in told


def test_robots_of_unlike_scatter_are_no_drift() -> None:
    """Six fleets, asked after every visit."""
    rng = np.random.default_rng(5)
    for _ in range(6):
        own = 0.1 * np.exp(0.5 * rng.standard_normal(20))
        values = np.exp(own[:, None] * rng.standard_normal((20, 30)))
        assert [drifts(values[:, :visits], tests=180) for visits in range(6, 31)] == [[]] * 25
