"""Parts of the regression baselines: the arm's regressor on measured motion, and effects' signatures in the residual torque.

A baseline uses ``residual = tau - Y theta``: the torque that the arm file's model leaves unexplained, joint by joint, with ``Y``
re-estimated or not. Each effect of the library leaves a known signature in the residual, linear in its size once its shape
(a velocity, a period, a level, ...) is fixed; shapes come from a grid. Velocities and accelerations are those of a cubic
through the samples within 15 ms (Savitzky-Golay); torques go through the same cubic, and both sides are averaged over
blocks of 10 ms, so that both sides have the same phase. Blocks in which a joint is slow, or reverses within the
cubic, are left out of the joint's rows, since dry friction can take any value there.

References
----------
Savitzky and Golay (1964), Anal. Chem. 36, 1627-1639. Swevers, Verdonck and De Schutter (2007), IEEE Control Systems
Magazine 27(5), 58-71: smoothing and averaging in robot identification.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.log.log import Log
from armgap.trial.cases.sealed import SealedCase

__all__ = ["Motion", "RegressionData", "motion", "regression_data", "regressor"]

Array = NDArray[np.float64]
#: Half width of the smoothing cubic, and length of a block of averaged samples, s.
_SMOOTHING_HALF_WIDTH_S, BLOCK = 0.015, 0.010
#: Speed below which a joint counts as slow and its rows are left out, as a share of the 95th percentile of its speed.
SLOW = 0.02
#: Smallest standard deviation assumed for a joint's residual torque, as a share of that of its torque.
_MIN_RESIDUAL_SIGMA = 0.005


@dataclass(frozen=True)
class Motion:
    """Smoothed motion of a log.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Times from the log's start [s].
    q, dq, ddq, tau : ndarray, shape (n, n_joints)
        Smoothed positions, velocities, accelerations and torques [SI].
    raw : ndarray, shape (n, n_joints)
        Commanded torques as logged, before smoothing [N m or N].
    half, block : int
        Number of samples on each side of a smoothing cubic, and in a block.
    """

    t: Array
    q: Array
    dq: Array
    ddq: Array
    tau: Array
    raw: Array
    half: int
    block: int

    def blocks(self, columns: Array) -> Array:
        """Return columns of shape (n, ..) averaged over blocks of samples, without the half width of a cubic at both ends."""
        inner = columns[self.half : len(columns) - self.half]
        n = len(inner) // self.block
        shape = (n, self.block, *columns.shape[1:])
        means: Array = inner[: n * self.block].reshape(shape).mean(axis=1)
        return means

    def smooth(self, column: Array) -> Array:
        """Return a column smoothed with the cubic that positions and torques of the motion are smoothed with."""
        return _savgol(column, self.half, 0, 1.0)


@dataclass(frozen=True)
class RegressionData:
    """Regression of a set of logs: rows of all joints, each joint scaled to residuals of size one.

    Attributes
    ----------
    motions : tuple of Motion
        Smoothed motions, one per log.
    scale : ndarray, shape (n_joints,)
        Torque by which the rows of each joint are divided [N m or N].
    keep : ndarray of bool
        Which of all rows are kept: those in which the row's joint moves.
    base : ndarray, shape (m, n_parameters)
        Scaled regressor of the arm.
    tau : ndarray, shape (m,)
        Scaled torques.
    """

    motions: tuple[Motion, ...]
    scale: Array
    keep: NDArray[np.bool_]
    base: Array
    tau: Array

    def rows(self, columns: list[Array]) -> Array:
        """Return columns per log, each of shape (n, n_joints, k), as rows of the regression, shape (m, k)."""
        return _stack(self.motions, columns, self.scale)[self.keep]


def motion(log: Log) -> Motion:
    """Return the smoothed motion of a log."""
    h = float(np.median(np.diff(log.t)))
    half = max(3, round(_SMOOTHING_HALF_WIDTH_S / h))
    # A command is held from one sample to the next; at the instant of a sample the mean of the old and the new one counts.
    held = 0.5 * (log.tau + np.vstack([log.tau[:1], log.tau[:-1]]))
    q, dq, ddq = (_savgol(log.q, half, order, h) for order in range(3))
    return Motion(log.t - log.t[0], q, dq, ddq, _savgol(held, half, 0, h), log.tau, half, max(1, round(BLOCK / h)))


def regression_data(case: SealedCase, scale: Array | None = None, held_out: bool = False) -> RegressionData:
    """Return training or holdout logs of a case as a regression, by default scaled by the residuals of the training logs."""
    motions = tuple(motion(log) for log in (case.holdout if held_out else case.training))
    one = np.ones(case.arm.n_joints)
    keep = _stack(motions, [_moving(x)[..., None] for x in motions], one)[:, 0] > 1.0 - 1e-9
    base = _stack(motions, [regressor(case.arm, x.q, x.dq, x.ddq) for x in motions], one)
    tau = _stack(motions, [x.tau[..., None] for x in motions], one)[:, 0]
    joint = np.repeat(np.arange(one.size), len(tau) // one.size)
    if scale is None:
        error = tau - base @ np.linalg.lstsq(base[keep], tau[keep], rcond=None)[0]
        rows = [keep & (joint == j) for j in range(one.size)]
        scale = np.array(
            [max(float(np.std(error[r])), _MIN_RESIDUAL_SIGMA * float(np.std(tau[r])), 1e-12) for r in rows]
        )
    weight = scale[joint]
    return RegressionData(motions, scale, keep, (base / weight[:, None])[keep], (tau / weight)[keep])


def _moving(x: Motion) -> Array:
    """Return 1 where a joint moves over the whole smoothing cubic, 0 where it is slow or reverses within it."""
    from scipy.ndimage import minimum_filter1d

    fast = np.quantile(np.abs(x.dq), 0.95, axis=0)
    moving: Array = minimum_filter1d((np.abs(x.dq) > SLOW * fast).astype(np.float64), 2 * x.half + 1, axis=0)
    return moving


def _stack(motions: tuple[Motion, ...], columns: list[Array], scale: Array) -> Array:
    """Return scaled columns of all logs as rows, joint after joint."""
    blocks = [x.blocks(c) / scale[:, None] for x, c in zip(motions, columns, strict=True)]
    rows: Array = np.concatenate([b[:, j] for j in range(scale.size) for b in blocks])
    return rows


def regressor(arm: Arm, q: Array, dq: Array, ddq: Array) -> Array:
    """Return the arm's regressor `Y` in ``Y theta = tau``, shape (n, n_joints, n_parameters).

    References
    ----------
    Reyes and Kelly (1997), section 5, for the two-link arm.
    """
    inertial = {"axis": _axis, "pendulum": _pendulum, "two-link": _two_link}[arm.kind](q, dq, ddq)
    eye = np.eye(arm.n_joints)
    rows: Array = np.concatenate([inertial, dq[..., None] * eye, np.sign(dq)[..., None] * eye], axis=2)
    return rows


def _axis(q: Array, dq: Array, ddq: Array) -> Array:
    return np.stack([ddq, np.ones_like(q)], axis=2)


def _pendulum(q: Array, dq: Array, ddq: Array) -> Array:
    return np.stack([ddq, np.sin(q)], axis=2)


def _two_link(q: Array, dq: Array, ddq: Array) -> Array:
    (a1, a2), (v1, v2), zero = ddq.T, dq.T, np.zeros(len(q))
    c2, s2, s1, s12 = np.cos(q[:, 1]), np.sin(q[:, 1]), np.sin(q[:, 0]), np.sin(q.sum(axis=1))
    first = [a1, 2 * c2 * a1 + c2 * a2 - s2 * (2 * v1 * v2 + v2**2), a2, s1, s12]
    second = [zero, c2 * a1 + s2 * v1**2, a1 + a2, zero, s12]
    return np.stack([np.column_stack(first), np.column_stack(second)], axis=1)


def _savgol(columns: Array, half: int, order: int, h: float) -> Array:
    """Return the derivative of a given order of the cubic through each sample's neighbours; at the edges, of the outermost cubic."""
    from scipy.signal import savgol_filter

    smooth: Array = savgol_filter(columns, 2 * half + 1, 3, deriv=order, delta=h, axis=0)
    return smooth
