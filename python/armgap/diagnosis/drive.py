"""A drive as a model from the commanded to the measured torque of a joint, identified from logs that hold both.

    tau_meas(t) = gain tau(t - delay) + offset - viscous dq(t) - inertia ddq(t)

`tau` is held between its samples, so the delay counts from the moment at which a command is given. Both sides are smoothed by one Gaussian kernel,
which gives velocity and acceleration from positions without a shift in time, and are fitted by least squares: linear in all but the delay, which
is searched over a grid and refined by Gauss-Newton. A first-order lag of the drive's current loop is part of the delay: under the kernel both are
equivalent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.log.log import Log

__all__ = ["PARAMETERS", "Drive"]

Array = NDArray[np.float64]

PARAMETERS = ("delay", "gain", "offset", "viscous", "inertia")
"""Names of the parameters of a drive, in the order of `Drive.values`."""

# Standard deviation of the Gaussian kernel that smooths torques and positions [s]: its cut-off of 7 Hz is above the motion of arms. On a real arm
# inertias of single logs scattered by 23 % with 5 ms and by 10 to 12 % with 10 to 40 ms, where ripple of the current and encoder steps are gone.
_KERNEL_S = 0.02
# Smallest standard deviation of the Gaussian kernel, in sample periods: narrower kernels have no second derivative on the samples.
_KERNEL_PERIODS = 2.0
# Half width of the Gaussian kernel in standard deviations: 6e-5 of its weight lies beyond.
_KERNEL_REACH = 4.0
# Range of delays that are searched [s]: field buses and current loops take 1 to 30 ms; a measured torque before its command is a time shift of the
# file.
_EARLIEST_S, _LATEST_S = -0.05, 0.1
# Step of the grid of delays, in standard deviations of the Gaussian kernel: within a step the cost is a parabola.
_GRID = 0.25
# Gauss-Newton iterations for a drive's delay; from within a step of the grid the delay has converged to 1e-6 s after four iterations.
_DELAY_ITERATIONS = 8
# Length of a hole in the samples, in sample periods, at which a log is split, equal to that for the equation of motion.
_HOLE_PERIODS = 3.0
# Variation of a command, as a part of the measured torque, below which it determines neither gain nor delay.
_VARIES = 0.01
# Length of a block of torque residuals that counts as one independent value [s]: torques are correlated over some tenths of a second.
_BLOCK_S = 1.0
# Standard deviation of the sampling instant of a torque within its period, in periods: that of a uniform distribution.
_SAMPLED = 1.0 / np.sqrt(12.0)


@dataclass(frozen=True)
class _Stretch:
    """Signals of one joint over a stretch without holes, smoothed by the Gaussian kernel, at even times.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Times [s].
    inner : ndarray of bool, shape (n,)
        Times whose delayed commands all lie within the stretch.
    tau, tau_rate : ndarray, shape (n,)
        Command and its rate [N m, N m/s].
    tau_meas, dq, ddq : ndarray, shape (n,)
        Measured torque, velocity and acceleration [N m, rad/s, rad/s^2].
    """

    t: Array
    inner: NDArray[np.bool_]
    tau: Array
    tau_rate: Array
    tau_meas: Array
    dq: Array
    ddq: Array

    @classmethod
    def of(cls, t: Array, q: Array, tau: Array, tau_meas: Array) -> _Stretch | None:
        """Smooth the signals of a stretch by the Gaussian kernel; None where the stretch is too short."""
        step = float(np.median(np.diff(t)))
        sigma = max(_KERNEL_S, _KERNEL_PERIODS * step)
        even = np.arange(t[0], t[-1], step)
        half = int(np.ceil(_KERNEL_REACH * sigma / step))
        inside = even[half:-half]
        if not len(inside) or inside[-1] - inside[0] <= _LATEST_S - _EARLIEST_S:
            return None
        inner = (inside - _LATEST_S >= inside[0]) & (inside - _EARLIEST_S <= inside[-1])
        if not inner.any():
            return None
        s = step * np.arange(-half, half + 1)
        kernel = np.exp(-0.5 * (s / sigma) ** 2)
        kernel /= kernel.sum()
        rate = -s / sigma**2 * kernel
        curvature = (s**2 / sigma**4 - 1 / sigma**2) * kernel
        curvature -= curvature.mean()  # a constant has zero second derivative, also with a truncated kernel
        impulse = np.concatenate([[0.0], np.cumsum(tau[:-1] * np.diff(t))])
        edges = np.append(even - 0.5 * step, even[-1] + 0.5 * step)
        held = np.diff(np.interp(edges, t, impulse)) / np.diff(np.clip(edges, t[0], t[-1]))
        position, measured = np.interp(even, t, q), np.interp(even, t, tau_meas)

        def weighed(values: Array, by: Array) -> Array:
            return np.convolve(values, by, "valid")

        return cls(
            inside, inner, weighed(held, kernel), weighed(held, rate), weighed(measured, kernel),
            weighed(position, rate), weighed(position, curvature),
        )  # fmt: skip

    def delayed(self, delay: float) -> Array:
        """Return the commanded torque [N m or N] as it was `delay` seconds earlier, shape (n_inner,)."""
        return np.asarray(np.interp(self.t[self.inner] - delay, self.t, self.tau))

    def columns(self, delay: float) -> Array:
        """Return the regressor of gain, offset, viscous part and inertia for a delay [s], shape (n_inner, 4)."""
        tau = self.delayed(delay)
        return np.stack([tau, np.ones_like(tau), -self.dq[self.inner], -self.ddq[self.inner]], axis=1)

    def by_delay(self, delay: float, gain: float) -> Array:
        """Return the derivative of the modelled torque by the delay [N m/s or N/s], shape (n_inner,)."""
        return -gain * np.interp(self.t[self.inner] - delay, self.t, self.tau_rate)

    @property
    def measured(self) -> Array:
        """Measured torque that the drive model is fitted to, shape (n_inner,)."""
        return self.tau_meas[self.inner]

    @property
    def blocks(self) -> NDArray[np.intp]:
        """Block number of each row of a stretch, counted from its start."""
        t = self.t[self.inner]
        return np.asarray((t - t[0]) / _BLOCK_S, dtype=np.intp)


@dataclass(frozen=True)
class Drive:
    """Identified drive of one joint: model from commanded to measured torque.

    Attributes
    ----------
    joint : int
        Joint, from 0.
    values, sigma : ndarray, shape (5,)
        Delay [s], gain, offset [N m], viscous part [N m s/rad] and inertia [kg m^2] with their standard deviations, from the scatter between blocks
        of a second or between logs, whichever is larger; the delay's standard deviation includes the unknown sampling instant within a period.
    """

    joint: int
    values: Array
    sigma: Array

    @classmethod
    def identify(cls, logs: Sequence[Log], joint: int) -> Drive | None:
        """Fit the drive of a joint (from 0) to logs; None for a constant command, or if no delay in range explains the measured torque."""
        by_log = [found for log in logs if (found := _stretches(log, joint))]
        stretches = [stretch for found in by_log for stretch in found]
        if not stretches:
            return None
        measured = np.concatenate([s.measured for s in stretches])
        if np.std(np.concatenate([s.tau[s.inner] for s in stretches])) <= _VARIES * np.std(measured):
            return None

        def fitted(delay: float) -> Array:
            columns = np.concatenate([s.columns(delay) for s in stretches])
            return np.asarray(np.linalg.lstsq(columns, measured, rcond=None)[0])

        # Of the regressor only the column of the torque depends on the delay: the other columns are projected out once.
        others, sizes, _ = np.linalg.svd(
            np.concatenate([s.columns(0.0)[:, 1:] for s in stretches]), full_matrices=False
        )
        others = others[:, sizes > np.finfo(float).eps * len(others) * sizes[0]]

        def alone(values: Array) -> Array:
            # Not by `@`, which shares out products of this size among threads that then wait for each other.
            along = np.einsum("ij,i->j", others, values)
            return np.asarray(values - np.einsum("ij,j->i", others, along))

        apart = alone(measured)

        def missed(delay: float) -> float:
            tau = alone(np.concatenate([s.delayed(delay) for s in stretches]))
            gain = np.einsum("i,i", tau, apart) / max(np.einsum("i,i", tau, tau), np.finfo(float).tiny)
            left = apart - gain * tau
            return float(np.einsum("i,i", left, left))

        sigma = max(_KERNEL_S, _KERNEL_PERIODS * logs[0].sample_period)
        delay = float(min(np.arange(_EARLIEST_S, _LATEST_S, _GRID * sigma), key=lambda d: missed(float(d))))
        for _ in range(_DELAY_ITERATIONS):
            values = np.append(delay, fitted(delay))
            jacobian = [_jacobian(s, values) for s in stretches]
            residual = [s.measured - s.columns(delay) @ values[1:] for s in stretches]
            delay += float(np.linalg.lstsq(np.concatenate(jacobian), np.concatenate(residual), rcond=None)[0][0])
            if not _EARLIEST_S < delay < _LATEST_S:
                return None
        logs_of = np.concatenate([np.full(s.inner.sum(), i) for i, found in enumerate(by_log) for s in found])
        longest = max(int(s.blocks[-1]) for s in stretches) + 1
        blocks_of = np.concatenate([i * longest + s.blocks for i, s in enumerate(stretches)])
        rows, left = np.concatenate(jacobian), np.concatenate(residual)
        scatter = np.maximum(_scatter(rows, left, blocks_of), _scatter(rows, left, logs_of))
        scatter[0] = np.hypot(scatter[0], _SAMPLED * logs[0].sample_period)
        return cls(joint, values, scatter)

    def left(self, logs: Sequence[Log]) -> tuple[float, float]:
        """Return the RMS over `logs` of measured less commanded, and of measured less modelled torque [N m], smoothed by the Gaussian kernel."""
        stretches = [stretch for log in logs for stretch in _stretches(log, self.joint)]
        if not stretches:
            return 0.0, 0.0
        apart = np.concatenate([s.measured - s.tau[s.inner] for s in stretches])
        left = np.concatenate([s.measured - s.columns(self.values[0]) @ self.values[1:] for s in stretches])
        return float(np.sqrt(np.mean(apart**2))), float(np.sqrt(np.mean(left**2)))

    def parameters(self, *, rotary: bool) -> dict[str, Any]:
        """Return the drive's parameters by name, each with value, sigma and unit."""
        units = ("s", "1", "N m", "N m s/rad", "kg m^2") if rotary else ("s", "1", "N", "N s/m", "kg")
        return {
            name: {"value": float(value), "sigma": float(sigma), "unit": unit}
            for name, value, sigma, unit in zip(PARAMETERS, self.values, self.sigma, units, strict=True)
        }


def _stretches(log: Log, joint: int) -> list[_Stretch]:
    """Return the stretches of a log between its holes."""
    assert log.tau_meas is not None
    edges = [0, *(np.flatnonzero(np.diff(log.t) > _HOLE_PERIODS * log.sample_period) + 1).tolist(), len(log)]
    found = [
        _Stretch.of(log.t[a:b], log.q[a:b, joint], log.tau[a:b, joint], log.tau_meas[a:b, joint])
        for a, b in pairwise(edges)
        if b - a > 2
    ]
    return [stretch for stretch in found if stretch is not None]


def _jacobian(stretch: _Stretch, values: Array) -> Array:
    """Return the derivatives of the modelled torque by delay, gain, offset, viscous part and inertia, shape (n_inner, 5)."""
    delay, gain = values[:2]
    return np.column_stack([stretch.by_delay(delay, gain), stretch.columns(delay)])


def _scatter(rows: Array, residual: Array, groups: NDArray[np.intp]) -> Array:
    """Return standard deviations of least-squares estimates for residuals that are correlated only within groups of rows, shape (n_parameters,)."""
    _, group = np.unique(groups, return_inverse=True)
    count = int(group.max()) + 1
    if count < 2:
        return np.zeros(rows.shape[1])
    scores = np.zeros((count, rows.shape[1]))
    np.add.at(scores, group, rows * residual[:, None])
    inverse = np.linalg.pinv(rows.T @ rows, hermitian=True)
    covariance = inverse @ (scores.T @ scores) @ inverse * count / (count - 1)
    return np.sqrt(np.maximum(np.diag(covariance), 0.0))
