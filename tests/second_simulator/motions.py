"""Reference motions of the second simulator's controller: a multisine, or moves from point to point with dwells between them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .cases import Machine

Array = np.ndarray
TURN = 2.0 * math.pi
#: Moves from point to point: largest distance [rad] of a point from zero, smallest and largest peak speed [rad/s], shortest duration of a
#: move [s], and shortest and longest dwell after it [s].
REACH = 1.1
PEAK_SPEEDS = (1.0, 3.5)
SHORTEST_MOVE = 0.25
DWELLS = (0.1, 0.7)


def multisine(rng: np.random.Generator, t: Array) -> Array:
    """Draw the path [rad] of one joint at the times `t` [s]: three to six sines of 0.15 to 1.6 Hz that fade in over 0.8 s."""
    fade = 0.5 * (1 - np.cos(np.pi * np.minimum(t / 0.8, 1.0)))
    k = int(rng.integers(3, 7))
    f = np.exp(rng.uniform(math.log(0.15), math.log(1.6), k))
    size = rng.uniform(0.3, 1.0, k) / np.sqrt(f)
    size *= rng.uniform(0.5, 1.1) / np.sqrt(np.sum(size**2) / 2)
    phase = rng.uniform(0, TURN, k)
    wave = size[:, None] * np.sin(TURN * f[:, None] * t + phase[:, None])
    return fade * (rng.uniform(-0.4, 0.4) + wave.sum(0)) * 0.8


def moves(rng: np.random.Generator, t: Array) -> Array:
    """Draw the path [rad] of one joint at the times `t` [s]: moves between points by polynomials of fifth degree, with dwells between them."""
    path, now, begin = np.zeros(len(t)), 0.0, 0.3
    while begin < t[-1]:
        distance = float(rng.uniform(-REACH, REACH)) - now
        # The peak speed of a move of fifth degree is 15/8 of its mean speed.
        duration = max(SHORTEST_MOVE, 1.875 * abs(distance) / float(rng.uniform(*PEAK_SPEEDS)))
        s = np.clip((t - begin) / duration, 0.0, 1.0)
        path += distance * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        now, begin = now + distance, begin + duration + float(rng.uniform(*DWELLS))
    return path


def draw_reference(
    rng: np.random.Generator,
    machine: Machine,
    duration: float,
    path: Callable[[np.random.Generator, Array], Array] = multisine,
) -> Array:
    """Return a reference with gains of a PD controller, with gravity as feed-forward or none, shape (n_samples, 2, 6)."""
    n = round(duration / machine.period)
    t = machine.period * np.arange(n)
    out = np.zeros((n, 2, 6))
    bandwidth = rng.uniform(8.0, 16.0)
    for j in range(2):
        q = path(rng, t)
        out[:, j, 0] = q
        out[:, j, 1] = np.gradient(q, machine.period)
        out[:, j, 3] = machine.inertia[j] * bandwidth**2
        out[:, j, 4] = 1.4 * machine.inertia[j] * bandwidth
        out[:, j, 5] = machine.limit[j]
    if rng.uniform() < 0.5:
        theta = machine.theta
        out[:, 1, 2] = theta[4] * np.sin(out[:, 0, 0] + out[:, 1, 0])
        out[:, 0, 2] = theta[3] * np.sin(out[:, 0, 0]) + out[:, 1, 2]
    return out
