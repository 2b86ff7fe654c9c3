"""Short windows of a log, predicted from measured starts by the arm file's model, and re-estimation of the model.

Which effects re-estimation can absorb depends on the model that a diagnosis re-estimates; so windows are predicted with
armgap's own dynamics, while the logs are simulated with MuJoCo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armgap import _native

Array = NDArray[np.float64]
#: Effect as the compiled simulator reads it: name, joint (from 1; None for the whole arm), parameters [SI].
NativeEffect = tuple[str, int | None, dict[str, float]]

#: Length of a prediction window, s.
WINDOW = 0.2
#: Half width of the local cubic that gives initial states, s, and the smallest number of samples on either side of its middle.
AROUND, FEWEST = 0.012, 4
#: Tolerances of a simulation, rad (m), tried in order until one is reached.
TOLERANCES = (1e-8, 1e-6, 1e-4)
#: Largest number of Gauss-Newton steps of a re-estimation, and step of its finite differences, in standard deviations of the prior.
_MAX_GAUSS_NEWTON_STEPS, _JACOBIAN_STEP_SIGMAS = 8, 1e-4


@dataclass(frozen=True)
class Mechanism:
    """Kind, gravity [m/s^2] and link lengths [m] of an arm, which stay fixed when its parameters are estimated."""

    kind: str
    gravity: float
    link_length: tuple[float, ...]


@dataclass(frozen=True)
class Window:
    """Prediction window of a log: times and torques, initial state as measured, and positions to predict.

    Attributes
    ----------
    t : ndarray, shape (n + 1,)
        Times [s].
    tau : ndarray, shape (n + 1, n_joints)
        Commanded torques [N m or N].
    q0, dq0 : ndarray, shape (n_joints,)
        Initial position [rad or m] and velocity, from a local cubic through the measured positions around the start.
    q : ndarray, shape (n, n_joints)
        Measured positions after the start [rad or m].
    """

    t: Array
    tau: Array
    q0: Array
    dq0: Array
    q: Array


def cut(t: Array, q: Array, tau: Array, length: float = WINDOW) -> list[Window]:
    """Return a log cut into consecutive prediction windows of `length` seconds."""
    h = float(np.median(np.diff(t)))
    rows, margin = round(length / h), max(FEWEST, round(AROUND / h))
    return [_window(t, q, tau, s, rows, margin) for s in range(margin, len(t) - max(rows, margin) - 1, rows)]


def _window(t: Array, q: Array, tau: Array, s: int, rows: int, margin: int) -> Window:
    near = slice(s - margin, s + margin + 1)
    cubic = np.polynomial.polynomial.polyfit(t[near] - t[s], q[near], 3)
    part = slice(s, s + rows + 1)
    fix = np.ascontiguousarray
    return Window(fix(t[part]), fix(tau[part]), fix(cubic[0]), fix(cubic[1]), q[s + 1 : s + rows + 1])


def misses(m: Mechanism, theta: Array, windows: Sequence[Window], effects: Sequence[NativeEffect] = ()) -> Array:
    """Return measured minus predicted positions [rad or m], shape (n_windows, n, n_joints).

    Raises
    ------
    ValueError
        No arm has these parameters, or the motion diverges.
    """
    return np.array([w.q - _predict(m, theta, w, effects) for w in windows])


def _predict(m: Mechanism, theta: Array, w: Window, effects: Sequence[NativeEffect]) -> Array:
    arm = (m.kind, m.gravity, list(m.link_length), theta.tolist())
    for tolerance in TOLERANCES:
        try:
            return _native.simulate(*arm, w.t, w.tau, w.q0, w.dq0, list(effects), tolerance)[0][1:]
        except ValueError as error:
            problem = error
    raise problem


def refit(
    m: Mechanism,
    theta: Array,
    sigma: Array,
    windows: Sequence[Window],
    noise: Array,
    effects: Sequence[NativeEffect] = (),
) -> Array:
    """Estimate the arm's parameters by Gauss-Newton, with a prior of mean `theta` and standard deviation `sigma`.

    Parameters
    ----------
    theta, sigma : ndarray, shape (n_parameters,)
        Mean and standard deviation of the prior; a parameter with `sigma` zero is fixed.
    windows : sequence of Window
        Windows to fit.
    noise : ndarray, shape (n_joints,)
        Standard deviation of a perfect model's prediction error, per joint [rad or m].
    effects : sequence of (name, joint, parameters)
        Effects added to the model, with fixed parameters.

    Returns
    -------
    ndarray, shape (n_parameters,)
        Estimated parameters [SI].
    """
    best, cost = theta, _cost(m, theta, theta, sigma, windows, noise, effects)
    for _ in range(_MAX_GAUSS_NEWTON_STEPS):
        step = _newton(m, best, theta, sigma, windows, noise, effects)
        for shrink in (1.0, 0.3, 0.1):
            trial = best + shrink * step
            found = _cost(m, trial, theta, sigma, windows, noise, effects)
            if found < cost:
                break
        else:
            return best
        done, best, cost = cost - found < 1e-3 * cost, trial, found
        if done:
            return best
    return best


def _cost(
    m: Mechanism,
    theta: Array,
    prior: Array,
    sigma: Array,
    windows: Sequence[Window],
    noise: Array,
    effects: Sequence[NativeEffect],
) -> float:
    try:
        error = misses(m, theta, windows, effects) / noise
    except ValueError:
        return np.inf
    return float(np.sum(error**2) + np.sum(((theta - prior) / sigma) ** 2))


def _newton(
    m: Mechanism,
    theta: Array,
    prior: Array,
    sigma: Array,
    windows: Sequence[Window],
    noise: Array,
    effects: Sequence[NativeEffect],
) -> Array:
    now = misses(m, theta, windows, effects)
    columns = []
    for i, s in enumerate(sigma):
        moved = theta.copy()
        moved[i] += _JACOBIAN_STEP_SIGMAS * s
        columns.append(((now - misses(m, moved, windows, effects)) / noise).ravel() / _JACOBIAN_STEP_SIGMAS)
    jacobian = np.vstack([np.column_stack(columns), np.eye(len(theta))])
    target = np.concatenate([(now / noise).ravel(), (prior - theta) / sigma])
    step: Array = sigma * np.linalg.lstsq(jacobian, target, rcond=None)[0]
    return step
