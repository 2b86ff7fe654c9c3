"""Visibility of a hidden effect: whether it leaves a trace in the logs after re-estimation of the arm's parameters.

Torques along the logged positions, with the same low-pass filter on both, are regressed on the arm's parameters, with the arm file's standard
deviations as prior (Siciliano 2009, section 7.2: the Newton-Euler recursion is linear in the ten numbers of each link). The same is done for
runs without the effect along the same references. The effect is visible if its RMS residual is a multiple of that without it, on training logs
and holdout, or if the estimated parameters differ much from those without it. Of logs of references, whose torques a diagnosis does not see, the
simulated torques count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .arms import SerialRobot
from .motion import Run

Array = NDArray[np.float64]

#: Ratio of RMS torque residuals with and without an effect, on one joint, from which the effect counts as visible.
MULTIPLE = 2.0
#: Distance between the parameters re-estimated with and without an effect, in the arm file's standard deviations, from which the effect counts as
#: visible. `MULTIPLE` and `SIGMAS` are those of the trial of two-link arms (docs/trial-scores.md).
SIGMAS = 5.0
#: Standard deviation of the Gaussian filter of positions and torques [s]: it passes the motion but not the encoder's steps.
FILTER_S = 0.02
#: Time between consecutive rows of the regression [s].
SPACING_S = 0.01
#: Share of a joint's RMS speed below which the joint may be at rest, where dry friction is a bound and not a datum.
_SLOW = 0.01
#: Largest share of samples at which a joint may be at rest, weighted by the filter, with which a row of the regression is used.
_AT_REST = 0.002
#: Smallest RMS torque residual that is used in ratios, as a share of the joint's RMS torque.
_FLOOR = 1e-3


@dataclass(frozen=True)
class Visibility:
    """Visibility of a hidden effect in the logs of a case.

    Attributes
    ----------
    above_floor : float
        Ratio of the RMS torque residuals after re-estimation with and without the effect: largest of the joints, smaller of training and holdout.
    moved : float
        Distance between the parameters re-estimated with and without the effect, in the arm file's standard deviations.
    """

    above_floor: float
    moved: float

    @property
    def visible(self) -> bool:
        """Whether the effect is visible, so that a diagnosis can find it."""
        return self.above_floor >= MULTIPLE or self.moved >= SIGMAS


def visibility(robot: SerialRobot, sigma: Array, plain: list[Run], logs: list[Run]) -> Visibility:
    """Return the visibility of a hidden effect.

    Parameters
    ----------
    robot : SerialRobot
        The nominal arm.
    sigma : ndarray, shape (13 n,)
        Standard deviations of the arm file.
    plain, logs : list of Run
        Runs without and with the effect; the last of each is the holdout.
    """
    rows = [[Rows(robot, run) for run in runs] for runs in (plain, logs)]
    scale = np.sqrt(np.mean([np.mean(r.torque**2, axis=0) for r in rows[0]], axis=0))
    (without, floor), (found, left) = (_refit(robot.theta, sigma, part, scale) for part in rows)
    above = (left / np.maximum(floor, _FLOOR * scale)).max(axis=1).min()
    known = sigma > 0
    moved = np.linalg.norm((found - without)[known] / sigma[known])
    return Visibility(float(f"{above:.4g}"), float(f"{moved:.4g}"))


def _refit(theta: Array, sigma: Array, rows: list[Rows], scale: Array) -> tuple[Array, Array]:
    """Return parameters fitted to the training logs, weighted by RMS residuals per joint, and RMS residuals of training and holdout, shape (2, n)."""
    *training, holdout = rows
    known = sigma > 0
    found, rms = theta.copy(), 0.05 * scale
    for _ in range(4):
        weight = 1.0 / np.maximum(rms, _FLOOR * scale)
        # Residuals are correlated over some hundredths of a second by disturbances and filter, so a quarter of the rows is counted.
        normal, right = np.diag(sigma[known] ** -2), np.zeros(known.sum())
        for r in training:
            columns = 0.5 * r.regressor[:, :, known] * weight[:, None]
            missed = 0.5 * r.left(theta) * weight
            normal += np.einsum("tji,tjk->ik", columns, columns)
            right += np.einsum("tji,tj->i", columns, missed)
        found = theta.copy()
        found[known] += np.linalg.solve(normal, right)
        left = [_rms(part, found) for part in (training, [holdout])]
        rms = left[0]
    return found, np.array(left)


def _rms(rows: list[Rows], theta: Array) -> Array:
    count = sum(r.moving.sum(axis=0) for r in rows)
    return np.asarray(np.sqrt(sum((r.left(theta) ** 2).sum(axis=0) for r in rows) / np.maximum(count, 1)))


class Rows:
    """Low-pass filtered torques and their regressor along one log; `regressor`, shape (n_rows, n, 13 n), is zero where the joint may be at
    rest (`moving` is false).
    """

    def __init__(self, robot: SerialRobot, run: Run) -> None:
        period = float(run.t[1] - run.t[0])
        half = int(np.ceil(4 * FILTER_S / period))
        kernel = np.exp(-0.5 * (period * np.arange(-half, half + 1) / FILTER_S) ** 2)
        kernel /= kernel.sum()
        every = max(1, round(SPACING_S / period))

        def smooth(x: Array) -> Array:
            flat = x.reshape(len(x), -1)
            return np.stack([np.convolve(column, kernel, "same") for column in flat.T], axis=1).reshape(x.shape)

        # Torques are held until the next sample, so the mean of two commands is the torque at a sample.
        held = np.vstack([run.tau[:1], 0.5 * (run.tau[:-1] + run.tau[1:])])
        q = smooth(run.q)
        dq = np.gradient(q, period, axis=0)
        ddq = np.gradient(dq, period, axis=0)
        inside = slice(2 * half, len(q) - 2 * half, every)
        n = robot.n
        slow = np.abs(dq) < _SLOW * np.sqrt(np.mean(dq**2, axis=0))
        self.moving = smooth(slow.astype(float))[inside] < _AT_REST
        self.torque = smooth(held)[inside] * self.moving
        self.regressor = np.zeros((len(self.torque), n, 13 * n))
        self.regressor[:, :, : 10 * n] = links(robot, q[inside], dq[inside], ddq[inside])
        joints = np.arange(n)
        direction = smooth(np.sign(dq))
        for place, column in enumerate((ddq, dq, direction)):
            self.regressor[:, joints, (10 + place) * n + joints] = column[inside]
        self.regressor *= self.moving[:, :, None]

    def left(self, theta: Array) -> Array:
        """Return the residual torques of the parameters `theta`, shape (n_rows, n)."""
        return np.asarray(self.torque - self.regressor @ theta)


def links(robot: SerialRobot, q: Array, dq: Array, ddq: Array) -> Array:
    """Return the regressor of the links' ten inertial parameters, shape (n_rows, n, 10 n), by the Newton-Euler recursion."""
    rows, n = q.shape
    out = np.zeros((rows, n, 10 * n))
    turning = [_turn(robot, j, q[:, j]) for j in range(n)]
    spin, gain = np.zeros((rows, 3)), np.zeros((rows, 3))
    linear = np.tile(-robot.gravity, (rows, 1))
    wrenches: list[tuple[Array, Array]] = []
    for j, (rotation, place) in enumerate(turning):
        axis = robot.axis[j]
        back = rotation.transpose(0, 2, 1)
        linear = linear + np.cross(gain, place) + np.cross(spin, np.cross(spin, place))
        spin, gain, linear = (np.einsum("tij,tj->ti", back, x) for x in (spin, gain, linear))
        speed, rate = axis * dq[:, j, None], axis * ddq[:, j, None]
        if robot.rotary[j]:
            gain = gain + rate + np.cross(spin, speed)
            spin = spin + speed
        else:
            linear = linear + rate + 2 * np.cross(spin, speed)
        wrenches.append(_wrench(spin, gain, linear))
    for k, (force, moment) in enumerate(wrenches):
        for j in range(k, -1, -1):
            felt = moment if robot.rotary[j] else force
            out[:, j, 10 * k : 10 * k + 10] = np.einsum("i,tik->tk", robot.axis[j], felt)
            rotation, place = turning[j]
            force = np.einsum("tij,tjk->tik", rotation, force)
            moment = np.einsum("tij,tjk->tik", rotation, moment) + np.cross(place[:, :, None], force, axis=1)
    return out


def _turn(robot: SerialRobot, j: int, q: Array) -> tuple[Array, Array]:
    """Return the axes of link `j` in the previous link's frame, shape (n_rows, 3, 3), and its origin there [m], shape (n_rows, 3)."""
    axis, rotation = robot.axis[j], robot.rotation[j]
    if not robot.rotary[j]:
        return np.tile(rotation, (len(q), 1, 1)), robot.translation[j] + np.outer(q, rotation @ axis)
    cross = _cross(axis[None])[0]
    turn = np.eye(3) + np.sin(q)[:, None, None] * cross + (1 - np.cos(q))[:, None, None] * cross @ cross
    return rotation @ turn, np.tile(robot.translation[j], (len(q), 1))


def _cross(x: Array) -> Array:
    """Return the matrices of the cross product with the vectors `x`, shape (n_rows, 3, 3)."""
    out = np.zeros((len(x), 3, 3))
    out[:, [2, 0, 1], [1, 2, 0]], out[:, [1, 2, 0], [2, 0, 1]] = x, -x
    return out


def _wrench(spin: Array, gain: Array, linear: Array) -> tuple[Array, Array]:
    """Return force and moment about a link's origin per unit of its ten inertial parameters, shape (n_rows, 3, 10) each."""

    def inertia(x: Array) -> Array:
        out = np.zeros((len(x), 3, 6))
        for column, (i, k) in enumerate(((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))):
            out[:, i, column] = x[:, k]
            out[:, k, column] = x[:, i]
        return out

    force, moment = np.zeros((2, len(spin), 3, 10))
    around = _cross(spin)
    force[:, :, 0] = linear
    force[:, :, 1:4] = _cross(gain) + around @ around
    moment[:, :, 1:4] = -_cross(linear)
    moment[:, :, 4:] = inertia(gain) + around @ inertia(spin)
    return force, moment
