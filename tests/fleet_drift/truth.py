"""True friction of the robots of a fleet at their visits."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, timedelta

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FIRST_DAY = date(2026, 1, 5)


@dataclass(frozen=True)
class Design:
    """Properties of a simulated fleet.

    Attributes
    ----------
    robots, visits : int
        Number of robots, and of visits of each robot.
    scatter : float
        Standard deviation of the logarithm of each friction parameter from visit to visit, independent.
    common : float
        Standard deviation of the logarithm of a random factor that all robots share on a day, one for each friction parameter.
    rate : float
        Relative rise per visit of the friction parameter that drifts.
    onset : int
        Number of visits before the drift begins.
    spread : float
        Standard deviation of the logarithm of the factor by which each robot's scatter differs from `scatter`.
    """

    robots: int = 20
    visits: int = 30
    scatter: float = 0.1
    common: float = 0.0
    rate: float = 0.03
    onset: int = 10
    spread: float = 0.0


@dataclass(frozen=True)
class Truth:
    """Factors on friction, shape (n_friction, n_robots, n_visits), and indices of the friction parameter and robot that drift, or None."""

    factors: Array
    rising: tuple[int, int] | None


def draw(rng: np.random.Generator, design: Design, n_friction: int, *, drift: bool = True) -> Truth:
    """Draw the friction factors of a fleet, with a drift of one parameter of one robot unless `drift` is false."""
    shape = (n_friction, design.robots, design.visits)
    own = design.scatter * np.exp(design.spread * rng.standard_normal(design.robots))
    logs = own[:, None] * rng.standard_normal(shape) + design.common * rng.standard_normal(
        (n_friction, 1, design.visits)
    )
    rising = (int(rng.integers(n_friction)), int(rng.integers(design.robots)))
    if not drift:
        return Truth(np.exp(logs), None)
    logs[rising] += np.log1p(design.rate) * np.maximum(np.arange(design.visits) - design.onset + 1, 0)
    return Truth(np.exp(logs), rising)


def robot_name(robot: int) -> str:
    """Return the name of a robot for its index."""
    return f"robot {robot + 1:02d}"


def day(visit: int) -> str:
    """Return the date of a visit for its index, in ISO 8601."""
    return (FIRST_DAY + timedelta(days=visit)).isoformat()
