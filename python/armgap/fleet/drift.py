"""Parameters that grow from some visit on.

**Series.** Logarithms of a parameter's estimates, less the robot's own median and less the median of all robots of a day, as far as the latter
varies by more than chance: a common change of all robots on a day is no drift.

**Test.** A ramp from an unknown visit on is detected by the generalised likelihood ratio (Basseville and Nikiforov 1993, section 2.4.3; for a
changing mean Siegmund and Venkatraman 1995): for every onset the slope by weighted least squares, with an unknown level, over its standard
deviation; the largest of all counts.

**Scatter.** A visit's variance is that of its estimate plus a scatter from visit to visit. The fleet's scatter is chosen so that the squared
differences between neighbouring visits, which a ramp hardly changes, have their expected size on the median robot (Paule and Mandel 1982; von Neumann
et al. 1941). A robot's own scatter is shrunk towards the fleet's, by more the better the robots agree (Smyth 2004), and by less the less likely so
large a scatter is under that agreement (Phipson et al. 2016), so that a robot that scatters more than the others is judged by its own scatter.

**Autocorrelation.** A deviation at one visit may last until the next: a first-order autocorrelation common to the fleet is estimated from differences
between neighbours and between visits two apart, as far as it is more than chance. Equations are whitened by it (Prais and Winsten 1954).

**Threshold.** With normal errors and a variance of ``nu`` degrees of freedom, the largest statistic of a family of ramps that is a curve of length
``kappa`` on the sphere exceeds ``b`` with a probability of at most ``(1 + kappa/pi) (1 + b^2/nu)^(-nu/2)`` (Knowles and Siegmund 1989, with
``2 Phi(-b) <= exp(-b^2/2)`` for the curve's ends). This is set to the false alarms allowed per visit over the number of series.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "FALSE_ALARMS",
    "Drift",
    "drifts",
    "fleet_autocorrelation",
    "fleet_scatter",
    "relative",
    "threshold",
]

Array = NDArray[np.float64]
FALSE_ALARMS = 2e-3
"""Allowed false alarms of drift per visit of all robots of a fleet, over all parameters: at most one in 500 visits. With normal scatter there is one
in about 1500, as the bound is conservative and each visit shares evidence with the visits before. With twice the value a drift of 3 % per visit in a
scatter of 10 % is found only a fifth of a visit sooner.
"""
# Smallest number of visits before a ramp, which determine its initial level, and smallest number of visits on the ramp.
_FEWEST_BEFORE, _FEWEST_ON = 3, 3
# Smallest number of robots for a comparison with the fleet's median, which of three robots is the value of one of them.
_FEWEST_ROBOTS = 4
# Share of the evidence for a ramp that has to remain with any one visit left out. A ramp over three visits keeps 0.6 of it without the last; an
# apparent ramp from one outlying visit keeps nothing.
_MIN_REMAINING_EVIDENCE = 0.5
# Relative standard error from which an estimate is left out, as its logarithm is undetermined.
_VAGUE = 0.3
# Degrees of freedom from which the scatter of visits counts as known exactly.
_KNOWN = 1e6
# Largest autocorrelation: beyond it scatter is a random walk, which no test tells from a drift.
_MOST_CORRELATION = 0.9
# Squared change of a logarithm that counts as zero, and accuracy of the fleet's scatter, relative to the largest change between two visits.
_ZERO_SQUARED_CHANGE, _SCATTER_ACCURACY = 1e-30, 1e-6
# Ratio of the standard deviation of normally distributed numbers of mean zero to the median of their absolute values.
_MAD = 1.4826


@dataclass(frozen=True)
class Drift:
    """Drift of one robot's parameter: a steady change from some visit on.

    Attributes
    ----------
    robot : int
        Row of the robot in the table of values.
    onset : int
        Column of the table from which the parameter changes.
    rate : float
        Relative change per visit of the robot, visits without an estimate of the parameter included.
    evidence : float
        Difference of the rate from zero, in its standard deviations.
    threshold : float
        Value of `evidence` from which a rate counts as drift.
    """

    robot: int
    onset: int
    rate: float
    evidence: float
    threshold: float


def drifts(
    values: Array, sigma: Array | None = None, *, visits: Array | None = None, tests: int | None = None
) -> list[Drift]:
    """Return drifts of one parameter: series with a ramp up to their last visit, strongest evidence first.

    Parameters
    ----------
    values : ndarray, shape (n_robots, n_visits)
        One parameter; NaN where it was not estimated. Columns are visits of the same day. Series with values of both signs are left out, and so are
        robots of fewer than six visits.
    sigma : ndarray, shape (n_robots, n_visits), optional
        Standard errors of the values; unknown (NaN) ones count as zero, and so do all by default.
    visits : ndarray, shape (n_robots, n_visits), optional
        Number of each visit among all visits of its robot, with a value of the parameter or without; by default the number of the column.
    tests : int, optional
        Number of series tested, over all parameters; by default the robots of this parameter.
    """
    series, error = relative(values, sigma)
    long = np.count_nonzero(np.isfinite(series), axis=1) >= _FEWEST_BEFORE + _FEWEST_ON
    if not long.any():
        return []
    numbers = _numbers(series, visits)
    scatter, dispersion, freedom = fleet_scatter(series, error, numbers)
    correlation = fleet_autocorrelation(series)
    allowed = FALSE_ALARMS / max(tests or len(series), 1)
    found = []
    for robot in np.flatnonzero(long):
        columns = np.flatnonzero(np.isfinite(series[robot]))
        square = error[robot, columns] ** 2
        before = correlation**2 * np.roll(square, 1)
        before[0] = -(correlation**2) * square[0]  # the first equation is scaled by sqrt(1 - rho^2)
        weight = 1.0 / (dispersion[robot] * (scatter**2 * (1.0 + correlation) + square + before) + _ZERO_SQUARED_CHANGE)
        equations = _Equations(series[robot, columns], numbers[robot, columns], weight, correlation)
        found.append(_drift(equations, columns, int(robot), float(freedom[robot]), allowed))
    return sorted((drift for drift in found if drift is not None), key=lambda drift: -drift.evidence)


def _numbers(series: Array, visits: Array | None) -> Array:
    """Return the numbers of visits, by default those of the columns; shape of `series`."""
    return np.broadcast_to(np.arange(series.shape[1], dtype=np.float64), series.shape) if visits is None else visits


def relative(values: Array, sigma: Array | None = None) -> tuple[Array, Array]:
    """Return logarithms of absolute values, less the robot's own level and the fleet's median of each day, and their standard errors.

    Parameters
    ----------
    values, sigma : ndarray, shape (n_robots, n_visits)
        As for `drifts`.
    """
    values = np.asarray(values, dtype=np.float64)
    error = np.zeros_like(values) if sigma is None else np.nan_to_num(np.abs(np.asarray(sigma, dtype=np.float64)))
    with np.errstate(divide="ignore", invalid="ignore"):
        error = error / np.abs(values)
        known = np.isfinite(values) & (error < _VAGUE) & (values != 0)
        one_sign = ~((known & (values > 0)).any(axis=1) & (known & (values < 0)).any(axis=1))
        series = np.where(known & one_sign[:, None], np.log(np.abs(values)), np.nan)
    series = series - _median(series, axis=1)
    return series - _day(series), np.where(known, error, 0.0)


def _day(series: Array) -> Array:
    """Return the common change of all robots on each day, shape (n_visits,): median, shrunk to zero by its chance part (James and Stein 1961)."""
    robots = np.count_nonzero(np.isfinite(series), axis=0)
    many = robots >= _FEWEST_ROBOTS
    if not many.any():
        return np.zeros(len(robots))
    middle = _median(series, axis=0)[0]
    apart = np.abs(series - middle)[:, many]
    within = (_MAD * float(np.nanmedian(apart))) ** 2
    # Variance of the median of normal numbers: pi/2 that of their mean.
    chance = float(np.mean(0.5 * np.pi * within / robots[many]))
    varies = float(np.mean(middle[many] ** 2))
    share = max(0.0, 1.0 - chance / varies) if varies > 0 else 0.0
    return np.where(many, share * middle, 0.0)


def _median(x: Array, axis: int) -> Array:
    known = np.isfinite(x).any(axis=axis, keepdims=True)
    return np.asarray(np.nanmedian(np.where(known, x, 0.0), axis=axis, keepdims=True))


def fleet_scatter(series: Array, error: Array, visits: Array | None = None) -> tuple[float, Array, Array]:
    """Return the fleet's scatter from visit to visit, each robot's dispersion relative to it, and the dispersions' degrees of freedom.

    Parameters
    ----------
    series, error : ndarray, shape (n_robots, n_visits)
        Logarithms, NaN where unknown, and their standard errors.
    visits : ndarray, shape (n_robots, n_visits), optional
        Numbers of the visits, as for `drifts`.
    """
    numbers = _numbers(series, visits)
    steps = _steps(series, error)
    count = np.count_nonzero(np.isfinite(steps[0]), axis=1)
    each, seen = _freedom(count), count > 0
    if not seen.any():
        return 0.0, np.ones(len(series)), np.full(len(series), _KNOWN)

    def excess(scatter: float) -> float:
        return float(np.median(_dispersions(steps, scatter)[seen] / _median_of_mean_square(each[seen]))) - 1.0

    largest = float(np.sqrt(np.nanmax(steps[0])))
    low, high = 0.0, largest
    while high - low > _SCATTER_ACCURACY * largest:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    raw = _dispersions(steps, high)
    # The prior has at most the degrees of freedom of all robots together.
    agreed = min(_prior_freedom(raw[seen], each[seen]), float(each.sum()))
    prior = np.full(len(series), agreed)
    # Dispersion of each robot less its likeliest ramp, so that a steep drift does not count as scatter.
    beside = _dispersions(_steps(np.array(list(map(_without_ramp, series, numbers))), error), high)[seen]
    free = np.maximum(each[seen] - 2.0, 1.0)
    prior[seen] *= np.minimum(1.0, np.count_nonzero(seen) * _exceedance(beside * each[seen] / free, free, agreed))
    dispersion = np.where(seen, (prior + each * raw) / np.maximum(prior + each, _ZERO_SQUARED_CHANGE), 1.0)
    return high, dispersion, np.minimum(each + prior, each.sum())


def fleet_autocorrelation(series: Array) -> float:
    """Return the first-order autocorrelation of the scatter between visits, 0 where it is within chance.

    ``1 + rho`` is the mean square of differences between visits two apart over that between neighbours, both relative to the robot's own
    scatter; neither depends on the level or, to first order, a drift. In white noise the variance of ``rho`` is ``2/n`` for ``n`` visits, and
    one standard deviation of it counts as chance.

    Parameters
    ----------
    series : ndarray, shape (n_robots, n_visits)
        Logarithms, NaN where unknown.
    """
    rows = [row[np.isfinite(row)] for row in series]
    long = [row for row in rows if len(row) >= _FEWEST_BEFORE + _FEWEST_ON and np.ptp(row) > 0]
    if not long:
        return 0.0
    apart = np.array([[np.mean((row[k:] - row[:-k]) ** 2) for k in (1, 2)] for row in long])
    neighbours, two_apart = np.mean(apart / apart.sum(axis=1, keepdims=True), axis=0)
    chance = np.sqrt(2.0 / sum(len(row) for row in long))
    return float(np.clip(two_apart / neighbours - 1.0 - chance, 0.0, _MOST_CORRELATION))


def _steps(series: Array, error: Array) -> tuple[Array, Array]:
    """Return squared differences between neighbouring known visits, NaN after the last, and their expected part from the estimates' errors."""
    square, errors = np.full(series.shape, np.nan), np.zeros(series.shape)
    for robot, row in enumerate(series):
        known = np.flatnonzero(np.isfinite(row))
        if len(known) > 1:
            square[robot, : len(known) - 1] = np.diff(row[known]) ** 2
            errors[robot, : len(known) - 1] = error[robot, known[1:]] ** 2 + error[robot, known[:-1]] ** 2
    return square, errors


def _dispersions(steps: tuple[Array, Array], scatter: float) -> Array:
    """Return for each robot the mean square difference over its expectation from a scatter and the estimates' errors."""
    square, errors = steps
    share = square / (2.0 * scatter**2 + errors + _ZERO_SQUARED_CHANGE)
    return np.asarray(np.nansum(share, axis=1) / np.maximum(np.count_nonzero(np.isfinite(square), axis=1), 1))


def _freedom(steps: NDArray[np.int64]) -> Array:
    """Return the degrees of freedom of the mean square successive difference of ``steps + 1`` values (von Neumann et al. 1941: 2 (n-1)^2/(3n-4))."""
    return np.asarray(2.0 * steps**2 / np.maximum(3.0 * steps - 1.0, 1.0))


def _median_of_mean_square(freedom: Array) -> Array:
    """Return the median of a chi-squared variable over its degrees of freedom (Wilson and Hilferty 1931)."""
    return np.asarray((1.0 - 2.0 / (9.0 * freedom)) ** 3)


def _prior_freedom(dispersion: Array, freedom: Array) -> float:
    """Return the degrees of freedom of the fleet's scatter as prior for a robot's own scatter (Smyth 2004).

    These degrees of freedom `d0` follow from the variance of the robots' log dispersions beyond chance and one standard error, estimated robustly:
    ``var log s^2 = psi'(d/2) + psi'(d0/2)``, with ``psi'(x) = 1/x + 1/(2 x^2) + 1/(6 x^3)`` and its inverse ``1/2 + 1/y``.
    """
    if len(dispersion) < _FEWEST_ROBOTS:
        return _KNOWN
    logs = np.log(np.maximum(dispersion, _ZERO_SQUARED_CHANGE))
    half = freedom / 2.0
    chance = float(np.median(1.0 / half + 1.0 / (2.0 * half**2) + 1.0 / (6.0 * half**3)))
    spread = (_MAD * float(np.median(np.abs(logs - np.median(logs))))) ** 2
    # Relative standard error of a squared median of absolute values, of a normal sample (Huber 1981, section 5.1).
    beyond = spread - chance * (1.0 + 2.33 / np.sqrt(len(logs)))
    return 1.0 + 2.0 / beyond if beyond > 2.0 / _KNOWN else _KNOWN


def _without_ramp(row: Array, visits: Array) -> Array:
    """Return logarithms of one robot less the level and ramp that fit them best by least squares over all onsets; NaN where unknown."""
    known = np.flatnonzero(np.isfinite(row))
    rest = row.copy()
    if len(known) < _FEWEST_BEFORE + _FEWEST_ON:
        return rest
    equations = _Equations(row[known], visits[known], np.ones(len(known)), 0.0)
    ramps = equations.beside(equations.ramps(), equations.level())
    level = equations.row - np.mean(equations.row)
    slope = ramps @ level / np.sum(ramps**2, axis=1)
    best = int(np.argmax(np.abs(slope) * np.linalg.norm(ramps, axis=1)))
    rest[known] = level - slope[best] * ramps[best]
    return rest


def _exceedance(ratio: Array, freedom: Array, prior: float) -> Array:
    """Return the probability that a ratio of mean squares with given degrees of freedom is at least `ratio` (Paulson 1942), shape of `ratio`."""
    a, b, root = 2.0 / (9.0 * freedom), 2.0 / (9.0 * prior), np.cbrt(ratio)
    normal = ((1.0 - b) * root - (1.0 - a)) / np.sqrt(a + b * root**2)
    return np.array([0.5 * math.erfc(x / math.sqrt(2.0)) for x in normal])


def threshold(allowed: float, length: float, freedom: float) -> float:
    """Return the threshold in standard deviations that the largest statistic of noise exceeds with a probability of at most `allowed`.

    Parameters
    ----------
    allowed : float
        Probability, above 0 and below 1.
    length : float
        Length of the curve of normed ramps on the sphere [rad].
    freedom : float
        Degrees of freedom of the estimated scatter.
    """
    return float(np.sqrt(freedom * np.expm1(2.0 / freedom * np.log((1.0 + length / np.pi) / allowed))))


@dataclass(frozen=True)
class _Equations:
    """Regression of a series on a level and a ramp from each onset, whitened: one equation per visit.

    Attributes
    ----------
    row, visits, weight : ndarray, shape (n_visits,)
        Logarithms of one robot's parameter by visit, numbers of these visits, and the inverse variance of each equation.
    correlation : float
        First-order autocorrelation of deviations from visit to visit.
    """

    row: Array
    visits: Array
    weight: Array
    correlation: float

    def whitened(self, x: Array) -> Array:
        """Return columns with their autocorrelation from visit to visit removed (Prais and Winsten 1954)."""
        white = x.astype(np.float64)
        white[..., 1:] -= self.correlation * x[..., :-1]
        white[..., 0] *= np.sqrt(1.0 - self.correlation**2)
        return white

    def ramps(self) -> Array:
        """Return ramps of slope 1 per visit from every onset, shape (n_onsets, n_visits)."""
        onsets = np.arange(_FEWEST_BEFORE, len(self.row) - _FEWEST_ON + 1)
        return self.whitened(np.maximum(self.visits - self.visits[onsets, None] + 1.0, 0.0))

    def beside(self, x: Array, y: Array) -> Array:
        """Return rows of `x` less their weighted projection on the rows of `y`, shapes (n, n_visits) or (n_visits,)."""
        part = np.sum(x * self.weight * y, axis=-1) / np.sum(self.weight * y**2, axis=-1)
        return np.asarray(x - part[..., None] * y)

    def level(self) -> Array:
        """Return the whitened column of the unknown level, shape (n_visits,)."""
        return self.whitened(np.ones(len(self.row)))

    def slopes(self) -> tuple[Array, Array, float]:
        """Return slopes for all onsets, their standard deviations, and the length of the curve of normed ramps [rad]."""
        ramps = self.beside(self.ramps(), self.level())
        square = (ramps**2) @ self.weight
        normed = ramps * np.sqrt(self.weight) / np.sqrt(square)[:, None]
        turned = np.arccos(np.clip(np.sum(normed[1:] * normed[:-1], axis=1), -1.0, 1.0))
        return (ramps * self.weight) @ self.whitened(self.row) / square, 1.0 / np.sqrt(square), float(turned.sum())

    def without_one(self, onset: int) -> float:
        """Return the least evidence, in standard deviations, for a ramp with any one visit left out by a parameter of its own."""
        visit = self.whitened(np.eye(len(self.row)))
        ramps = self.beside(self.beside(self.ramps()[onset], visit), self.beside(self.level(), visit))
        part, square = (ramps * self.weight) @ self.whitened(self.row), (ramps**2) @ self.weight
        return float(np.min(np.sign(part.sum()) * part / np.sqrt(square)))


def _drift(
    equations: _Equations, columns: NDArray[np.intp], robot: int, freedom: float, allowed: float
) -> Drift | None:
    slopes, deviations, length = equations.slopes()
    evidence = np.abs(slopes) / deviations
    best = int(np.argmax(evidence))
    needed = threshold(allowed, length, freedom)
    if evidence[best] <= needed or equations.without_one(best) < _MIN_REMAINING_EVIDENCE * evidence[best]:
        return None
    onset = int(columns[best + _FEWEST_BEFORE])
    return Drift(robot, onset, float(np.expm1(slopes[best])), float(evidence[best]), needed)
