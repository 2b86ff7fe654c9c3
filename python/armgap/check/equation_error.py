"""Equation error of the rigid arm model: torque that remains unexplained by parameters within bounds around the arm file.

The filtered dynamic model of Reyes and Kelly (1997, equations 23 and 24) gives rows ``psi theta = y`` without accelerations. The rows are
solved by least squares with bounds: inertias and weights keep the sign and the order of magnitude of the arm file, friction stays
positive. So a wrong reading of a log cannot be explained by an impossible arm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from armgap import _native
from armgap.arm.arm import Arm
from armgap.log.log import Log

__all__ = ["CUTOFF", "FEWEST_ROWS", "EquationError", "Fit", "Mask", "Rows", "bounds", "position_noise"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Cut-off of the filters [rad/s]: above the motion of arms (a few hertz), below the noise of encoders; at 2.5 ms it is 0.075 of the sample rate.
CUTOFF = 30.0
# A joint stands still where its speed, over so many seconds and samples at least, is below this part of its RMS; a row counts as moving where
# standstill makes less than this part of what the filters remember.
_SPEED_S, _SPEED_SAMPLES, _STANDSTILL, _REMEMBERED = 0.01, 3, 0.05, 0.05
# Rows that parameters are estimated from, at least.
FEWEST_ROWS = 100
# Largest cut-off of the filters, in parts of the sample rate; it bounds the cut-off for slowly sampled logs.
_LARGEST_CUTOFF = 0.5
# Time constants of the filters that pass before a row is used, after the start and after a hole in the samples.
_SETTLING = 4.0
# Length of a hole in the samples, in sample periods, beyond which the filters start anew.
_HOLE_PERIODS = 3.0
# Factor by which inertias and gravity parameters may differ from the arm file. Arm files off by three are re-estimated; ten is another unit.
_TRUST_FACTOR = 5.0
# Largest number of samples used of one log: 16 s at 4 ms; more samples tell nothing new about a sign.
_LARGEST_LOG = 4000
# Length of log on either side of a stretch that the stretch is compared with [s]: a few periods of the slowest informative motions.
_BESIDE_S = 8.0
# Share of a joint's torque below which a residual counts as explained: unmodelled effects leave as much in sound logs of real arms.
_EXPLAINED_RESIDUAL_SHARE = 0.02
# Share of a joint's torque below which a residual counts as zero.
_ZERO_RESIDUAL_SHARE = 1e-5


def position_noise(log: Log) -> Array:
    """Return the standard deviation of white noise on each joint's positions [rad or m], from their third differences.

    These differences hold little of the motion, and twenty times the variance of white noise.
    """
    return np.asarray(np.sqrt(np.mean(np.diff(log.q, 3, axis=0) ** 2, axis=0) / math.comb(6, 3)), dtype=np.float64)


@dataclass(frozen=True)
class Rows:
    """Rows of the filtered dynamic model of one log.

    Attributes
    ----------
    psi : ndarray, shape (n_rows, n_joints, n_parameters)
        Filtered regressor [SI].
    y : ndarray, shape (n_rows, n_joints)
        Filtered torques [N m or N].
    samples : ndarray, shape (n_rows,)
        Sample index in the log of each row.
    cutoff : float
        Cut-off of the filters [rad/s].
    """

    psi: Array
    y: Array
    samples: NDArray[np.intp]
    cutoff: float

    @classmethod
    def of(cls, log: Log, arm: Arm, cutoff: float = CUTOFF, around: tuple[int, int] | None = None) -> Rows:
        """Return the rows of a log; of a long log only those of a stretch in its middle, or of the samples `around` and some seconds on either side.

        `cutoff` is the cut-off of the filters [rad/s].
        """
        part = _part(log, around)
        t, q, tau = (np.ascontiguousarray(x[part]) for x in (log.t, log.q, log.tau))
        steps = np.diff(t)
        period = float(np.median(steps))
        cutoff = min(cutoff, _LARGEST_CUTOFF / period)
        psi, y = _native.regression_rows(arm.to_native(), t, q, tau, cutoff)
        settled = _settled(t, _HOLE_PERIODS * period, _SETTLING / cutoff)
        settled &= np.isfinite(y).all(axis=1)
        rows = np.flatnonzero(settled)
        return cls(_taken(psi, rows), _taken(y, rows), rows + part.start, cutoff)

    def read_as(self, log: Log, arm: Arm) -> Rows:
        """Return the rows, made by `Rows.of` without `around`, of another reading `log` of their log, at the same samples and times."""
        part = _part(log, None)
        t, q, tau = (np.ascontiguousarray(x[part]) for x in (log.t, log.q, log.tau))
        psi, y = _native.regression_rows(arm.to_native(), t, q, tau, self.cutoff)
        rows = self.samples - part.start
        return replace(self, psi=_taken(psi, rows), y=_taken(y, rows))

    def moving(self, log: Log) -> Mask:
        """Return a mask of the rows of a log and the joints that have been moving for as long as the filters remember, shape (n_rows, n_joints).

        The friction of a joint at rest is any torque up to its break-away torque and not that of the equation of motion. Rows that remember a
        standstill moved estimates of time shifts by up to 8 samples, and left half of the torque unexplained of a joint that stuck most of the time.
        """
        if not len(self.samples):
            return np.zeros(self.y.shape, dtype=bool)
        first, last = int(self.samples[0]), int(self.samples[-1])
        t, q = log.t[first : last + 1], log.q[first : last + 1]
        period = log.sample_period
        width = max(_SPEED_SAMPLES, round(_SPEED_S / period)) | 1
        speed = np.abs(np.gradient(_running_mean(q, width), t, axis=0))
        slow = speed < _STANDSTILL * np.sqrt(np.mean(speed**2, axis=0))
        memory = _low_passed(slow.astype(float), math.exp(-self.cutoff * period))
        moving: Mask = memory[self.samples - first] < _REMEMBERED
        return moving

    def at(self, part: slice | Mask) -> Rows:
        """Return a part of the rows, by a slice or a mask."""
        return replace(self, psi=self.psi[part], y=self.y[part], samples=self.samples[part])

    def within(self, mask: Mask) -> Rows:
        """Return the rows with those of joints outside of a mask (`moving`) as zeros, which count for nothing."""
        return replace(self, psi=self.psi * mask[:, :, None], y=self.y * mask)

    def with_torque(self, log: Log, joint: int, torque: Array) -> Rows:
        """Return the rows of a log (`Rows.of` without `around`) with other torques of one joint (from 0), given at all samples [N m or N]."""
        part = _part(log, None)
        t, tau = (np.ascontiguousarray(x[part]) for x in (log.t, torque))
        y = self.y.copy()
        y[:, joint] = _taken(_native.filtered_torques(t, tau, self.cutoff), self.samples - part.start)
        return replace(self, y=y)


def _taken(x: Array, rows: NDArray[np.intp]) -> Array:
    """Return some rows of an array, ascending; a view where they follow each other without a hole."""
    if len(rows) and rows[-1] - rows[0] == len(rows) - 1:
        return x[rows[0] : rows[-1] + 1]
    return x[rows]


def _low_passed(x: Array, forget: float) -> Array:
    """Return each column through a first-order low-pass filter with the pole `forget`, from rest."""
    from_rest = np.vstack([np.zeros(x.shape[1]), x])
    columns = [pl.Series(column).ewm_mean(alpha=1.0 - forget, adjust=False).to_numpy()[1:] for column in from_rest.T]
    return np.column_stack(columns)


def _running_mean(q: Array, width: int) -> Array:
    """Return the mean of each column over windows of `width` samples, an odd number; the first and last windows are filled with end values."""
    padded = np.pad(q, ((width // 2, width // 2), (0, 0)), mode="edge")
    total = np.cumsum(np.vstack([np.zeros(q.shape[1]), padded]), axis=0)
    mean: Array = (total[width:] - total[:-width]) / width
    return mean


def _part(log: Log, around: tuple[int, int] | None) -> slice:
    """Return the part of a log that rows are made from: its middle, or the samples `around` and some seconds on either side."""
    begin, end = around or ((len(log) - _LARGEST_LOG) // 2, (len(log) + _LARGEST_LOG) // 2)
    beside = max(round(_BESIDE_S / float(np.median(np.diff(log.t)))), end - begin) if around else 0
    return slice(max(0, begin - beside), end + beside + 1)


def _settled(t: Array, hole: float, wait: float) -> NDArray[np.bool_]:
    """Return a mask of the samples at least `wait` [s] after the start and after every hole longer than `hole` [s]."""
    begins = np.concatenate([[True], np.diff(t) > hole])
    since = np.maximum.accumulate(np.where(begins, np.arange(len(t)), 0))
    settled: NDArray[np.bool_] = t - t[since] > wait
    return settled


@dataclass(frozen=True)
class Fit:
    """Result of bounded least squares over the rows of the equation of motion of some logs.

    Attributes
    ----------
    theta : ndarray, shape (n_parameters,)
        Estimated parameters [SI].
    share : ndarray, shape (n_joints,)
        Mean square of each joint's residual, relative to that of its torque or of the largest term of its equation of motion, whichever is
        larger; of `EquationError.with_factors`, `with_load` and `of_torques` relative to that of the torque in any case.
    """

    theta: Array
    share: Array

    @property
    def cost(self) -> float:
        """Mean over the joints of the logarithm of the unexplained share, which is bounded from below."""
        return float(np.mean(np.log(self.share + _EXPLAINED_RESIDUAL_SHARE)))

    @property
    def closeness(self) -> float:
        """Mean over the joints of the logarithm of the unexplained share without lower bound, for readings that all explain nearly everything."""
        return float(np.mean(np.log(self.share + _ZERO_RESIDUAL_SHARE)))


class EquationError:
    """Normal equations of several logs, joint by joint, and their solution by bounded least squares.

    Unexplained torques are relative to `scale`, or else to the torque and the largest term of the equation of motion (`terms`), whichever is larger:
    mean squares per joint, shape (n_joints,). Another reading of a log takes `scale` from the log as it stands, so that the readings are comparable;
    torques that a drive delivers (`with_rows`) are measured against themselves and the terms of the log as it stands.
    """

    def __init__(self, rows: Sequence[Rows], arm: Arm, scale: Array | None = None, terms: Array | None = None) -> None:
        self.arm = arm
        self.rows = tuple(rows)
        self.count = sum(len(r.y) for r in rows)
        self.gram = sum((_by_joint(r.psi, r.psi) for r in rows), 0.0) / max(self.count, 1)
        self.moment, self.square = self._moments([r.y for r in rows])
        self.terms = self._terms() if terms is None else terms
        self.scale: Array = np.maximum(np.maximum(self.square, self.terms), 1e-30) if scale is None else scale

    def _moments(self, torques: Sequence[Array]) -> tuple[Array, Array]:
        """Return per joint the products of the regressor with the torques, and the mean squares of the torques."""
        pairs = list(zip(self.rows, torques, strict=True))
        moment = sum((_by_joint(r.psi, y) for r, y in pairs), 0.0) / max(self.count, 1)
        square = sum(np.sum(y**2, axis=0) for y in torques) / max(self.count, 1)
        return np.asarray(moment), np.asarray(square)

    def _terms(self) -> Array:
        """Mean square per joint of the largest term of the equation of motion with the arm file's parameters.

        Inertia and weight cancel near a resonance, where the torque alone would be a small measure.
        """
        terms: Array = (np.diagonal(self.gram, axis1=1, axis2=2) * self.arm.theta**2).max(axis=1)
        return terms

    def fit(self, low: Array, high: Array, torques: Sequence[Array] | None = None) -> Fit:
        """Return the bounded least-squares fit, parameters between `low` and `high`, to the logs' torques or to `torques` in their place."""
        moment, square = (self.moment, self.square) if torques is None else self._moments(torques)
        return self._solve(low, high, moment, square, self.scale)

    def with_factors(self, low: Array, high: Array, factors: Array) -> Fit:
        """Return the fit to torques times a factor per joint; unexplained shares are relative to the scaled torques, whatever their unit."""
        square = self.square * factors**2
        return self._solve(low, high, self.moment * factors[:, None], square, np.maximum(square, 1e-30))

    def with_load(self, low: Array, high: Array, change: Array) -> Fit:
        """Return the fit with any positive multiple of `change` added to parameters between `low` and `high`; shares as of `with_factors`."""
        scale = np.maximum(self.square, 1e-30)
        parts = np.column_stack([np.eye(len(change)), change])
        gram = parts.T @ np.einsum("jil,j->il", self.gram, 1.0 / scale) @ parts
        right = parts.T @ (self.moment / scale[:, None]).sum(axis=0)
        theta = parts @ _native.bounded_least_squares(gram, right, np.append(low, 0.0), np.append(high, np.inf))
        return Fit(theta, self._left(theta, self.moment, self.square) / scale)

    def of_torques(self, fit: Fit) -> Fit:
        """Return the fit with its unexplained shares relative to the torques alone, not to the largest term of the equation of motion."""
        return replace(fit, share=fit.share * self.scale / np.maximum(self.square, 1e-30))

    def _solve(self, low: Array, high: Array, moment: Array, square: Array, scale: Array) -> Fit:
        gram = np.einsum("jil,j->il", self.gram, 1.0 / scale)
        theta = _native.bounded_least_squares(gram, (moment / scale[:, None]).sum(axis=0), low, high)
        return Fit(theta, self._left(theta, moment, square) / scale)

    def _left(self, theta: Array, moment: Array, square: Array) -> Array:
        """Return per joint the mean square of the torque that parameters leave unexplained."""
        left = square - 2.0 * moment @ theta + np.einsum("i,jil,l->j", theta, self.gram, theta)
        return np.asarray(np.maximum(left, 0.0))

    def with_rows(self, rows: Sequence[Rows], joint: int) -> EquationError:
        """Return the equation error of rows that differ in the torques of one joint (from 0) alone."""
        other = copy(self)
        other.rows = tuple(rows)
        other.moment, other.square = self.moment.copy(), self.square.copy()
        other.moment[joint] = sum(r.y[:, joint] @ r.psi[:, joint] for r in rows) / max(self.count, 1)
        other.square[joint] = sum(r.y[:, joint] @ r.y[:, joint] for r in rows) / max(self.count, 1)
        other.scale = np.maximum(np.maximum(other.square, other.terms), 1e-30)
        return other

    def noise_square(self, logs: Sequence[Log]) -> Array:
        """Return per joint the mean square of the torque that noise of the positions leaves unexplained, by the arm file's parameters.

        The noise is that of the `logs` from which the rows were made (`position_noise`). The torque is the change of the rows when as much noise is
        added to the positions.
        """
        rng = np.random.default_rng(0)
        left = np.zeros(len(self.scale))
        for log, rows in zip(logs, self.rows, strict=True):
            noisy = Rows.of(replace(log, q=log.q + position_noise(log) * rng.standard_normal(log.q.shape)), self.arm)
            left += np.sum(((noisy.psi - rows.psi) @ self.arm.theta) ** 2, axis=0)
        return left / max(self.count, 1)

    def expected(self) -> Array:
        """Return per joint the least-squares factor from the logged torques to the torques by the arm file's parameters."""
        return (self.moment @ self.arm.theta) / np.maximum(self.square, 1e-30)

    def size_of(self, theta: Array) -> Array:
        """Return per joint the least-squares factor from the torques by `theta` to the torques by the arm file's parameters, without friction.

        An arm file knows inertias and weights far better than friction.
        """
        of_file, theta = (np.where(np.arange(len(x)) < self.arm.n_inertial, x, 0.0) for x in (self.arm.theta, theta))
        squares = np.einsum("i,jil,l->j", theta, self.gram, theta)
        size: Array = np.einsum("i,jil,l->j", of_file, self.gram, theta) / np.maximum(squares, 1e-30)
        return size

    def __len__(self) -> int:
        return self.count


def bounds(arm: Arm, factor: float = _TRUST_FACTOR) -> tuple[Array, Array]:
    """Return the smallest and largest possible parameters of an arm whose file is right about signs and orders of magnitude."""
    low, high = np.zeros(len(arm.theta)), np.full(len(arm.theta), np.inf)
    for i, value in enumerate(arm.theta[: arm.n_inertial]):
        if value == 0:
            low[i], high[i] = -np.inf, np.inf
        else:
            low[i], high[i] = sorted((value / factor, value * factor))
    return low, high


def _by_joint(psi: Array, x: Array) -> Array:
    """Return per joint the product of the transposed regressor with `x`, shape (n_rows, n_joints) or (n_rows, n_joints, n_columns)."""
    return np.stack([psi[:, j].T @ x[:, j] for j in range(psi.shape[1])])
