"""Tables of estimates made from true values, with errors of the size that real diagnoses have."""

from __future__ import annotations

import numpy as np
import polars as pl

from .truth import Design, Truth, day, robot_name

#: Parameters of a two-link arm: name, whether it is friction, median of the relative standard error and standard deviation of its logarithm, and
#: RMS of errors over stated standard errors. Measured by ``python -m tests.fleet_drift logs --seed 2 --model geared --robots 4``.
PARAMETERS: tuple[tuple[str, bool, float, float, float], ...] = (
    ("theta1", False, 0.00036, 0.7, 0.5),
    ("theta2", False, 0.00045, 0.8, 0.5),
    ("theta3", False, 0.0003, 0.8, 0.6),
    ("theta4", False, 0.0002, 0.8, 0.5),
    ("theta5", False, 0.00025, 1.0, 0.5),
    ("viscous1", True, 0.0071, 1.1, 0.4),
    ("viscous2", True, 0.0042, 0.8, 0.5),
    ("coulomb1", True, 0.00046, 0.7, 0.5),
    ("coulomb2", True, 0.00039, 0.7, 0.5),
)
FRICTION = [name for name, friction, *_ in PARAMETERS if friction]


def table(rng: np.random.Generator, design: Design, truth: Truth) -> pl.DataFrame:
    """Return the estimates of a fleet as rows of ``parameters.parquet`` with a column `visit`, in the order of the visits."""
    parts = []
    shape = (design.robots, design.visits)
    for name, friction, median, spread, ratio in PARAMETERS:
        level = np.exp(0.2 * rng.standard_normal((design.robots, 1)))
        true = level * (truth.factors[FRICTION.index(name)] if friction else np.ones(shape))
        sigma = true * median * np.exp(spread * rng.standard_normal(shape))
        value = true + ratio * sigma * rng.standard_normal(shape)
        parts.append(
            pl.DataFrame(
                {
                    "robot": np.repeat([robot_name(i) for i in range(design.robots)], design.visits),
                    "time": [day(k) for k in range(design.visits)] * design.robots,
                    "name": name,
                    "value": value.ravel(),
                    "sigma": sigma.ravel(),
                    "visit": np.tile(np.arange(design.visits), design.robots),
                }
            )
        )
    return pl.concat(parts).with_columns(of=pl.lit("arm"), unit=pl.lit("")).sort("visit", maintain_order=True)
