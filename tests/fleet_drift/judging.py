"""Answers of a fleet after every visit, and two reference tests that know the onset of the drift."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
import polars as pl

from .truth import Array, Design, robot_name

#: False alarms per visit of the reference tests: about as many as a whole fleet has.
ALLOWED = 1e-3
#: Largest number of visits by which the fleet may find a drift later than a reference test, to be in time.
IN_TIME = 5
Named = tuple[str, str]


@dataclass(frozen=True)
class Answers:
    """Answers of a fleet and of the reference tests about one drift.

    Attributes
    ----------
    found : int or None
        Visits after the onset until the fleet named the drift; None if it never did.
    known, onset_known : int or None
        Visits after the onset until the reference test found the drift that knows robot, parameter and onset, or only the onset.
    false : frozenset of (robot, parameter)
        Robots and parameters that the fleet named and that do not drift.
    """

    found: int | None
    known: int | None
    onset_known: int | None
    false: frozenset[Named]


def in_time(found: int | None, test: int | None) -> bool:
    """Return whether the fleet found a drift within :data:`IN_TIME` visits of a reference test; true if the test does not find it."""
    return test is None or (found is not None and found <= test + IN_TIME)


def ask(
    rows: pl.DataFrame, design: Design, truth: Named | None, named: Callable[[pl.DataFrame], list[Named]]
) -> Answers:
    """Return the answers after every visit; `named` returns the drifts that a fleet names from estimates without the column `visit`."""
    found, false = None, set()
    for seen in range(1, design.visits + 1):
        answer = named(rows.filter(pl.col("visit") < seen).drop("visit"))
        if truth in answer and seen > design.onset and found is None:
            found = seen - design.onset
        false |= {one for one in answer if one != truth or seen <= design.onset}
    series = len(rows.select("robot", "of", "name").unique())
    known, onset_known = (None if truth is None else _with_onset(rows, design, truth, tests) for tests in (1, series))
    return Answers(found, known, onset_known, frozenset(false))


def _with_onset(rows: pl.DataFrame, design: Design, truth: Named, tests: int) -> int | None:
    """Return the visits after the onset until the slope of the parameter's logarithm is significant for a known scatter and number of tests."""
    robot, name = truth
    one = rows.filter((pl.col("robot") == robot) & (pl.col("name") == name)).sort("visit")
    logs, visits = np.log(one["value"].to_numpy()), one["visit"].to_numpy()
    needed = NormalDist().inv_cdf(1.0 - ALLOWED / tests / 2.0)
    for seen in range(design.onset + 1, design.visits + 1):
        kept = visits < seen
        rise = np.maximum(visits[kept] - design.onset + 1.0, 0.0)
        equations = np.column_stack([np.ones(len(rise)), rise])
        slope = np.linalg.lstsq(equations, logs[kept], rcond=None)[0][1]
        deviation = np.sqrt(design.scatter**2 * np.linalg.inv(equations.T @ equations)[1, 1])
        if abs(slope) > needed * deviation:
            return seen - design.onset
    return None


def truth_name(robot: int, name: str) -> Named:
    """Return robot and parameter of the true drift as an answer names them."""
    return robot_name(robot), name


def report(answers: Sequence[Answers], nulls: Sequence[Answers]) -> str:
    """Return the table of delays and false alarms as text."""
    false = sum(bool(a.false) for a in answers)
    known = sum(in_time(a.found, a.known) for a in answers)
    onset_known = sum(in_time(a.found, a.onset_known) for a in answers)
    lines = [
        f"fleets with a drift: {len(answers)}; with something else named: {false}",
        f"found within {IN_TIME} visits of a test that knows the onset: {onset_known}; robot and parameter too: {known}",
        *(
            f"visits until {what}: median {_quantile(x, 0.5)}, 10 % to 90 % {_quantile(x, 0.1)} to {_quantile(x, 0.9)}"
            for what, x in (
                ("found", [a.found for a in answers]),
                ("found by a test that knows the onset", [a.onset_known for a in answers]),
                ("found by a test that knows robot, parameter and onset", [a.known for a in answers]),
                ("found, beyond the test that knows all", [_less(a.found, a.known) for a in answers]),
            )
        ),
    ]
    if nulls:
        lines.append(f"fleets without a drift: {len(nulls)}; with something named: {sum(bool(a.false) for a in nulls)}")
    return "\n".join(lines)


def _less(a: int | None, b: int | None) -> int | None:
    return None if a is None or b is None else a - b


def _quantile(found: Sequence[int | None], share: float) -> str:
    numbers: Array = np.array([np.inf if x is None else x for x in found])
    value = float(np.quantile(numbers, share, method="inverted_cdf"))
    return "never" if np.isinf(value) else f"{value:.0f}"
