"""Series of parameters over the visits of robots: tests for drift, and for robots that differ from the others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from armgap.fleet.drift import Drift, drifts, odd_ones

__all__ = ["Move", "Odd", "Series", "moving", "odd", "series_of"]

_DAY = len("2026-01-05")


@dataclass(frozen=True)
class Series:
    """Estimates of one parameter of all robots of a fleet, by robot and visit.

    Attributes
    ----------
    of, name : str
        Owner of the parameter, ``arm`` or ``effect:joint``, and the parameter's name.
    robots : list of str
        Names of the robots, one per row.
    times : list of list of str
        Time of recording of each value's logs, ISO 8601; empty where it is unknown or there is no value.
    values, sigma : ndarray, shape (n_robots, n_visits)
        Estimates and standard errors, NaN for none. A column holds visits of the same day: the first of each robot on that day,
        or the second, and so on. Without times the first visits of all robots stand in one column.
    """

    of: str
    name: str
    robots: list[str]
    times: list[list[str]]
    values: NDArray[np.float64]
    sigma: NDArray[np.float64]


@dataclass(frozen=True)
class Move:
    """A parameter of one robot that drifts.

    Attributes
    ----------
    robot, of, name : str
        Robot, owner of the parameter (``arm`` or ``effect:joint``), and the parameter's name.
    visit : int
        First of the robot's visits with a changed parameter, counted from 1 among those with a value.
    since : str
        Time of the first changed visit; empty where unknown.
    drift : Drift
        Rate of the drift and its evidence.
    """

    robot: str
    of: str
    name: str
    visit: int
    since: str
    drift: Drift


@dataclass(frozen=True)
class Odd:
    """A parameter of one robot whose median over visits, `usual`, is `apart` robust standard deviations from the fleet's median, `fleet`."""

    robot: str
    of: str
    name: str
    usual: float
    fleet: float
    apart: float


def series_of(parameters: pl.DataFrame) -> list[Series]:
    """Return the estimates of a fleet's parameters, one `Series` per parameter, by robot and by entry of the manifest (a visit to the robot).

    Parameters
    ----------
    parameters : polars.DataFrame
        Columns robot, time, of, name, value and sigma: one row per entry and parameter, as `armgap fleet` writes to ``parameters.parquet``.
    """
    place = ["robot", "of", "name"]
    day = pl.col("time").fill_null("").str.slice(0, _DAY)
    # Entries without a time come first, in the order of the manifest.
    dated = parameters.with_columns(day=day).sort("time", nulls_last=False, maintain_order=True)
    counted = dated.with_columns(count=pl.int_range(pl.len()).over([*place, "day"]))
    groups = counted.group_by(["of", "name"], maintain_order=True)
    return [_series(str(of), str(name), table) for (of, name), table in groups]


def _series(of: str, name: str, table: pl.DataFrame) -> Series:
    columns = {key: i for i, key in enumerate(table.select("day", "count").unique().sort("day", "count").rows())}
    rows = {str(robot): i for i, robot in enumerate(table["robot"].unique(maintain_order=True))}
    values, sigma = (np.full((len(rows), len(columns)), np.nan) for _ in range(2))
    times = [[""] * len(columns) for _ in rows]
    for robot, time, day, count, value, error in table.select("robot", "time", "day", "count", "value", "sigma").rows():
        place = rows[robot], columns[day, count]
        values[place] = np.nan if value is None else value
        sigma[place] = np.nan if error is None else error
        times[place[0]][place[1]] = time or ""
    return Series(of, name, list(rows), times, values, sigma)


def moving(parameters: pl.DataFrame) -> Iterator[Move]:
    """Yield the drifting parameters of arms and of causes, grouped by parameter, in each group the strongest evidence first.

    Parameters
    ----------
    parameters : polars.DataFrame
        Table as in ``parameters.parquet``.
    """
    found = series_of(parameters)
    tests = sum(len(series.robots) for series in found)
    for series in found:
        for drift in drifts(series.values, series.sigma, tests=tests):
            visit = int(np.count_nonzero(np.isfinite(series.values[drift.robot, : drift.onset + 1])))
            since = series.times[drift.robot][drift.onset]
            yield Move(series.robots[drift.robot], series.of, series.name, visit, since, drift)


def odd(parameters: pl.DataFrame) -> list[Odd]:
    """Return the parameters of robots that lie far from those of the other robots, the farthest first.

    Parameters
    ----------
    parameters : polars.DataFrame
        Table as in ``parameters.parquet``.
    """
    found = [
        Odd(series.robots[robot], series.of, series.name, usual, fleet, apart)
        for series in series_of(parameters)
        for robot, usual, fleet, apart in odd_ones(series.values)
    ]
    return sorted(found, key=lambda one: -abs(one.apart))
