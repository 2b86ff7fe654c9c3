"""Fitting all parameters of an arm by output error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import armgap
from armgap import Arm, Log, fit, simulate
from armgap.errors import LogShapeError, OptionError

H = 0.0025
TRUTH = np.array([2.3516, 0.0838, 0.1019, 38.465, 1.827, 2.288, 0.175, 7.6095, 1.734])
ONE_JOINT = np.array([0.5, 3.0, 0.2, 0.4])


def two_link(theta: np.ndarray = TRUTH) -> Arm:
    return Arm("arm", "two-link", 9.81, H, theta, 0.1 * np.abs(theta))


def run(duration: float = 6.0) -> Log:
    t = np.arange(0.0, duration, H)
    return simulate(two_link(), t, armgap.seed_torque(t), name="seed")


def test_nine_parameters_come_back_from_positions_alone() -> None:
    found = fit(run(), two_link(TRUTH * (1.0 + 0.2 * np.resize([1.0, -1.0], 9))), horizon=0.2)
    assert found.settled
    assert found.rms < 2e-4
    # What is left comes from first states: velocities beside jumps of the torque.
    np.testing.assert_allclose(found.theta, TRUTH, rtol=2e-2)
    assert found.theta[[0, 3]] == pytest.approx(TRUTH[[0, 3]], rel=2e-3)


def test_the_minimum_does_not_depend_on_where_the_search_starts() -> None:
    log = run(3.0)
    low, high = (fit(log, two_link(TRUTH * factor)).theta for factor in (0.85, 1.2))
    np.testing.assert_allclose(low, high, rtol=1e-5)


@pytest.mark.parametrize("kind", ["pendulum", "axis"])
def test_other_arms_are_fitted_too(kind: str) -> None:
    t = np.arange(0.0, 4.0, H)
    tau = (2.5 * np.sin(5 * t) + 1.5 * np.sin(11 * t + 1) + (3.0 if kind == "axis" else 0.0))[:, None]
    truth = Arm("arm", kind, 9.81, H, ONE_JOINT, 0.1 * ONE_JOINT)
    found = fit(simulate(truth, t, tau), replace(truth, theta=ONE_JOINT * np.array([1.2, 0.9, 0.7, 1.3])))
    assert found.settled
    np.testing.assert_allclose(found.theta, ONE_JOINT, rtol=2e-2)
    assert set(found.to_dict()["parameters"]) == set(truth.parameter_names)


def test_bad_input_is_one_clear_error() -> None:
    log = run(1.0)
    with pytest.raises(OptionError, match="horizon"):
        fit(log, two_link(), horizon=0.0)
    with pytest.raises(LogShapeError, match="joints"):
        fit(log, Arm("arm", "pendulum", 9.81, H, ONE_JOINT, ONE_JOINT))
    with pytest.raises(LogShapeError, match="too short"):
        fit(log, two_link(), horizon=30.0)
