"""The feedback study: base parameters and their standard deviations are right, and its tables tell a bias from none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco")
pytest.importorskip("scipy")

from tests.feedback_study.case import CORRELATION_S, FAMILY, JOINTS, PERIOD_S, draw_spline, draw_truth, make_case
from tests.feedback_study.estimates import in_base_parameters, loose_arm
from tests.feedback_study.report import report, summary

from armgap.estimation.base_columns import base_parameters

pytestmark = pytest.mark.slow

#: Rounding of double precision, relative to the largest torque.
ROUNDING = 1e-9


def test_an_arm_in_base_parameters_has_the_torques_and_the_prior_of_the_whole() -> None:
    arm = loose_arm(draw_truth(1))
    base = base_parameters(arm)
    assert arm.chain is not None
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.normal(size=(3, 10, JOINTS))
    other = arm.theta + arm.sigma * rng.normal(size=arm.theta.size)
    reduced = arm.theta.copy()
    reduced[list(base.columns)] += base.of(other) - base.of(arm.theta)
    torque, same = (arm.chain.native().inverse_dynamics(theta, q, dq, ddq) for theta in (other, reduced))
    assert np.abs(torque - same).max() < ROUNDING * np.abs(torque).max()
    draws = [base.of(arm.sigma * rng.normal(size=arm.sigma.size)) for _ in range(4000)]
    given = in_base_parameters(arm, base).sigma
    np.testing.assert_allclose(np.std(draws, axis=0), given[list(base.columns)], rtol=0.1)
    assert not given[list(base.dependent)].any()


def test_a_run_is_disturbed_by_its_share_and_follows_from_its_number() -> None:
    case = make_case(1, 0, 0.05)
    assert case.truth.name == FAMILY
    assert case.truth.n == JOINTS
    assert ((case.times > CORRELATION_S[0]) & (case.times < CORRELATION_S[1])).all()
    quiet, disturbed = (np.concatenate([run.tau for run in runs]) for runs in (case.quiet, case.disturbed))
    unseen = np.concatenate([run.applied - run.tau for run in case.disturbed])
    share = np.std(unseen, axis=0) / np.sqrt(np.mean(quiet**2, axis=0))
    np.testing.assert_allclose(share, 0.05, rtol=0.15)
    assert (np.std(disturbed - quiet, axis=0) > 0).all(), "fed back into the commands"
    for run in case.quiet:
        np.testing.assert_array_equal(run.applied, run.tau)
    again = make_case(1, 0, 0.05)
    np.testing.assert_array_equal(again.disturbed[0].q, case.disturbed[0].q)


def test_splines_keep_to_ranges_and_speeds() -> None:
    robot = draw_truth(2)
    reference = draw_spline(robot, 2000, PERIOD_S, np.random.default_rng(3))
    assert (reference.q >= robot.lower).all()
    assert (reference.q <= robot.upper).all()
    assert (np.abs(reference.dq) <= robot.speed * (1 + ROUNDING)).all()
    assert (np.abs(reference.dq[0]) < 0.02 * robot.speed).all()


def records(bias: float, given: float) -> list[dict[str, Any]]:
    """Answers of 200 runs that scatter by 1 % about a value of 2 plus a bias, beside a parameter that is not determined."""
    rng = np.random.default_rng(4)

    def condition(off: float) -> dict[str, Any]:
        estimate = (2.0 * (1 + off + 0.01 * rng.normal()), rng.normal())
        of = {"estimate": estimate, "sigma": (0.02 * given, 1.0)}
        return of | {"checks": [], "identified": estimate, "identified_sigma": of["sigma"]}

    found = []
    for number in range(200):
        disturbed = condition(bias)
        common = {"number": number, "share": 0.05, "names": ("a", "b"), "truth": (2.0, 1.0)}
        found.append(common | {"quiet": condition(0.0), "disturbed": disturbed, "single": disturbed["estimate"]})
    return found


def test_the_tables_tell_bias_and_coverage() -> None:
    found = summary(records(0.0, 1.0), "disturbed")
    assert found.names == ("a",)
    assert found.unbiased.all()
    assert 0.9 < found.coverage < 0.99
    assert 0.9 < found.scatter[0] < 1.1
    biased = summary(records(0.06, 1.0), "disturbed")
    assert not biased.unbiased.any()
    assert abs(biased.bias[0] - 0.06) < 0.003
    assert biased.coverage < 0.01
    assert summary(records(0.0, 0.5), "disturbed").coverage < 0.8
    assert "biased" in report(records(0.06, 1.0))
    assert "biased" not in report(records(0.0, 1.0))
    assert "run 7: no answer" in report([*records(0.0, 1.0), {"number": 7, "failed": "no answer"}])
