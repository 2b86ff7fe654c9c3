"""States in which joint torques of two models are compared: along the diagnosed motion, and at random within the arm's range."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.diagnosis.result import Diagnosis

__all__ = ["States", "any_states", "diagnosed_states", "positions"]

Array = NDArray[np.float64]
States = tuple[Array, Array, Array]
"""Positions, velocities and accelerations of states of an arm, shape (n_states, n_joints) each."""

#: Number of states taken from the diagnosed motion, and number of random states.
_STATES = 400
#: Half width of the local cubics that give velocities and accelerations [s]: that of the test functions of the diagnosis.
_HALF_WIDTH_S = 0.05
#: Smallest number of samples of a local cubic.
_MIN_CUBIC_SAMPLES = 7
#: Standard deviations of speed [rad/s or m/s] and acceleration [rad/s^2 or m/s^2] of random states.
_SPEED, _ACCELERATION = 1.0, 3.0


def positions(diagnosis: Diagnosis, n: int) -> list[tuple[Array, Array]]:
    """Return times [s] and measured positions, shape (n_samples, n_joints), of the holdout logs that the diagnosis holds for its curves."""
    logs: dict[str, dict[int, tuple[Array, Array]]] = {}
    for s in diagnosis.extra.get("series", ()):
        logs.setdefault(s["log"], {})[s["joint"]] = (np.array(s["t"]), np.array(s["measured"]))
    whole = [joints for joints in logs.values() if len(joints) == n]
    return [(joints[1][0], np.column_stack([joints[j + 1][1] for j in range(n)])) for joints in whole]


def diagnosed_states(diagnosis: Diagnosis, n: int) -> States | None:
    """Return states along the diagnosed holdout motion, from local cubics; None if the diagnosis holds no motion."""
    found: list[Array] = []
    logs = [(t, q) for t, q in positions(diagnosis, n) if len(t) > 2 * _MIN_CUBIC_SAMPLES]
    for t, q in logs:
        count = max(_STATES // len(logs), 1)
        for k in np.linspace(_MIN_CUBIC_SAMPLES, len(t) - 1 - _MIN_CUBIC_SAMPLES, count).astype(int):
            near = np.flatnonzero(np.abs(t - t[k]) <= _HALF_WIDTH_S)
            if len(near) < _MIN_CUBIC_SAMPLES:
                near = np.arange(k - _MIN_CUBIC_SAMPLES // 2, k + _MIN_CUBIC_SAMPLES // 2 + 1)
            powers = (t[near] - t[k])[:, None] ** np.arange(4)
            cubic = np.linalg.lstsq(powers / np.abs(powers).max(axis=0), q[near], rcond=None)[0]
            cubic /= np.abs(powers).max(axis=0)[:, None]
            found.append(np.array([cubic[0], cubic[1], 2.0 * cubic[2]]))
    if not found:
        return None
    q, dq, ddq = np.ascontiguousarray(np.swapaxes(found, 0, 1))
    return q, dq, ddq


def any_states(arm: Arm) -> States:
    """Return random states of a serial arm: positions within the limits of each joint, but at most within half a turn or 0.5 m of zero."""
    chain, rng = arm.chain, np.random.default_rng(1)
    assert chain is not None
    reach = np.where(chain.rotary, math.pi, 0.5)
    low, high = np.maximum(chain.lower, -reach), np.minimum(chain.upper, reach)
    low, high = np.minimum(low, high), np.maximum(low, high)
    shape = (_STATES, chain.n_joints)
    return (
        rng.uniform(low, high, shape),
        rng.uniform(-_SPEED, _SPEED, shape),
        rng.uniform(-_ACCELERATION, _ACCELERATION, shape),
    )
