"""Weak form of the equation of motion of a serial arm: regression of torques on the arm's parameters.

Raised cosines are the test functions: momentum takes the place of accelerations. Parameters are estimated with the arm file's standard deviations
as prior, friction and rotor inertias not negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.log.log import Log

__all__ = ["Fit", "LogRows", "Rows", "fit", "rows_of", "taps_of", "torques_averaged"]

Array = NDArray[np.float64]

# Half width of a test function [s], and at least so many sample periods.
_HALF_WIDTH_S = 0.05
_FEWEST_PERIODS = 5
# Largest number of sample intervals in the regression, all logs together: some ten seconds of a robot's log tell a sign.
MOST_INTERVALS = 4000
# Number of rows that count as one independent row: neighbouring test functions overlap, and residuals are correlated over some tenths of a second.
_CORRELATED = 12.0
# Speed, relative to a joint's RMS speed, below which the joint counts as at rest; part of a row's intervals that it may be so slow in, as where it
# reverses.
_AT_REST, _SLOW_PART = 0.01, 0.2
# Iterations in which the weights of the joints are set from their residuals.
_WEIGHT_ITERATIONS = 4


@dataclass(frozen=True)
class Fit:
    """Result of a regression of torques on the arm's parameters.

    Attributes
    ----------
    cost : float
        Twice the negative log-likelihood up to a constant, plus the squared distance from the arm file.
    theta : ndarray, shape (13 n_joints,)
        Estimated parameters.
    share : ndarray, shape (n_joints,)
        Part of each joint's mean square torque that stays unexplained.
    distance : float
        Squared distance of the parameters from the arm file in its standard deviations.
    count : float
        Effective number of independent rows per joint; neighbouring rows are correlated.
    """

    cost: float
    theta: Array
    share: Array
    distance: float
    count: float


@dataclass(frozen=True)
class LogRows:
    """Rows of the weak form from one log: one row per test function.

    Attributes
    ----------
    y : ndarray, shape (n_rows, n_joints)
        Torques [N m or N].
    psi : ndarray, shape (n_rows, n_joints, 13 n_joints)
        Regressor of the torques on the parameters: ten per link, then rotor inertias, viscous and Coulomb friction.
    first, last : ndarray, shape (n_rows,)
        First and last sample of the log that a row depends on.
    moves : ndarray of bool, shape (n_rows, n_joints)
        Whether each joint moves for nearly all of a row: the dry friction of a joint at rest is unknown.
    """

    y: Array
    psi: Array
    first: NDArray[np.int64]
    last: NDArray[np.int64]
    moves: NDArray[np.bool_]

    @classmethod
    def of(cls, log: Log, arm: Arm, begin: int, end: int) -> LogRows | None:
        """Return the rows of samples `begin` up to `end`, without `end`; None where these are too few for a test function."""
        assert arm.chain is not None
        period = float(np.median(np.diff(log.t)))
        taps = taps_of(log)
        count = end - begin - 1
        if count < 4 * taps:
            return None
        part = slice(begin, begin + count)
        chain = arm.chain.native()
        h = np.diff(log.t)[part, None]
        q = 0.5 * (log.q[:-1] + log.q[1:])[part]
        mean_dq = np.diff(log.q, axis=0)[part] / h
        dq = _smoothed(mean_dq, taps // 2)
        n = q.shape[1]
        edge = np.arange(2 * taps + 1) / taps - 1.0
        weight = np.diff(_area(taps))
        rise = np.diff(0.5 * (1.0 + np.cos(np.pi * edge))) / (taps * period)
        starts = np.arange(0, count - 2 * taps, max(taps // 2, 1))
        momentum = np.zeros((count, n, 13 * n))
        rest = np.zeros_like(momentum)
        q, mean_dq, dq = (np.ascontiguousarray(x) for x in (q, mean_dq, dq))
        momentum[:, :, : 10 * n] = chain.momentum_regressor(q, mean_dq)
        rest[:, :, : 10 * n] = chain.potential_regressor(q, dq)
        joints = np.arange(n)
        momentum[:, joints, 10 * n + joints] = mean_dq
        rest[:, joints, 11 * n + joints] = dq
        rest[:, joints, 12 * n + joints] = np.sign(dq)
        torque = torques_averaged(_torques(log, arm), begin + starts, taps)
        psi = np.zeros((len(starts), n, 13 * n))
        for k in range(2 * taps):
            at = starts + k
            psi += weight[k] * rest[at] - rise[k] * momentum[at]
        is_slow = np.abs(dq) < _AT_REST * np.sqrt((dq**2).mean(axis=0))
        slow = np.concatenate([np.zeros((1, n)), np.cumsum(is_slow, axis=0)])
        moves = slow[starts + 2 * taps] - slow[starts] < _SLOW_PART * 2 * taps
        return cls(torque, psi, begin + starts, begin + starts + 2 * taps, moves)

    def at(self, mask: NDArray[np.bool_]) -> LogRows:
        """Return the rows that are marked in `mask`, shape (n_rows,)."""
        return LogRows(self.y[mask], self.psi[mask], self.first[mask], self.last[mask], self.moves[mask])


@dataclass(frozen=True)
class Rows:
    """Torques of all logs in the weak form, with their normal equations.

    Attributes
    ----------
    count : ndarray, shape (n_joints,)
        Number of rows of each joint.
    square : ndarray, shape (n_joints,)
        Sum of squared torques of each joint.
    normal, right : ndarray, shape (n_joints, 13 n_joints, 13 n_joints) and (n_joints, 13 n_joints)
        ``psi' psi`` and ``psi' y`` with the regressor `psi` of each joint.
    """

    count: Array
    square: Array
    normal: Array = field(repr=False)
    right: Array = field(repr=False)

    @classmethod
    def of(cls, logs: Sequence[Log], arm: Arm) -> Rows | None:
        """Return the normal equations of given logs; None where the logs hold too few samples, or no joint has a torque."""
        found = [rows for _, rows in rows_of(logs, arm)]
        return cls.of_rows(found, [np.ones(rows.y.shape, dtype=bool) for rows in found])

    @classmethod
    def of_rows(cls, found: Sequence[LogRows], used: Sequence[NDArray[np.bool_]]) -> Rows | None:
        """Return the normal equations of those rows of each joint that are marked in `used`, one array of shape (n_rows, n_joints) per log."""
        if not found:
            return None
        y = np.concatenate([rows.y for rows in found])
        psi = np.concatenate([rows.psi for rows in found])
        mask = np.concatenate(used)
        square = (mask * y**2).sum(axis=0)
        if not square.any():
            return None
        of_joint = [(psi[mask[:, j], j], y[mask[:, j], j]) for j in range(y.shape[1])]
        return cls(
            mask.sum(axis=0).astype(float),
            square,
            np.stack([x.T @ x for x, _ in of_joint]),
            np.stack([x.T @ torque for x, torque in of_joint]),
        )

    def fit(self, arm: Arm, factors: Array) -> Fit:
        """Estimate the arm's parameters from torques times one factor per joint."""
        precision = np.zeros(len(arm.sigma))
        free = arm.sigma > 0
        precision[free] = arm.sigma[free] ** -2.0
        moved = self.square > 0
        square = np.where(moved, factors**2 * self.square, 1.0)
        left = 0.01 * square
        theta = arm.theta
        for _ in range(_WEIGHT_ITERATIONS):
            weights = moved * self.count / left / _CORRELATED
            normal = np.einsum("j,jik->ik", weights, self.normal)
            right = np.einsum("j,ji->i", weights * factors, self.right) + precision * arm.theta
            normal[np.diag_indices_from(normal)] += precision
            theta = _estimate(normal, right, arm.theta, precision == 0, arm.n_joints)
            explained = (self.normal @ theta) @ theta - 2 * factors * (self.right @ theta)
            left = np.maximum(square + explained, 1e-8 * square)
        distance = float((precision * (theta - arm.theta) ** 2).sum())
        share = np.where(moved, left / square, 0.0)
        # The likelihood counts unexplained shares relative to one part in 10,000, below which a joint's torque counts as explained.
        logarithms = np.log(np.maximum(share, 1e-4) / 1e-4)
        likelihood = float((moved * self.count * logarithms).sum()) / _CORRELATED
        return Fit(likelihood + distance, theta, share, distance, float(self.count.max()) / _CORRELATED)


def fit(logs: Sequence[Log], arm: Arm) -> Fit | None:
    """Estimate the arm's parameters from the torques of logs; None where the logs hold too few samples."""
    rows = Rows.of(logs, arm)
    return None if rows is None else rows.fit(arm, np.ones(arm.n_joints))


def rows_of(logs: Sequence[Log], arm: Arm, most: int | None = None) -> list[tuple[Log, LogRows]]:
    """Return the logs that are long enough for a row, each with the rows of its middle.

    These are of `most` sample intervals of each log, or by default of `MOST_INTERVALS` in all logs together.
    """
    most = MOST_INTERVALS // len(logs) if most is None else most
    return [(log, rows) for log in logs if (rows := LogRows.of(log, arm, *_middle(log, most))) is not None]


def taps_of(log: Log) -> int:
    """Return half the number of sample intervals under a test function of a log."""
    period = float(np.median(np.diff(log.t)))
    return max(round(_HALF_WIDTH_S / period), _FEWEST_PERIODS)


def torques_averaged(tau: Array, first: NDArray[np.int64], taps: int) -> Array:
    """Return a log's torques, shape (n_samples, n_joints), averaged under the test functions that begin at the samples `first`."""
    index = first[:, None] + np.arange(2 * taps)[None, :]
    return np.asarray(np.einsum("k,wkj->wj", np.diff(_area(taps)), tau[index]))


def _area(taps: int) -> Array:
    """Return the integral of a raised cosine from its begin to every sample."""
    edge = np.arange(2 * taps + 1) / taps - 1.0
    return np.asarray(0.5 * (edge + np.sin(np.pi * edge) / np.pi))


def _middle(log: Log, most: int) -> tuple[int, int]:
    """Return the samples, first and end, of the middle `most` intervals of a log."""
    count = min(len(log) - 1, max(most, 1))
    begin = (len(log) - 1 - count) // 2
    return begin, begin + count + 1


def _estimate(normal: Array, right: Array, prior: Array, fixed: NDArray[np.bool_], n_joints: int) -> Array:
    """Solve normal equations; rotor inertias and friction are held at zero where they would be negative."""
    held = fixed.copy()
    value = np.where(held, prior, 0.0)
    first = 10 * n_joints
    for _ in range(3 * n_joints + 1):
        go = ~held
        value[go] = np.linalg.solve(normal[np.ix_(go, go)], right[go] - normal[np.ix_(go, held)] @ value[held])
        negative = go & (np.arange(len(value)) >= first) & (value < 0)
        if not negative.any():
            break
        held |= negative
        value[negative] = 0.0
    return value


def _torques(log: Log, arm: Arm) -> Array:
    """Return the torques of a log [N m or N]: as logged, or those of the arm's controller under the logged references."""
    if log.has_torques or log.q_ref is None or arm.controller is None:
        return log.tau
    return arm.controller.torque(log.t, log.q, log.q_ref, log.dq_ref, arm.torque_limit)


def _smoothed(x: Array, half: int) -> Array:
    """Return the running mean over `half` samples to either side, shorter at the ends."""
    total = np.concatenate([np.zeros((1, x.shape[1])), np.cumsum(x, axis=0)])
    at = np.arange(len(x))
    low, high = np.maximum(at - half, 0), np.minimum(at + half + 1, len(x))
    return np.asarray((total[high] - total[low]) / (high - low)[:, None])
