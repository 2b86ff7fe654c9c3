"""Equation error of the arm's own model: the torque that its parameters leave unexplained, within the values an arm file may mean.

The filtered dynamic model of Reyes and Kelly (1997, equations 23 and 24) gives rows ``psi theta = y`` without accelerations. Here they are
solved by least squares with bounds: inertias and weights keep the sign and the order of magnitude of the arm file, friction stays
positive. So a log that is read the wrong way cannot be explained by an arm that nobody has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm.arm import Arm
from armgap.log.log import Log

__all__ = ["CUTOFF", "EquationError", "Fit", "Rows", "bounds"]

Array = NDArray[np.float64]

# Cut-off of the filters [rad/s]: above the motion of arms (a few hertz), below what encoders add; at 2.5 ms it is 0.075 of the sample rate.
CUTOFF = 30.0
# The cut-off at most, in parts of the sample rate, where logs are slow.
_LARGEST_CUTOFF = 0.5
# Time constants of the filters that pass before a row counts, after the start and after a hole in the samples.
_SETTLING = 4.0
# A hole is longer than this many periods.
_HOLE = 3.0
# Inertias and weights may differ from the arm file by this factor. Arm files off by three are re-estimated; ten is another unit.
_TRUST_FACTOR = 5.0
# Samples of one log that are used: 16 s at 4 ms; more tells nothing new about a sign.
_LARGEST_LOG = 4000
# Length of log on either side of a stretch that the stretch is compared with [s]: a few periods of the slowest motions that tell anything.
_BESIDE_S = 8.0
# Share of a joint's torque below which a residual counts as explained: what unmodelled effects leave of healthy logs of real arms.
_EXPLAINED = 0.02
# Share of a joint's torque that nothing tells from none.
_EXACT = 1e-5
# A bound is left if that lowers the cost by more than this part of the largest moment.
_SETTLED = 1e-9
# Rounds of the active set method per parameter at most, and what keeps columns that a log does not excite solvable.
_MOST_ROUNDS = 6
_RIDGE = 1e-10


@dataclass(frozen=True)
class Rows:
    """Rows of the filtered dynamic model of one log.

    Attributes
    ----------
    psi : ndarray, shape (n_rows, n_joints, n_parameters)
        Regressor.
    y : ndarray, shape (n_rows, n_joints)
        Filtered torques [N m or N].
    samples : ndarray, shape (n_rows,)
        The log's sample of each row.
    """

    psi: Array
    y: Array
    samples: NDArray[np.intp]

    @classmethod
    def of(cls, log: Log, arm: Arm, cutoff: float = CUTOFF, around: tuple[int, int] | None = None) -> Rows:
        """Return the rows of a log; of a long one those of a stretch from its middle, or of the samples `around` and some seconds beside them.

        `cutoff` is that of the filters [rad/s].
        """
        begin, end = around or ((len(log) - _LARGEST_LOG) // 2, (len(log) + _LARGEST_LOG) // 2)
        beside = max(round(_BESIDE_S / float(np.median(np.diff(log.t)))), end - begin) if around else 0
        first = max(0, begin - beside)
        part = slice(first, end + beside + 1)
        t, q, tau = (np.ascontiguousarray(x[part]) for x in (log.t, log.q, log.tau))
        steps = np.diff(t)
        period = float(np.median(steps))
        cutoff = min(cutoff, _LARGEST_CUTOFF / period)
        psi, y = _native.regression_rows(arm.to_native(), t, q, tau, cutoff)
        settled = _settled(t, _HOLE * period, _SETTLING / cutoff)
        settled &= np.isfinite(y).all(axis=1)
        rows = np.flatnonzero(settled)
        return cls(psi[rows], y[rows], rows + first)


def _settled(t: Array, hole: float, wait: float) -> NDArray[np.bool_]:
    """Return which samples lie long enough after the start and after every hole."""
    begins = np.concatenate([[True], np.diff(t) > hole])
    since = np.maximum.accumulate(np.where(begins, np.arange(len(t)), 0))
    settled: NDArray[np.bool_] = t - t[since] > wait
    return settled


@dataclass(frozen=True)
class Fit:
    """Bounded least squares over the rows of some logs.

    Attributes
    ----------
    theta : ndarray, shape (n_parameters,)
        Parameters.
    share : ndarray, shape (n_joints,)
        Mean square of the residual over that of the joint's torque.
    """

    theta: Array
    share: Array

    @property
    def cost(self) -> float:
        """Mean over the joints of the logarithm of the unexplained share."""
        return float(np.mean(np.log(self.share + _EXPLAINED)))

    @property
    def closeness(self) -> float:
        """Mean over the joints of the logarithm of the unexplained share itself, for readings that all explain nearly everything."""
        return float(np.mean(np.log(self.share + _EXACT)))


class EquationError:
    """Normal equations of several logs, joint by joint, and what bounded parameters leave of their torques."""

    def __init__(self, rows: Sequence[Rows], arm: Arm, scale: Array | None = None) -> None:
        self.arm = arm
        self.rows = tuple(rows)
        self.count = sum(len(r.y) for r in rows)
        self.gram = sum(np.einsum("kji,kjl->jil", r.psi, r.psi, optimize=True) for r in rows) / max(self.count, 1)
        self.moment, self.square = self._moments([r.y for r in rows])
        self.scale = self._scale() if scale is None else scale

    def _moments(self, torques: Sequence[Array]) -> tuple[Array, Array]:
        """Return the products of the regressor with torques, and of torques with themselves, per joint."""
        pairs = list(zip(self.rows, torques, strict=True))
        moment = sum(np.einsum("kji,kj->ji", r.psi, y) for r, y in pairs) / max(self.count, 1)
        square = sum(np.sum(y**2, axis=0) for y in torques) / max(self.count, 1)
        return np.asarray(moment), np.asarray(square)

    def _scale(self) -> Array:
        """Mean square per joint of the torque, or of the largest term of the equation of motion as the arm file has it.

        Inertia and weight cancel near a resonance, where the torque alone would be a small measure.
        """
        terms = (np.diagonal(self.gram, axis1=1, axis2=2) * self.arm.theta**2).max(axis=1)
        scale: Array = np.maximum(np.maximum(self.square, terms), 1e-30)
        return scale

    def fit(self, low: Array, high: Array, torques: Sequence[Array] | None = None) -> Fit:
        """Return the parameters between `low` and `high` that explain the torques, or others in their place, best."""
        moment, square = (self.moment, self.square) if torques is None else self._moments(torques)
        return self._solve(low, high, moment, square, self.scale)

    def with_factors(self, low: Array, high: Array, factors: Array) -> Fit:
        """Return the fit to torques times a factor per joint; shares are of the torques, whatever their unit."""
        square = self.square * factors**2
        return self._solve(low, high, self.moment * factors[:, None], square, np.maximum(square, 1e-30))

    def of_torques(self, fit: Fit) -> Fit:
        """Return the same fit, its errors relative to the torques alone."""
        return replace(fit, share=fit.share * self.scale / np.maximum(self.square, 1e-30))

    def _solve(self, low: Array, high: Array, moment: Array, square: Array, scale: Array) -> Fit:
        gram = np.einsum("jil,j->il", self.gram, 1.0 / scale)
        size = np.sqrt(np.diag(gram))
        size[size == 0] = 1.0
        theta = (
            _bounded(gram / np.outer(size, size), (moment / scale[:, None]).sum(axis=0) / size, low * size, high * size)
            / size
        )
        left = square - 2.0 * moment @ theta + np.einsum("i,jil,l->j", theta, self.gram, theta)
        return Fit(theta, np.maximum(left, 0.0) / scale)

    def expected(self) -> Array:
        """Return per joint the factor that makes the arm file's own torques of the logged ones, by least squares."""
        return (self.moment @ self.arm.theta) / np.maximum(self.square, 1e-30)

    def size_of(self, theta: Array) -> Array:
        """Return per joint the factor that makes the arm file's torques of those of `theta`, by least squares, friction left aside.

        An arm file knows inertias and weights far better than friction.
        """
        of_file, theta = (np.where(np.arange(len(x)) < self.arm.n_inertial, x, 0.0) for x in (self.arm.theta, theta))
        squares = np.einsum("i,jil,l->j", theta, self.gram, theta)
        size: Array = np.einsum("i,jil,l->j", of_file, self.gram, theta) / np.maximum(squares, 1e-30)
        return size

    def __len__(self) -> int:
        return self.count


def bounds(arm: Arm, factor: float = _TRUST_FACTOR) -> tuple[Array, Array]:
    """Return the least and largest values that an arm may have whose file is right about signs and orders of magnitude."""
    low, high = np.zeros(len(arm.theta)), np.full(len(arm.theta), np.inf)
    for i, value in enumerate(arm.theta[: arm.n_inertial]):
        if value == 0:
            low[i], high[i] = -np.inf, np.inf
        else:
            low[i], high[i] = sorted((value / factor, value * factor))
    return low, high


def _bounded(gram: Array, moment: Array, low: Array, high: Array) -> Array:
    """Minimise ``x' gram x / 2 - moment' x`` between bounds by active sets (Stark and Parker 1995); `gram` has a diagonal of one or zero."""
    gram = gram + _RIDGE * np.eye(len(moment))
    x = np.clip(np.zeros(len(moment)), low, high)
    free = np.ones(len(moment), dtype=bool)
    for _ in range(_MOST_ROUNDS * len(moment)):
        target = x.copy()
        held = ~free
        target[free] = np.linalg.solve(gram[np.ix_(free, free)], moment[free] - gram[np.ix_(free, held)] @ x[held])
        step, blocked = _step_within(x, target, low, high, free)
        x = x + step * (target - x)
        if blocked is not None:
            x[blocked] = low[blocked] if target[blocked] < low[blocked] else high[blocked]
            free[blocked] = False
            continue
        slope = gram @ x - moment
        # A bound is left where the cost falls towards the inside.
        inward = np.where(free, 0.0, np.where(x <= low, -slope, slope))
        best = int(np.argmax(inward))
        if inward[best] <= _SETTLED * max(float(np.abs(moment).max()), 1e-30):
            break
        free[best] = True
    return x


def _step_within(x: Array, target: Array, low: Array, high: Array, free: NDArray[np.bool_]) -> tuple[float, int | None]:
    """Return how far towards `target` the bounds allow, up to 1, and which bound stops it."""
    step, blocked = 1.0, None
    for i in np.flatnonzero(free & ((target < low) | (target > high))):
        bound = low[i] if target[i] < low[i] else high[i]
        part = (bound - x[i]) / (target[i] - x[i])
        if part < step:
            step, blocked = max(part, 0.0), int(i)
    return step, blocked
