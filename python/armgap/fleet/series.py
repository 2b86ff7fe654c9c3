"""Series of parameters over the visits of robots: tests for drift, and for robots that differ from the others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from armgap.fleet.drift import Drift, drifts
from armgap.fleet.outliers import Outlier, odd_ones

__all__ = ["Move", "Odd", "Series", "moving", "numbered", "odd", "series_of"]

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
    visits : ndarray, shape (n_robots, n_visits)
        Number of each visit among all visits of the robot, from 1, whether or not they have a value of this parameter; 0 for no visit.
    """

    of: str
    name: str
    robots: list[str]
    times: list[list[str]]
    values: NDArray[np.float64]
    sigma: NDArray[np.float64]
    visits: NDArray[np.float64]


@dataclass(frozen=True)
class Move:
    """A parameter of one robot that drifts.

    Attributes
    ----------
    robot, of, name : str
        Robot, owner of the parameter (``arm`` or ``effect:joint``), and the parameter's name.
    visit : int
        First of the robot's visits with a changed parameter, counted from 1 among all of its visits with a diagnosis.
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
    """A parameter of one robot that differs from the other robots'.

    Attributes
    ----------
    robot, of, name : str
        Robot, owner of the parameter (``arm`` or ``effect:joint``), and the parameter's name.
    outlier : Outlier
        Means of the robot and of the others, and their difference.
    """

    robot: str
    of: str
    name: str
    outlier: Outlier


def series_of(parameters: pl.DataFrame) -> list[Series]:
    """Return the estimates of a fleet's parameters, one `Series` per parameter, by robot and by entry of the manifest (a visit to the robot).

    Parameters
    ----------
    parameters : polars.DataFrame
        Columns robot, time, of, name, value and sigma: one row per entry and parameter, as `armgap fleet` writes to ``parameters.parquet``.
    """
    groups = numbered(parameters).group_by(["of", "name"], maintain_order=True)
    return [_series(str(of), str(name), table) for (of, name), table in groups]


def numbered(parameters: pl.DataFrame) -> pl.DataFrame:
    """Return a fleet's parameters by time, with the columns `day`, `count` and `visit`: the visit's number on that day, and of all.

    Rows of a robot with one time are of one visit, unless a parameter stands there twice. Entries without a time come first, in the order of the
    manifest: where some of them lack a parameter, its visits without times are counted by the rows that are there.
    """
    same = pl.int_range(pl.len()).over(["robot", "of", "name", "time"])
    day = pl.col("time").fill_null("").str.slice(0, _DAY)
    dated = parameters.with_columns(day=day, same=same).sort("time", nulls_last=False, maintain_order=True)
    visits = dated.select("robot", "time", "day", "same").unique(maintain_order=True)
    visits = visits.sort(pl.col("time"), pl.col("same"), nulls_last=False, maintain_order=True).with_columns(
        count=pl.int_range(pl.len()).over(["robot", "day"]), visit=pl.int_range(1, pl.len() + 1).over("robot")
    )
    return dated.join(visits, on=["robot", "time", "day", "same"], nulls_equal=True, maintain_order="left")


def _series(of: str, name: str, table: pl.DataFrame) -> Series:
    columns = {key: i for i, key in enumerate(table.select("day", "count").unique().sort("day", "count").rows())}
    rows = {str(robot): i for i, robot in enumerate(table["robot"].unique(maintain_order=True))}
    values, sigma = (np.full((len(rows), len(columns)), np.nan) for _ in range(2))
    visits, times = np.zeros(values.shape), [[""] * len(columns) for _ in rows]
    keys = ("robot", "time", "day", "count", "visit", "value", "sigma")
    for robot, time, day, count, visit, value, error in table.select(keys).rows():
        place = rows[robot], columns[day, count]
        values[place] = np.nan if value is None else value
        sigma[place] = np.nan if error is None else error
        visits[place] = visit
        times[place[0]][place[1]] = time or ""
    return Series(of, name, list(rows), times, values, sigma, visits)


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
        for drift in drifts(series.values, series.sigma, visits=series.visits, tests=tests):
            place = drift.robot, drift.onset
            since = series.times[drift.robot][drift.onset]
            yield Move(series.robots[drift.robot], series.of, series.name, int(series.visits[place]), since, drift)


def odd(parameters: pl.DataFrame) -> list[Odd]:
    """Return the parameters of robots that differ from those of the other robots, the least likely by chance first.

    Parameters
    ----------
    parameters : polars.DataFrame
        Table as in ``parameters.parquet``.
    """
    found = series_of(parameters)
    tests = sum(len(series.robots) for series in found)
    odd = [
        Odd(series.robots[outlier.robot], series.of, series.name, outlier)
        for series in found
        for outlier in odd_ones(series.values, series.sigma, tests=tests)
    ]
    return sorted(odd, key=lambda one: (one.outlier.chance, -abs(one.outlier.apart)))
