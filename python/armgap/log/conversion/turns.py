"""Jumps of positions by a whole turn, where a single-turn encoder wraps around."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["TURN", "turn_jumps", "unwrapped"]

TURN = 2 * math.pi
"""One turn of a rotary joint [rad]."""

# Difference, in turns (0.02 turns are 0.13 rad), by which a jump less its turn may exceed the largest of the steps around it.
_SMOOTH = 0.02
# Number of steps to either side that a jump is compared with; a held position makes at most so many steps zero.
_AROUND = 8


def turn_jumps(q: NDArray[np.float64], turn: float = TURN) -> NDArray[np.intp]:
    """Return, for each step of `q`, the number of turns by which it wraps around: -1, 0 or 1.

    A step counts if the path goes on smoothly without the turn and jumps with it; fast motion, whose steps are all alike, has none.

    Parameters
    ----------
    q : ndarray, shape (n_samples,)
        Positions.
    turn : float, default 2 pi
        One turn in the unit of `q`.

    Returns
    -------
    ndarray, shape (n_samples - 1,)

    Examples
    --------
    >>> turn_jumps(np.array([2.9, 3.0, 3.1, 3.2 - TURN, 3.3 - TURN, 3.4 - TURN]))
    array([ 0,  0, -1,  0,  0])
    """
    steps = np.diff(q)
    turns = np.zeros(len(steps), dtype=np.intp)
    at = np.flatnonzero(np.abs(steps) > turn / 2)
    if not len(at) or len(steps) < 3:
        return turns
    sign = np.sign(steps[at])
    rest = steps.copy()
    rest[at] -= sign * turn
    near = np.clip(at[:, None] + np.arange(-_AROUND, _AROUND + 1), 0, len(steps) - 1)
    beside = near != at[:, None]
    largest = np.max(np.abs(rest[near]), axis=1, where=beside, initial=0.0)
    middle = np.median(steps[near], axis=1)
    smooth = np.abs(rest[at]) <= largest + _SMOOTH * turn
    jumps = (np.abs(steps[at] - middle) > turn / 2) & (largest < turn / 3)
    kept = smooth & jumps
    turns[at[kept]] = sign[kept].astype(np.intp)
    return turns


def unwrapped(q: NDArray[np.float64], turn: float = TURN) -> NDArray[np.float64]:
    """Return positions with jumps by a turn removed, the first position unchanged; `q` itself without jumps."""
    turns = turn_jumps(q, turn)
    return np.concatenate([q[:1], q[1:] - turn * np.cumsum(turns)]) if turns.any() else q
