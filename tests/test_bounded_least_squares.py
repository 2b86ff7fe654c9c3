"""Bounded least squares of the checks against SciPy's implementation, and filtered torques against the rows that they stand for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from armgap import _native


@pytest.mark.parametrize("seed", range(60))
def test_parameters_that_are_held_do_not_keep_others_at_their_bounds(seed: int) -> None:
    """Equal bounds hold a parameter, as those of weights in torques that were logged after gravity compensation."""
    rng = np.random.default_rng(1000 + seed)
    n = int(rng.integers(3, 10))
    a = rng.standard_normal((n + 20, n)) + rng.uniform(0, 2) * rng.standard_normal((n + 20, 1))
    b = a @ (2.0 * rng.standard_normal(n))
    held = np.arange(n) < 1 + n // 3
    low, high = np.where(held, 0.0, -0.5), np.where(held, 0.0, 0.5)
    found = _native.bounded_least_squares(a.T @ a, a.T @ b, low, high)
    known = np.zeros(n)
    known[~held] = lsq_linear(a[:, ~held], b, (low[~held], high[~held]), method="bvls", tol=1e-14).x
    assert np.sum((a @ found - b) ** 2) <= np.sum((a @ known - b) ** 2) * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(60))
def test_bounded_least_squares_agree_with_scipy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 10))
    a = rng.standard_normal((n + 20, n)) * 10.0 ** rng.uniform(-2, 2, n)
    a[:, n // 2] += rng.uniform(0, 3) * a[:, 0]
    b = a @ (rng.standard_normal(n) / np.linalg.norm(a, axis=0)) * 5.0 + rng.standard_normal(n + 20)
    low = np.where(rng.random(n) < 0.2, -np.inf, rng.uniform(-1, 0.5, n) / np.linalg.norm(a, axis=0))
    high = np.where(rng.random(n) < 0.2, np.inf, low + rng.uniform(0.05, 1, n) / np.linalg.norm(a, axis=0))
    high[~np.isfinite(high)] = np.inf
    found = _native.bounded_least_squares(a.T @ a, a.T @ b, low, high)
    known = lsq_linear(a, b, (low, high), method="bvls", tol=1e-14).x
    np.testing.assert_array_equal(np.clip(found, low - 1e-12, high + 1e-12), found)
    assert np.sum((a @ found - b) ** 2) <= np.sum((a @ known - b) ** 2) * (1 + 1e-9)


def test_nothing_to_estimate() -> None:
    assert _native.bounded_least_squares(np.zeros((0, 0)), np.zeros(0), np.zeros(0), np.zeros(0)).shape == (0,)


def test_no_finite_solution_is_nan() -> None:
    assert np.isnan(_native.bounded_least_squares(np.eye(2), np.array([np.nan, 1.0]), np.zeros(2), np.ones(2))).all()


def test_lengths_that_disagree_are_refused() -> None:
    with pytest.raises(ValueError, match="as long as `right`"):
        _native.bounded_least_squares(np.eye(2), np.ones(2), np.zeros(1), np.ones(2))
    with pytest.raises(ValueError, match="as long as `t`"):
        _native.filtered_torques(np.arange(3.0), np.ones(2), 30.0)


def test_filtered_torques_are_the_right_sides_of_the_rows() -> None:
    rng = np.random.default_rng(1)
    t = np.cumsum(rng.uniform(0.002, 0.003, 500))
    q, tau = rng.standard_normal((2, 500, 2))
    arm = {"kind": "two-link", "gravity": 9.81, "theta": [0.1] * 9, "sigma": [0.1] * 9, "link_length": [0.3, 0.3]}
    _, y = _native.regression_rows(arm, t, q, tau, 30.0)
    for j in range(2):
        alone = _native.filtered_torques(t, np.ascontiguousarray(tau[:, j]), 30.0)
        np.testing.assert_allclose(alone, y[:, j], rtol=1e-12, atol=1e-12)
