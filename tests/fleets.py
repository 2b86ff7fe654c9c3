"""Simulated friction of fleets for tests."""

from __future__ import annotations

import numpy as np


def fleet_of(
    rng: np.random.Generator, robot: int | None, robots: int = 20, visits: int = 30, common: float = 0.1
) -> np.ndarray:
    """Return friction (n_robots, n_visits): 10 % scatter, more common to a day; that of `robot` rises by 3 % per visit after the tenth."""
    values = np.exp(0.1 * rng.standard_normal((robots, visits)) + common * rng.standard_normal(visits))
    if robot is not None:
        values[robot, 10:] *= 1.03 ** np.arange(1, visits - 9)
    return values
