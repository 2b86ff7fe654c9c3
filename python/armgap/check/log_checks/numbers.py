"""Numbers about a column that several checks use: step of its grid, noise at high frequencies, travel per row."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["ORDERS", "blocks", "from_neighbours", "grid_step", "noise_by_order", "rounding", "travel_per_row"]

Array = NDArray[np.float64]

# Number and length [rows] of the blocks, evenly spread over a log, that checks are computed from: accurate to a few per cent at bounded cost.
_BLOCKS, _BLOCK_ROWS = 16, 4096

# Values lie on a grid if at least this share (second number) of their differences lies so close (first number, in steps) to whole steps.
_GRID_TOLERANCE, _ON_GRID_SHARE = 0.1, 0.97
# Smallest number of distinct values from which the step of a grid is determined.
_FEWEST_LEVELS = 6
# Values closer to each other than this part of the largest count as one value.
_EQUAL_VALUE_TOLERANCE = 1e-12

ORDERS = (4, 6, 8, 10, 12)
"""Orders of the differences that measure noise: motion fades with the order, white noise stays."""


def blocks(n: int) -> list[slice]:
    """Return slices of the rows that checks of a log are computed from: all n rows of a short log, evenly spread blocks of a long log."""
    if n <= _BLOCKS * _BLOCK_ROWS:
        return [slice(0, n)]
    starts = np.linspace(0, n - _BLOCK_ROWS, _BLOCKS).astype(int)
    return [slice(int(a), int(a) + _BLOCK_ROWS) for a in starts]


def grid_step(values: Array) -> float | None:
    """Return the step of the grid that values lie on; None for values without a grid, or with too few distinct values.

    Examples
    --------
    >>> round(grid_step(np.round(np.sin(np.arange(4000) / 50.0) / 2e-3) * 2e-3), 9)
    0.002
    >>> grid_step(np.sin(np.arange(4000) / 50.0)) is None
    True
    """
    levels = np.unique(values)
    gaps = np.diff(levels)
    gaps = gaps[gaps > _EQUAL_VALUE_TOLERANCE * max(float(np.abs(levels[[0, -1]]).max()), 1e-300)]
    if len(gaps) < _FEWEST_LEVELS - 1:
        return None
    step = float(gaps.min())
    for most in (3, 30):  # small multiples first, so that the first guess's error does not add up
        near = gaps < (most + 0.5) * step
        step = float(np.sum(gaps[near]) / np.sum(np.round(gaps[near] / step)))
    off = np.abs(gaps / step - np.round(gaps / step))
    return step if float(np.mean(off < _GRID_TOLERANCE)) > _ON_GRID_SHARE else None


def rounding(q: Array) -> float:
    """Return the rounding error of positions [rad or m] in the number format, single or double precision, that they were stored in."""
    largest = float(np.max(np.abs(q), initial=0.0))
    single = bool(np.all(q == q.astype(np.float32)))
    return largest * float(np.finfo(np.float32 if single else np.float64).eps)


def travel_per_row(q: Array, half: int) -> Array:
    """Return the travel of a position per row, net over `half` rows to either side, shape (n_samples,)."""
    n = len(q)
    rows = np.arange(n)
    after, before = np.minimum(rows + half, n - 1), np.maximum(rows - half, 0)
    return np.asarray(np.abs(q[after] - q[before]) / np.maximum(after - before, 1))


def noise_by_order(pieces: list[Array], wanted: list[NDArray[np.bool_]]) -> tuple[Array, Array]:
    """Return the standard deviation of white noise by differences of each of `ORDERS`: from mean squares, and from medians.

    White noise gives equal values by every order; motion, and filtered noise, smaller values by higher orders.
    """
    by_squares, by_median = [], []
    for order in ORDERS:
        half = order // 2
        left = [
            np.diff(q, n=order)[w[half : len(q) - half]] for q, w in zip(pieces, wanted, strict=True) if len(q) > order
        ]
        d = np.concatenate(left) / math.sqrt(math.comb(2 * order, order))
        by_squares.append(math.sqrt(float(d @ d) / max(len(d), 1)))
        by_median.append(float(np.median(np.abs(d))) / 0.6745 if len(d) else 0.0)
    return np.array(by_squares), np.array(by_median)


def from_neighbours(t: Array, q: Array) -> Array:
    """Return the errors of positions from the cubic through two rows before and two rows after, scaled to the noise of one row.

    Parameters
    ----------
    t : ndarray, shape (n_samples,)
        Sample times [s], at least five.
    q : ndarray, shape (n_samples, n_joints)
        Positions [rad or m].

    Returns
    -------
    ndarray, shape (n_samples - 4, n_joints)
        Scaled errors [rad or m]: white noise of standard deviation s gives s, whatever the times.
    """
    n = len(t)
    x = [t[2 + i : n - 2 + i] - t[2 : n - 2] for i in (-2, -1, 1, 2)]
    miss = q[2 : n - 2].copy()
    squares = np.ones(n - 4)
    for i, shift in enumerate((-2, -1, 1, 2)):
        others = [x[k] for k in range(4) if k != i]
        weight = -(others[0] * others[1] * others[2])
        for other in others:
            weight = weight / (x[i] - other)
        miss -= weight[:, None] * q[2 + shift : n - 2 + shift]
        squares += weight * weight
    return np.asarray(miss / np.sqrt(squares)[:, None])
