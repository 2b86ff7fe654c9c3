"""Whether a hidden effect can be seen at all, after the arm's parameters have been estimated again.

Torques along the logged positions, both low-passed alike, are regressed on the arm's parameters with the arm file's standard deviations as prior
(Siciliano 2009, section 7.2: the Newton-Euler recursion is linear in the ten numbers of each link). The same is done along the same
references without the effect. It is visible if it leaves a multiple of what stays without it, on training logs and holdout, or if the parameters end
up far from the arm file's.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arms import SerialRobot
from .motion import Run

Array = NDArray[np.float64]

#: Visible: on one joint at least this multiple of the RMS torque that stays without the effect ...
MULTIPLE = 2.0
#: ... or parameters that are at least this many of the arm file's standard deviations from where they are without it. Both as in the trial of two
#: links (docs/trial-scores.md).
SIGMAS = 5.0
#: Standard deviation of the Gaussian filter of positions and torques [s]: it passes the motion, not the steps of the encoder.
FILTER_S = 0.02
#: Rows are this far apart [s].
SPACING_S = 0.01
#: A joint slower than this share of its RMS speed may be at rest, where dry friction is a bound and no datum ...
_SLOW = 0.01
#: ... and rows of which it rests for more than this share do not count.
_AT_REST = 0.002
#: Torques that no filter or rounding is below, as a share of the joint's RMS torque.
_FLOOR = 1e-3


@dataclass(frozen=True)
class Visibility:
    """How far an effect stands out.

    Attributes
    ----------
    above_floor : float
        RMS torque that stays after re-estimation over what stays without the effect: largest of the joints, smaller of training logs and holdout.
    moved : float
        Distance of the re-estimated parameters with and without the effect, in the arm file's standard deviations.
    """

    above_floor: float
    moved: float

    @property
    def visible(self) -> bool:
        """Whether it can be found."""
        return self.above_floor >= MULTIPLE or self.moved >= SIGMAS

    def to_dict(self) -> dict[str, Any]:
        """Return the entries of a key."""
        return {**asdict(self), "visible": self.visible}


def visibility(robot: SerialRobot, sigma: Array, plain: list[Run], logs: list[Run]) -> Visibility:
    """Return how far a hidden effect stands out.

    Parameters
    ----------
    robot : SerialRobot
        The nominal arm.
    sigma : ndarray, shape (13 n,)
        The arm file's standard deviations.
    plain, logs : list of Run
        The logs without and with the effect; the last is the holdout.
    """
    rows = [[Rows(robot, run) for run in runs] for runs in (plain, logs)]
    scale = np.sqrt(np.mean([np.mean(r.torque**2, axis=0) for r in rows[0]], axis=0))
    (without, floor), (found, left) = (_refit(robot.theta, sigma, part, scale) for part in rows)
    above = (left / np.maximum(floor, _FLOOR * scale)).max(axis=1).min()
    known = sigma > 0
    moved = np.linalg.norm((found - without)[known] / sigma[known])
    return Visibility(float(f"{above:.4g}"), float(f"{moved:.4g}"))


def _refit(theta: Array, sigma: Array, rows: list[Rows], scale: Array) -> tuple[Array, Array]:
    """Parameters that fit the training logs, with the weights that their residuals ask for; RMS residuals of training and holdout, shape (2, n)."""
    *training, holdout = rows
    known = sigma > 0
    found, rms = theta.copy(), 0.05 * scale
    for _ in range(4):
        weight = 1.0 / np.maximum(rms, _FLOOR * scale)
        # A quarter of the rows counts: disturbances and filter have memories of some hundredths of a second.
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
    """Torques and their regressor along one log, low-passed; `regressor` has the shape (n_rows, n, 13 n), and is zero where the joint may be at
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

        # The torque is held over the period that follows its sample.
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
        """Return what parameters leave of the torques, shape (n_rows, n)."""
        return np.asarray(self.torque - self.regressor @ theta)


def links(robot: SerialRobot, q: Array, dq: Array, ddq: Array) -> Array:
    """Return the torques per unit of the ten numbers of each link, shape (n_rows, n, 10 n), by the Newton-Euler recursion."""
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
    """Axes of link `j` in the link before, shape (n_rows, 3, 3), and its origin there, shape (n_rows, 3)."""
    axis, rotation = robot.axis[j], robot.rotation[j]
    if not robot.rotary[j]:
        return np.tile(rotation, (len(q), 1, 1)), robot.translation[j] + np.outer(q, rotation @ axis)
    cross = _cross(axis[None])[0]
    turn = np.eye(3) + np.sin(q)[:, None, None] * cross + (1 - np.cos(q))[:, None, None] * cross @ cross
    return rotation @ turn, np.tile(robot.translation[j], (len(q), 1))


def _cross(x: Array) -> Array:
    """Matrices of the cross product, shape (n_rows, 3, 3)."""
    out = np.zeros((len(x), 3, 3))
    out[:, [2, 0, 1], [1, 2, 0]], out[:, [1, 2, 0], [2, 0, 1]] = x, -x
    return out


def _wrench(spin: Array, gain: Array, linear: Array) -> tuple[Array, Array]:
    """Force and moment about a link's origin per unit of its ten numbers, shape (n_rows, 3, 10) each."""

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
