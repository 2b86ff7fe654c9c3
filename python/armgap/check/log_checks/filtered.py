"""Positions that are smoother than an encoder can measure: low-passed, interpolated from a slower rate, or fitted.

A raw encoder adds white noise, its step over the square root of 12 while the joint moves: normalised differences of every order give
the same standard deviation of noise once motion has faded. A low-pass leaves less noise, and less by higher orders; interpolation leaves
none between its knots. Positions that are exact to their last digit come from no encoder; a simulation of dry friction still has
the kinks of its reversals, which a low-pass would have smoothed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.check.check import Check
from armgap.check.log_checks.numbers import (
    ORDERS,
    blocks,
    from_neighbours,
    grid_step,
    noise_by_order,
    rounding,
    travel_per_row,
)
from armgap.check.log_checks.outcome import NOTHING, Outcome
from armgap.log.log import Log

__all__ = ["look"]

Array = NDArray[np.float64]

# Noise of a position below this part of the encoder's own noise shows that the position was filtered.
_OF_ENCODER = 0.5
# Ratio of noise by differences of order 6 to noise by order 12 from which noise counts as coloured, falling towards high frequencies.
_COLOURED = 1.3
# Encoder counts per row from which rounding noise is white.
_WHITE_COUNTS = 1.0
# A joint counts as moving where its travel per row exceeds this part of its usual fast travel per row.
_MOVES = 0.05
# Share of the rows in motion with held positions from which the defect is `repeated`, not a filter.
_MAX_HELD_SHARE = 0.1
# Rows in motion that the check of filtered positions needs, and reversals that an exact log has to pass smoothly.
_MIN_MOVING_ROWS, _REVERSALS = 200, 4
# Largest noise of positions that count as exact, in rounding errors, and factor on that noise for fourth differences that count as zero.
_EXACT_NOISE_ROUNDINGS, _FOURTH = 20.0, 8.0
# Deviation from a sample period, as a part of it, within which rows count as evenly spaced, so that differences are meaningful.
_EVEN_SPACING_TOLERANCE = 0.2
# Share of fourth differences that are zero between an interpolation's knots, ratio of the other differences to the rounding, and steps of a
# grid of positions that rounding to the grid makes more often than zero.
_PIECEWISE, _KNOTS, _FEW_COUNTS = 0.05, 1e3, 5
# Fourth differences at an interpolation's knots are of any size: their 90 % quantile is so many times their 5 % quantile, for at least so many
# knots. Steps of a grid make the ratio 4.
_ANY_SIZE, _FEWEST_KNOTS = 20.0, 20
# Share of a position's high frequencies that torques, with a positive inertia, have to explain to count as motion. A controller's
# torques follow the encoder's noise, filtered or not, by about half.
_MIN_EXPLAINED_SHARE = 0.9
_HALF = 6
_DOUBLE = float(np.finfo(np.float64).eps)


def look(log: Log, arm: Arm | None) -> Outcome:
    """Return the outcome with a check of the joints whose positions have less noise at high frequencies than any encoder."""
    steps = None if arm is None else arm.encoder_step
    found = []
    for j in range(log.n_joints):
        step = None if steps is None else float(steps[j])
        # Robots' descriptions seldom state friction: the joints of a serial arm are taken to have dry friction.
        dry = arm is None or arm.chain is not None or float(arm.theta[len(arm.theta) - arm.n_joints + j]) > 0
        why = _why(log, j, step, dry)
        if why:
            remedy = ("log positions as the encoder gives them",)
            found.append(Check("filtered_positions", "warning", f"q{j + 1} {why}", remedy, j + 1, log.name))
    return Outcome(tuple(found)) if found else NOTHING


def _why(log: Log, j: int, step: float | None, dry: bool) -> str:
    """Return why joint j's positions cannot come from a raw encoder; empty if no reason was found."""
    rows = blocks(len(log))
    pieces = [np.ascontiguousarray(log.q[r, j]) for r in rows]
    paces = [travel_per_row(q, _HALF) for q in pieces]
    usual = float(np.quantile(np.concatenate(paces), 0.9))
    grid = grid_step(np.concatenate(pieces))
    slowest = max(_MOVES * usual, _WHITE_COUNTS * max(step or 0.0, grid or 0.0))
    moving = [p > slowest for p in paces]
    count = sum(int(np.count_nonzero(m)) for m in moving)
    if count < _MIN_MOVING_ROWS or _stale(pieces, moving) > _MAX_HELD_SHARE * count:
        return ""
    even = [m & _even(log.t[r], log.sample_period) for r, m in zip(rows, moving, strict=True)]
    spaced = sum(int(np.count_nonzero(m)) for m in even) >= _MIN_MOVING_ROWS
    least = _over_times(log, j, rows, moving)
    if spaced:
        squares, middle = noise_by_order(pieces, even)
        exact = _EXACT_NOISE_ROUNDINGS * max(rounding(q) for q in pieces)
        if why := _unmeasured(pieces, even, exact, grid or 0.0):
            return why
        if middle[-1] <= exact:
            smooth = (
                dry
                and squares[-1] <= _EXACT_NOISE_ROUNDINGS * _DOUBLE * _largest(pieces)
                and _reversals(pieces, even) >= _REVERSALS
            )
            return "is smooth to its last digit, reversals included: filtered, fitted or computed" if smooth else ""
        least = min(least, float(squares.min()))
    driven = _driven(log, j, rows, even) if spaced else False
    if step is not None and least < _OF_ENCODER * step / np.sqrt(12) and not driven:
        return (
            f"has noise of {least:.2g} at high frequencies where the encoder's step of {step:.3g} makes {step / np.sqrt(12):.2g}: "
            "filtered, interpolated, or of a finer encoder than the arm file's"
        )
    if grid is not None and least < _OF_ENCODER * grid / np.sqrt(12) and not driven:
        return f"has noise of {least:.2g} at high frequencies, less than its own steps of {grid:.3g} make: filtered"
    if spaced and grid is None and not driven:
        falls = min(float(of[ORDERS.index(6)] / of[-1]) for of in (squares, middle))
        if falls > _COLOURED:
            return f"has noise that falls towards high frequencies (by a factor of {falls:.2g}), as no encoder's does: filtered"
    return ""


def _even(t: Array, period: float) -> NDArray[np.bool_]:
    """Return a mask of the rows from which the steps in time, over six rows to either side, are equal to the sample period `period` [s]."""
    off = np.append(0, np.cumsum(np.abs(np.diff(t) / period - 1) > _EVEN_SPACING_TOLERANCE))
    rows = np.arange(len(t))
    return np.asarray(off[np.minimum(rows + _HALF, len(t) - 1)] == off[np.maximum(rows - _HALF, 0)])


def _unmeasured(pieces: list[Array], moving: list[NDArray[np.bool_]], exact: float, grid: float) -> str:
    share = _between_knots(pieces, moving, max(_FOURTH * exact, 0.01 * grid), grid)
    if share <= _PIECEWISE:
        return ""
    return f"lies exactly on straight lines or cubics between knots in {100 * share:.0f} % of the rows: interpolated"


def _stale(pieces: list[Array], moving: list[NDArray[np.bool_]]) -> int:
    """Return the number of rows in motion that repeat the position before."""
    return sum(int(np.count_nonzero((q[1:] == q[:-1]) & m[1:])) for q, m in zip(pieces, moving, strict=True))


def _largest(pieces: list[Array]) -> float:
    return max(float(np.max(np.abs(q))) for q in pieces)


def _between_knots(pieces: list[Array], moving: list[NDArray[np.bool_]], exact: float, grid: float) -> float:
    """Return the share of rows with fourth differences of zero; 0 if the other differences are of one size, or are steps of a grid."""
    bends = np.concatenate([np.abs(np.diff(q, n=4)[m[2:-2]]) for q, m in zip(pieces, moving, strict=True)])
    zero = bends <= exact
    others = bends[~zero]
    if len(others) < _FEWEST_KNOTS:
        return 0.0
    small, large = np.quantile(others, (0.05, 0.9))
    if large < max(_KNOTS * exact, _ANY_SIZE * small):
        return 0.0
    if np.count_nonzero(others < (_FEW_COUNTS + 0.5) * grid) > 0.5 * np.count_nonzero(zero):
        return 0.0
    return float(np.mean(zero))


def _over_times(log: Log, j: int, rows: list[slice], moving: list[NDArray[np.bool_]]) -> float:
    """Return the noise of joint j's positions by cubics over the time stamps, which is valid for uneven times too."""
    left = np.concatenate(
        [from_neighbours(log.t[r], log.q[r, j : j + 1])[m[2:-2], 0] for r, m in zip(rows, moving, strict=True)]
    )
    return float(np.sqrt(np.mean(left**2)))


def _reversals(pieces: list[Array], moving: list[NDArray[np.bool_]]) -> int:
    signs = [np.sign(np.diff(q)[m[:-1]]) for q, m in zip(pieces, moving, strict=True)]
    return sum(int(np.count_nonzero(s[1:] != s[:-1])) for s in signs)


def _driven(log: Log, j: int, rows: list[slice], moving: list[NDArray[np.bool_]]) -> bool:
    """Whether torques explain joint j's high frequencies: with held torques, sixth differences of position follow fourth differences of torque."""
    if not log.has_torques:
        return False
    y = np.concatenate([np.diff(log.q[r, j], n=6)[m[3:-3]] for r, m in zip(rows, moving, strict=True)])
    columns = []
    for r, m in zip(rows, moving, strict=True):
        pushed = log.tau[r][:-1] + log.tau[r][1:]
        columns.append(np.diff(pushed, n=4, axis=0)[: len(m) - 6][m[3:-3]])
    x = np.concatenate(columns)
    total = float(y @ y)
    if total == 0 or not np.any(x):
        return False
    inverse_inertia = np.linalg.lstsq(x, y, rcond=None)[0]
    left = y - x @ inverse_inertia
    return bool(inverse_inertia[j] > 0) and float(left @ left) < (1 - _MIN_EXPLAINED_SHARE) * total
