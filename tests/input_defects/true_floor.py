"""The floor that a case has: by how much a perfect model's predictions miss, from the true motion and the known noise.

A gap is the RMS of measured minus predicted positions over windows of the holdout, each predicted from its measured start
(docs/notation.md). For a perfect model there remain the noise of every sample and that of the start, carried along the window. Both
are known here: the encoder's rounding and any noise that was added. So the true arm, with its hidden effects, is run in MuJoCo once
more; at every window's start its true state is displaced by the error that the measured start has, and it runs on under the logged
torque. What that run and the measurement differ by is the floor, without any model, derivative or estimate of noise.

The same is done for further draws of the noise: rounding with the encoder's counts elsewhere, `REPEATS` times.

The start is measured by a local cubic as wide as the motion allows (intersection of confidence intervals, Goldenshluger and
Nemirovski 1997), of the positions without what the torque makes of them; that is written here once more, after the description in
docs/method.md and rust/fit/src/track.rs. Where the windows begin, and how noisy it takes the positions to be, the diagnosis says.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from armgap.trial.actuator import Encoder
from armgap.trial.arms import TrialArm, random_arm
from armgap.trial.case import simulated_arm_of
from armgap.trial.plant import Plant
from armgap.trial.simulated_arm import SimulatedArm

from .case import Array
from .making import Kept

#: Half widths of the local cubic [samples], and half width of the confidence intervals [standard deviations].
HALF_WIDTHS = (3, 4, 6, 8, 11, 15, 20, 27)
CONFIDENCE = 2.0
#: Draws of the noise besides the log's own.
REPEATS = 2
#: A window counts up to this many times the typical one where bad starts are cut.
WORST = 10.0
#: The true motion is run again to this [rad or m].
SAME = 1e-9


def true_floor(
    case: Kept, noise: Array, rng: np.random.Generator, starts: Mapping[str, Sequence[float]], deviation: Array
) -> dict[str, list[float]]:
    """Return ``floor`` (of the log as it was measured), ``floor_drawn`` and ``floor_cut`` (of all draws, without and with bad starts cut),
    RMS per joint, and ``travel``: RMS displacement over a window.

    Parameters
    ----------
    case : Kept
        A case whose holdout was measured with `noise`, see `measured_again`.
    noise : ndarray, shape (n_joints,)
        Standard deviation of white noise before rounding [rad or m].
    rng : numpy.random.Generator
        Of the further draws.
    starts : mapping of str to sequence of float
        Times of the first predicted samples of all windows of every holdout log, as the diagnosis cut it [s since its start].
    deviation : ndarray, shape (n_joints,)
        Standard deviation of a position as the diagnosis took it [rad or m]; it decides how wide the local cubics are.
    """
    squares, travels = [], []
    for name, table in case.inputs.holdout.items():
        driven = driven_by_torque(case.inputs.arm, table.t, table.q, table.tau, deviation)
        windows = rows_of(table.t, starts[name])
        shown = shown_by(_encoders(case, name), table.q_true)
        draws = [table.q, *(_measure(shown, noise, case.truth.step, rng, True) for _ in range(REPEATS))]
        squares += list(_missed(case, name, windows, draws, driven, deviation))
        travels += [table.q_true[last] - table.q_true[first] for first, last in windows]
    per_window = np.array(squares)
    own = per_window[:: 1 + REPEATS]
    typical = np.median(per_window, axis=0)
    return {
        "floor": np.sqrt(np.mean(own, axis=0)).tolist(),
        "floor_drawn": np.sqrt(np.mean(per_window, axis=0)).tolist(),
        "floor_cut": np.sqrt(np.mean(np.minimum(per_window, WORST * typical), axis=0)).tolist(),
        "travel": np.sqrt(np.mean(np.array(travels) ** 2, axis=0)).tolist(),
    }


def measured_again(case: Kept, noise: Array, rng: np.random.Generator) -> Kept:
    """The same motion measured with white noise before rounding; without noise, as it was."""
    if not np.any(noise):
        return case
    inputs = case.inputs
    for name, table in case.inputs.logs.items():
        shown = shown_by(_encoders(case, name), table.q_true)
        again = table.changed(q=_measure(shown, noise, case.truth.step, rng, False))
        inputs = inputs.with_log(name, again)
    return replace(case, inputs=inputs)


def _measure(shown: Array, noise: Array, step: Array, rng: np.random.Generator, elsewhere: bool) -> Array:
    """Positions with noise, in whole counts; with the counts elsewhere, rounding is drawn again too."""
    dither = step * rng.uniform(size=len(step)) if elsewhere else 0.0
    noisy = shown + noise * rng.standard_normal(shown.shape) + dither
    return np.asarray(np.round(noisy / step) * step - dither)


def _encoders(case: Kept, log: str) -> list[Encoder]:
    return simulated_arm_of(arm_of(case), case.key.effects, log).encoders


def shown_by(encoders: list[Encoder], q: Array) -> Array:
    """True positions (..., n_joints) as encoders with hidden faults show them, before rounding."""
    return np.stack([x + e.a * np.sin(x) + e.b * np.cos(x) + e.offset for e, x in zip(encoders, q.T, strict=True)], -1)


def rate_shown_by(encoders: list[Encoder], q: Array, dq: Array) -> Array:
    """True velocities (n_joints,) as the same encoders show them."""
    slopes = [1 + e.a * np.cos(x) - e.b * np.sin(x) for e, x in zip(encoders, q, strict=True)]
    return np.asarray(dq * np.array(slopes))


def arm_of(case: Kept) -> TrialArm:
    """The true arm: the first that the generator draws from the case's seed."""
    return random_arm(np.random.default_rng(case.key.details["seed"]), case.truth.model)


def _missed(
    case: Kept, name: str, windows: list[tuple[int, int]], draws: list[Array], driven: Array, deviation: Array
) -> Iterator[Array]:
    """Mean square error of every window and draw, shape (n_joints,)."""
    table, encoders = case.inputs.holdout[name], _encoders(case, name)
    rig = simulated_arm_of(arm_of(case), case.key.effects, name)
    plant = Plant(rig.config)
    now = 0
    for first, last in windows:
        _run(plant, rig, table.tau[now:first])
        now, true_q = first, table.q_true[first]
        if np.max(np.abs(np.array(plant.position()) - true_q)) > SAME:
            raise RuntimeError(f"{case.name}: the true motion is not made again")
        shown, rate = shown_by(encoders, true_q), rate_shown_by(encoders, true_q, table.dq_true[first])
        for q in draws:
            start_q, start_dq = measured_start(table.t, q, first, deviation, driven)
            run = _displaced(plant, rig, start_q - shown, start_dq - rate, table.tau[first:last])
            yield np.mean((q[first + 1 : last + 1] - shown_by(encoders, run)) ** 2, axis=0)


def _displaced(plant: Plant, rig: SimulatedArm, error_q: Array, error_dq: Array, tau: Array) -> Array:
    """Positions after a displaced start, with everything that the arm remembers as it is."""
    rig = copy.deepcopy(rig)
    twin: Any = Plant(rig.config)
    twin.data.time = plant.data.time
    twin._slope = list(plant._slope)
    twin.data.qpos[:], twin.data.qvel[:] = plant.data.qpos, plant.data.qvel
    for j in range(twin.n):
        for dof in {twin.dof[j], twin.motor[j]}:
            twin.data.qpos[dof] += error_q[j]
            twin.data.qvel[dof] += error_dq[j]
    return _run(twin, rig, tau)


def _run(plant: Plant, rig: SimulatedArm, tau: Array) -> Array:
    """Positions after each of the rows of held commands."""
    q = np.empty((len(tau), plant.n))
    for k, command in enumerate(tau.tolist()):
        if not plant.state_dependent and all(a.constant for a in rig.actuators):
            plant.hold([a(u, plant.dt) for a, u in zip(rig.actuators, command, strict=True)])
        else:
            for _ in range(plant.steps_per_sample):
                plant.step([a(u, plant.dt) for a, u in zip(rig.actuators, command, strict=True)])
        q[k] = plant.position()
    return q


def rows_of(t: Array, starts: Sequence[float]) -> list[tuple[int, int]]:
    """First and last rows of consecutive windows of a log whose first predicted samples have these times since its start."""
    first = np.searchsorted(t - t[0], np.array(starts) - 1e-6) - 1
    return list(itertools.pairwise([*map(int, first), len(t) - 1]))


def _column(t: Array, q: Array, driven: Array, deviation: float, step: int = 1) -> list[_Cubic]:
    return [_widest(t, q, driven, row, deviation) for row in range(0, len(t), step)]


def driven_by_torque(arm: Mapping[str, Any], t: Array, q: Array, tau: Array, deviation: Array) -> Array:
    """Accelerations that the torque gives the arm of an arm file, zero for joints whose positions are no smoother without their effect.

    Returns
    -------
    ndarray, shape (n_samples, n_joints)
    """
    driven = np.linalg.solve(_inertia(arm, q), tau[:, :, None])[:, :, 0]
    for j, noise in enumerate(deviation):
        rough = [
            np.mean([np.log(c.deviation) for c in _column(t, q[:, j], a, noise, step=7)])
            for a in (np.zeros(len(t)), np.asarray(driven[:, j], dtype=float))
        ]
        if rough[1] >= rough[0]:
            driven[:, j] = 0.0
    return np.asarray(driven)


def _inertia(arm: Mapping[str, Any], q: Array) -> Array:
    """Inertia matrices (n_samples, n_joints, n_joints) of an arm file (Siciliano et al. 2009, eq. 7.82 for two links)."""
    theta = arm["inertial"]["theta"]
    if q.shape[1] == 1:
        return np.full((len(q), 1, 1), theta[0])
    coupled = theta[2] + theta[1] * np.cos(q[:, 1])
    return np.array(
        [[theta[0] + 2 * theta[1] * np.cos(q[:, 1]), coupled], [coupled, np.full(len(q), theta[2])]]
    ).transpose(2, 0, 1)


def measured_start(t: Array, q: Array, row: int, deviation: Array, driven: Array | None = None) -> tuple[Array, Array]:
    """Position and velocity of each joint at a row, from positions around it."""
    driven = np.zeros_like(q) if driven is None else driven
    found = [_widest(t, *joint[:2], row, float(joint[2])) for joint in zip(q.T, driven.T, deviation, strict=True)]
    return np.array([c.position for c in found]), np.array([c.velocity for c in found])


def _widest(t: Array, q: Array, driven: Array, row: int, deviation: float) -> _Cubic:
    """The cubic before the widest whose velocity agrees with those of all narrower ones."""
    first = max(0, min(row - HALF_WIDTHS[-1], len(t) - 2 * HALF_WIDTHS[-1] - 1))
    near = slice(first, first + 2 * HALF_WIDTHS[-1] + 1)
    t, q, at = t[near] - t[row], q[near].copy(), row - first
    if np.any(driven):
        h, a = np.diff(t), driven[near][: len(t) - 1]
        speed = np.concatenate([[0.0], np.cumsum(h * a)])
        distance = np.concatenate([[0.0], np.cumsum(h * (speed[:-1] + 0.5 * h * a))])
        q -= distance - distance[at] - speed[at] * t
    before = widest = _cubic(t, q, at, HALF_WIDTHS[0])
    low, high = -np.inf, np.inf
    for half in (h for h in HALF_WIDTHS if 2 * h < len(t)):
        local = _cubic(t, q, at, half)
        radius = CONFIDENCE * deviation * local.deviation
        low, high = max(low, local.velocity - radius), min(high, local.velocity + radius)
        if low > high:
            break
        before, widest = widest, local
    return before


class _Cubic(NamedTuple):
    """Position, velocity, and the velocity's deviation for noise of one, from a cubic through the samples around a row."""

    position: float
    velocity: float
    deviation: float
    half: int


def _cubic(t: Array, q: Array, row: int, half: int) -> _Cubic:
    count = min(2 * half + 1, len(t))
    first = min(max(row - half, 0), len(t) - count)
    inverse, scale, powers = _powers(tuple(np.round(t[first : first + count] - t[row], 9).tolist()))
    c = inverse @ (powers.T @ (q[first : first + count] - q[row]))
    return _Cubic(float(q[row] + c[0]), float(c[1] / scale), float(np.sqrt(inverse[1, 1]) / scale), half)


@lru_cache(maxsize=1000)
def _powers(x: tuple[float, ...]) -> tuple[Array, float, Array]:
    """Inverse of the normal matrix, scale and powers of a cubic at these times."""
    scale = (x[-1] - x[0]) / 2
    powers: Array = np.vander(np.array(x) / scale, 4, increasing=True)
    inverse = np.asarray(np.linalg.inv(powers.T @ powers), dtype=float)
    return inverse, scale, powers
