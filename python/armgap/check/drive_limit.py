"""Drives that are limited in size or in rate: the torque that acts on a joint where its command exceeds what the drive delivers.

A limit is an effect, for a diagnosis to name (`torque_saturation`), and here a nuisance: beside a drive that saturates far below its command no
reading of the columns explains the torques. So each reading, the log as it stands included, is judged together with the limits that explain its
torques best.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.check.equation_error import EquationError, Fit, Mask, Rows, bounds
from armgap.log.log import Log

__all__ = [
    "DRIVEN",
    "LIMITED",
    "PARAMETER_BOUND_FACTOR",
    "TAKEN",
    "TRIED",
    "Delivered",
    "as_commanded",
    "at_best_level",
    "at_level",
    "at_rates",
    "deliver",
    "delivered",
    "limited",
    "slewed",
]

Array = NDArray[np.float64]
T = TypeVar("T")

# Share of unexplained torque below which a limit of the drive explains a joint. Drives that are limited leave 0.03 at most, torques in reversed time
# order 0.31 and more at their best limit of size or rate (four development cases each).
LIMITED = 0.2
# Where a reading leaves this share of a torque, a limit of the drive or an elastic torque is added to the model, and kept where it halves that share:
# sound logs and factors alone leave 0.02 at most, drives that saturate 0.2 to 0.6 and behind their limit 0.01 to 0.05 (five development cases of six;
# 0.35 in one that is hardly ever below its limit), springs and stops 0.1 to 0.4 and less than 0.03 with the elastic torque (three of five). Where
# that share stays, predictions have to agree: friction without bound and another size of all torques have left 0.14 to 0.25 of two runs of a real arm
# whose torques were in newton metres.
TRIED = 0.1
TAKEN = 0.5
# Parameters may differ from the arm file by this factor while a torque's factor, or the limit that is tried in its place, is estimated.
PARAMETER_BOUND_FACTOR = 2.0
# Quantiles of a torque's size at which a drive's limit is tried: a limit between two quantiles still explains what no factor does.
_LIMIT_QUANTILES = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
# Times [s] that a drive with a limited rate of torque may need for the range of its commands, each a quarter longer than the one before: the shortest
# shows in no log, the longest leaves a constant torque. A rate between two of them is met to 12 %, which leaves far less torque unexplained than
# columns of another arm do.
_SLEW_TIMES = tuple(0.05 * 1.25**k for k in range(25))
# A joint is driven if its commands' mean square exceeds this part of that of the largest term of its equation of motion; a joint that is
# not driven, as the passive joint of an acrobot, has no torque to be explained.
DRIVEN = 0.1
# Ratio of unexplained shares within a level of torque and without one from which no smaller level is tried; where the level is the largest
# command the ratio is one but for rounding. Without a limit the share rises by up to 3 % within the 95 % quantile (sample case); of 60 limits that
# halve the share none would be missed so (17 development cases).
_WORSE = 1.001
# Ratio of a level's unexplained share to the largest acceptable one up to which it is refined; the largest of 60 that were accepted was 1.06.
_REFINED = 2.0
# Steps by golden section from the best quantile's neighbours (or zero, or the largest command) to the level, known to 2 % of their distance then.
_SECTIONS = 8
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


@dataclass(frozen=True)
class Delivered:
    """Fit of an arm to logs whose drives may saturate.

    Attributes
    ----------
    levels : ndarray, shape (n_joints,)
        Torque beyond which the command of each drive has no effect [N m or N]; infinite where no limit is needed.
    errors : EquationError
        Equation error of the torques within these levels.
    fit : Fit
        Bounded fit to these torques.
    driven : ndarray, shape (n_joints,)
        Mask of the joints that are driven, by their commands.
    """

    levels: Array
    errors: EquationError
    fit: Fit
    driven: NDArray[np.bool_]

    @property
    def closeness(self) -> float:
        """Closeness of the fit, relative to the delivered torques (`Fit.closeness`)."""
        return self.errors.of_torques(self.fit).closeness

    def of_torque(self, joint: int) -> float:
        """Return the unexplained share of the torque that the drive of a joint (from 0) delivers, however small that torque is."""
        return float(self.errors.of_torques(self.fit).share[joint])

    @property
    def unexplained(self) -> Array:
        """Unexplained share of the torque that each joint's drive delivers; of a joint that is not driven, of the largest term of its equation."""
        return np.where(self.driven, self.errors.of_torques(self.fit).share, self.fit.share)

    @property
    def limits_tried(self) -> NDArray[np.bool_]:
        """Mask of the joints that are driven and whose torque is not explained, so that a limit of the drive is tried."""
        return self.driven & (self.unexplained >= TRIED)


def deliver(logs: Sequence[Log], levels: Array) -> list[Log]:
    """Return the logs with torques of at most `levels` [N m or N], one level per joint; the logs themselves without a finite level."""
    if not np.isfinite(levels).any():
        return list(logs)
    return [_with_torques(log, np.clip(log.tau, -levels, levels)) for log in logs]


def as_commanded(errors: EquationError, low: Array, high: Array) -> Delivered:
    """Return the fit, parameters between `low` and `high`, of an arm whose drives deliver what they are commanded."""
    driven = errors.square >= DRIVEN * errors.scale
    return Delivered(np.full(errors.arm.n_joints, np.inf), errors, errors.fit(low, high), driven)


def delivered(
    logs: Sequence[Log],
    arm: Arm,
    *between: Array,
    stands: EquationError | None = None,
    rows: Sequence[Rows] | None = None,
) -> Delivered:
    """Fit an arm to logs, together with the levels at which drives saturate where the arm alone leaves much torque unexplained.

    Parameters
    ----------
    logs : sequence of Log
        Logs of the arm, as they are read.
    arm : Arm
        The arm.
    *between : ndarray, shape (n_parameters,)
        Smallest and largest parameters; `bounds` of the arm by default.
    stands : EquationError, optional
        Equation error of the log as it stands, if `logs` are another reading of it.
    rows : sequence of Rows, optional
        Rows of `logs`, where they are known.
    """
    low, high = between or bounds(arm)
    if rows is None:
        rows = [Rows.of(log, arm) for log in logs]
    errors = EquationError(rows, arm) if stands is None else EquationError(rows, arm, stands.scale, stands.terms)
    now = as_commanded(errors, low, high)
    for joint in np.flatnonzero(now.limits_tried):
        limited = _at_best_level(int(joint), logs, now, low, high)
        if limited.of_torque(int(joint)) < _acceptable(now.of_torque(int(joint))):
            now = limited
    return now


def _acceptable(unlimited: float) -> float:
    """Return the unexplained share of a joint's torque below which a limit of its drive is accepted, from the share without a limit."""
    return min(LIMITED, TAKEN * unlimited) if np.isfinite(unlimited) else np.inf


def _at_best_level(joint: int, logs: Sequence[Log], now: Delivered, low: Array, high: Array) -> Delivered:
    """Return the fit with the level of one joint's drive that leaves least of the delivered torque unexplained; other levels are those of `now`."""

    def at(level: float) -> Delivered:
        tried = np.where(np.arange(len(now.levels)) == joint, level, now.levels)
        rows = zip(now.errors.rows, logs, strict=True)
        errors = now.errors.with_rows(
            [r.with_torque(log, joint, np.clip(log.tau[:, joint], -level, level)) for r, log in rows], joint
        )
        return Delivered(tried, errors, errors.fit(low, high), now.driven)

    return at_best_level(at, logs, joint, lambda found: found.of_torque(joint), now.of_torque(joint))


def at_best_level(
    at: Callable[[float], T], logs: Sequence[Log], joint: int, share: Callable[[T], float], unlimited: float = np.inf
) -> T:
    """Return what `at` finds at the level [N m or N] of a joint's drive where `share` of it is least, by a grid of levels and golden section.

    Levels are tried from the largest on. A drive that is limited is closer to its commands within any level between its own and the largest
    command, so the search ends at the first level that explains the torques worse than `unlimited`, the share without a limit, and a level on
    the grid that is far from acceptable is not refined.
    """
    sizes = np.abs(np.concatenate([log.tau[:, joint] for log in logs]))
    grid = np.unique(np.quantile(sizes, _LIMIT_QUANTILES))
    # A level of zero is no drive, and would explain a joint that never moves.
    grid = grid[grid > 0] if grid[-1] > 0 else np.array([sizes.max()])
    on_grid: dict[int, T] = {}
    for i in reversed(range(len(grid))):
        on_grid[i] = at(grid[i])
        if share(on_grid[i]) > _WORSE * unlimited:
            break
    best = min(on_grid, key=lambda i: share(on_grid[i]))
    if share(on_grid[best]) > min(unlimited, _REFINED * _acceptable(unlimited)):
        return on_grid[best]
    a, b = np.concatenate([[0.0], grid, [sizes.max()]])[[best, best + 2]]
    left, right = at(b - _GOLDEN * (b - a)), at(a + _GOLDEN * (b - a))
    for _ in range(_SECTIONS):
        if share(left) < share(right):
            b, right = a + _GOLDEN * (b - a), left
            left = at(b - _GOLDEN * (b - a))
        else:
            a, left = b - _GOLDEN * (b - a), right
            right = at(a + _GOLDEN * (b - a))
    return min((on_grid[best], left, right), key=share)


def limited(
    base: EquationError, logs: Sequence[Log], joint: int, masks: Sequence[Mask] | None = None
) -> tuple[EquationError, Fit]:
    """Return the equation error and the best fit with the torques of one joint of logs (`base`) limited in size or in rate.

    A limit in size far below the command looks like a small factor, a limit in rate like columns of another arm. With `masks`, one per log, only
    the rows within these count (`Rows.within`).
    """
    low, high = bounds(base.arm, PARAMETER_BOUND_FACTOR)

    def of(errors: EquationError) -> tuple[EquationError, Fit]:
        if masks is not None:
            errors = EquationError([r.within(mask) for r, mask in zip(errors.rows, masks, strict=True)], base.arm)
        return errors, errors.of_torques(errors.fit(low, high))

    def closeness(found: tuple[EquationError, Fit]) -> float:
        return found[1].closeness

    sized = at_best_level(lambda level: of(at_level(base, logs, joint, level)[1]), logs, joint, closeness)
    return min((sized, *(of(errors) for _, errors in at_rates(base, logs, joint))), key=closeness)


def at_level(base: EquationError, logs: Sequence[Log], joint: int, level: float) -> tuple[list[Log], EquationError]:
    """Return logs (`base`) with one joint's torques within a level [N m or N], and their equation error."""
    return _of_joint(base, logs, joint, [np.clip(log.tau[:, joint], -level, level) for log in logs])


def at_rates(base: EquationError, logs: Sequence[Log], joint: int) -> Iterator[tuple[list[Log], EquationError]]:
    """Yield logs (`base`) with one joint's torques limited in rate, and their equation error, for each rate that is tried."""
    tau = [log.tau[:, joint] for log in logs]
    rates = max(float(np.ptp(x)) for x in tau) / np.array(_SLEW_TIMES)
    behind = (slewed(log.t, x, rates) for log, x in zip(logs, tau, strict=True))
    for torques in zip(*behind, strict=True):
        yield _of_joint(base, logs, joint, torques)


def _of_joint(
    base: EquationError, logs: Sequence[Log], joint: int, torques: Sequence[Array]
) -> tuple[list[Log], EquationError]:
    """Return the logs with other torques of one joint, and their equation error."""
    there = [_with_torques(log, x, joint) for log, x in zip(logs, torques, strict=True)]
    rows = zip(base.rows, logs, torques, strict=True)
    return there, base.with_rows([r.with_torque(log, joint, x) for r, log, x in rows], joint)


def slewed(t: Array, tau: Array, rates: Array) -> Array:
    """Return torques that follow their commands at each of `rates` [N m/s or N/s] at most, from the first command on, shape (n_rates, n_samples)."""
    torques = np.empty((len(rates), len(tau)))
    torques[:, 0] = now = np.full(len(rates), tau[0])
    for k, (step, command) in enumerate(zip(np.outer(np.diff(t), rates), tau[1:], strict=True), start=1):
        torques[:, k] = now = np.minimum(np.maximum(command, now - step), now + step)
    return torques


def _with_torques(log: Log, torques: Array, joint: int | None = None) -> Log:
    """Return a log with other torques, of all joints or of one joint (from 0); a torque that is changed is constant over its interval."""
    tau = log.tau.copy()
    tau[:, slice(None) if joint is None else joint] = torques
    moment = None if log.moment is None else np.where(tau == log.tau, log.moment, 0.0)
    return replace(log, tau=tau, moment=moment)
