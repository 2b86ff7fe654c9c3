"""Plausibility of a serial arm's input: logs read in another way explain the arm's torques where the logs as they stand do not.

The equation of motion of a serial arm is compared in its weak form, weighed by raised cosines: momentum takes the place of accelerations. Its
parameters are estimated within the trust that the arm file states, with friction and rotor inertias not negative. A reading of the columns
that is right lowers both what stays of the torques and the distance from the arm file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm import Arm
from armgap.check import (
    gravity_missing,
    gravity_sign,
    joint_order,
    position_sign,
    position_unit,
    position_zero,
    torque_sign,
)
from armgap.check.check import Check
from armgap.check.corrections import Corrections
from armgap.check.reading import Reading
from armgap.log import Log

__all__ = ["contradictions"]

Array = NDArray[np.float64]

# Half width of a test function [s], and at least so many sample periods.
_HALF_WIDTH_S = 0.05
_FEWEST_PERIODS = 5
# Intervals of all logs together that are compared: some ten seconds of a robot's log tell a sign.
_MOST_INTERVALS = 4000
# Rows that count as one because neighbouring test functions overlap and residuals are correlated over some tenths of a second.
_CORRELATED = 12.0
# Rounds in which the weights of the joints follow from their residuals.
_ROUNDS = 4
# Share of a joint's mean square torque that stays unexplained, from which other readings are asked for. Friction that the model lacks leaves up
# to a fifth on logs of real arms.
_SUSPICIOUS = 0.3
# Distance of the parameters from the arm file, per joint, from which other readings are asked for: five standard deviations of one value.
_FAR = 25.0
# A reading is right where the cost falls by this part of it at least, to less than `_EXPLAINS` of every joint's mean square torque that it concerns.
_BETTER = 0.5
_EXPLAINS = 0.15
# Two readings whose costs differ by less than this part of what they gain are alike.
_ALIKE = 0.02

_READINGS: tuple[Callable[[Arm, float], Iterable[Reading]], ...] = (
    torque_sign.readings,
    position_sign.readings,
    joint_order.readings,
    position_zero.readings,
    gravity_sign.readings,
    gravity_missing.readings,
    position_unit.readings,
)


@dataclass(frozen=True)
class Fit:
    """A regression of torques on the arm's parameters.

    Attributes
    ----------
    cost : float
        Twice the negative logarithm of the likelihood up to a constant, and the squared distance from the arm file.
    share : ndarray, shape (n_joints,)
        Part of each joint's mean square torque that stays unexplained.
    distance : float
        Squared distance of the parameters from the arm file in its standard deviations.
    """

    cost: float
    share: Array
    distance: float


def contradictions(logs: Sequence[Log], arm: Arm) -> tuple[Corrections, list[Check]]:
    """Look for a reading of the columns under which logs and arm file agree where they do not as they stand.

    Parameters
    ----------
    logs : sequence of Log
        Logs of the arm.
    arm : Arm
        Nominal model, of kind ``"serial"``.

    Returns
    -------
    Corrections
        How columns are to be read; empty where nothing is wrong.
    list of Check
        What is wrong, at most one.
    """
    stands = fit(logs, arm)
    if stands is None or (stands.share.max() < _SUSPICIOUS and stands.distance < _FAR * arm.n_joints):
        return Corrections(), []
    tried = [
        (reading, fit([reading.corrections.on_log(log) for log in logs], reading.corrections.on_arm(arm)))
        for reading in _offered(logs, arm)
    ]
    found = [(reading, other) for reading, other in tried if other is not None]
    if not found:
        return Corrections(), []
    best, least = min(found, key=lambda pair: pair[1].cost)
    gained = stands.cost - least.cost
    if least.cost > _BETTER * stands.cost or least.share.max() > max(_EXPLAINS, 0.5 * stands.share.max()):
        return Corrections(), []
    remedies = _alike(best, least.cost + _ALIKE * gained, logs, arm)
    for other, result in found:
        if other is not best and result.cost - least.cost < _ALIKE * gained:
            remedies += [remedy for remedy in other.remedies if remedy not in remedies]
    worst = int(np.argmax(stands.share - least.share))
    message = (
        f"logs and arm file agree as if {best.what}: of joint {worst + 1}'s torque {_percent(stands.share[worst])} stays unexplained as the "
        f"columns stand (RMS) and {_percent(least.share[worst])} read like that"
    )
    return best.corrections, [Check(best.check, "error", message, tuple(remedies), best.joint)]


def _alike(best: Reading, most: float, logs: Sequence[Log], arm: Arm) -> list[str]:
    """Remedies of a reading: its own, and of the others those that explain the logs as well.

    On planar arms the equation of motion is odd in positions and torques together, so that a sign may be mended on either; on serial arms that
    holds only where the chain is its own mirror image.
    """
    remedies = [best.remedies[0]]
    for remedy in best.remedies[1:]:
        corrections = _of_options(remedy)
        result = (
            None if corrections is None else fit([corrections.on_log(log) for log in logs], corrections.on_arm(arm))
        )
        if result is None or result.cost < most:
            remedies.append(remedy)
    return remedies


def _of_options(remedy: str) -> Corrections | None:
    """Corrections that a remedy such as ``--flip q1,tau2`` stands for; None for one that is no list of corrections."""
    words = remedy.split()
    if len(words) % 2 or any(word not in ("--flip", "--zero", "--swap") for word in words[::2]):
        return None
    given: dict[str, list[str]] = {}
    for option, word in zip(words[::2], words[1::2], strict=True):
        given.setdefault(option.removeprefix("--"), []).append(word)
    return Corrections.parse(**given)


def _percent(share: float) -> str:
    percent = 100 * float(np.sqrt(share))
    return f"{percent:.0f} %" if percent >= 10 else f"{percent:.2g} %"


def _offered(logs: Sequence[Log], arm: Arm) -> Iterator[Reading]:
    travel = max(float(np.ptp(log.q, axis=0).max()) for log in logs)
    for readings in _READINGS:
        yield from readings(arm, travel)


def fit(logs: Sequence[Log], arm: Arm) -> Fit | None:
    """Estimate the arm's parameters from torques; None where the logs hold too few samples."""
    if arm.chain is None:
        return None
    chain = arm.chain.native()
    most = max(_MOST_INTERVALS // len(logs), 1)
    rows = [found for log in logs if (found := _rows(chain, log, most)) is not None]
    if not rows:
        return None
    y = np.concatenate([torque for torque, _ in rows])
    psi = np.concatenate([regressor for _, regressor in rows])
    free = arm.sigma > 0
    precision = np.zeros(len(arm.sigma))
    precision[free] = arm.sigma[free] ** -2.0
    square = (y**2).mean(axis=0)
    moved = square > 0
    if not moved.any():
        return None
    effective = len(y) / _CORRELATED
    variance = np.where(moved, 0.01 * square, 1.0)
    theta = arm.theta
    residual = y
    for _ in range(_ROUNDS):
        theta = _estimate(y, psi, moved / variance / _CORRELATED, arm.theta, precision, arm.n_joints)
        residual = y - psi @ theta
        variance = np.where(moved, np.maximum((residual**2).mean(axis=0), 1e-8 * square), 1.0)
    distance = float((precision * (theta - arm.theta) ** 2).sum())
    share = np.where(moved, (residual**2).mean(axis=0) / np.where(moved, square, 1.0), 0.0)
    # Measured from one part in 10,000, below which a joint's torque is as good as explained.
    likelihood = effective * float(np.log(np.maximum(share[moved], 1e-4) / 1e-4).sum())
    return Fit(likelihood + distance, share, distance)


def _estimate(y: Array, psi: Array, weights: Array, prior: Array, precision: Array, n_joints: int) -> Array:
    """Weighted least squares with a prior; rotor inertias and friction are held at zero where they would be negative."""
    scaled = psi * np.sqrt(weights)[None, :, None]
    flat = scaled.reshape(-1, psi.shape[2])
    normal = flat.T @ flat
    right = flat.T @ (y * np.sqrt(weights)).ravel() + precision * prior
    normal[np.diag_indices_from(normal)] += precision
    held = precision == 0
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


def _rows(chain: _native.Chain, log: Log, most: int) -> tuple[Array, Array] | None:
    """Torques, shape (rows, n), and regressors, shape (rows, n, 13 n), of one log in the weak form."""
    period = float(np.median(np.diff(log.t)))
    taps = max(round(_HALF_WIDTH_S / period), _FEWEST_PERIODS)
    count = min(len(log) - 1, most)
    if count < 4 * taps:
        return None
    begin = (len(log) - 1 - count) // 2
    part = slice(begin, begin + count)
    h = np.diff(log.t)[part, None]
    q = 0.5 * (log.q[:-1] + log.q[1:])[part]
    mean_dq = np.diff(log.q, axis=0)[part] / h
    dq = _smoothed(mean_dq, taps // 2)
    n = q.shape[1]
    edge = np.arange(2 * taps + 1) / taps - 1.0
    area = 0.5 * (edge + np.sin(np.pi * edge) / np.pi)
    weight = np.diff(area)
    rise = np.diff(0.5 * (1.0 + np.cos(np.pi * edge))) / (taps * period)
    starts = np.arange(0, count - 2 * taps, max(taps // 2, 1))
    index = starts[:, None] + np.arange(2 * taps)[None, :]
    momentum = np.zeros((count, n, 13 * n))
    rest = np.zeros_like(momentum)
    q, mean_dq, dq = (np.ascontiguousarray(x) for x in (q, mean_dq, dq))
    momentum[:, :, : 10 * n] = chain.momentum_regressor(q, mean_dq)
    rest[:, :, : 10 * n] = chain.potential_regressor(q, dq)
    joints = np.arange(n)
    momentum[:, joints, 10 * n + joints] = mean_dq
    rest[:, joints, 11 * n + joints] = dq
    rest[:, joints, 12 * n + joints] = np.sign(dq)
    tau = log.tau[:-1][part]
    torque = np.einsum("k,wkj->wj", weight, tau[index])
    regressor = np.zeros((len(starts), n, 13 * n))
    for k in range(2 * taps):
        at = starts + k
        regressor += weight[k] * rest[at] - rise[k] * momentum[at]
    return torque, regressor


def _smoothed(x: Array, half: int) -> Array:
    """Running mean over `half` samples to either side, shorter at the ends."""
    total = np.concatenate([np.zeros((1, x.shape[1])), np.cumsum(x, axis=0)])
    at = np.arange(len(x))
    low, high = np.maximum(at - half, 0), np.minimum(at + half + 1, len(x))
    return np.asarray((total[high] - total[low]) / (high - low)[:, None])
