"""The floor that a case has: by how much a perfect model's predictions miss, from the true motion and the known noise.

A gap is the RMS of measured minus predicted positions over windows of the holdout, each predicted from its measured start
(docs/notation.md). For a perfect model there remain the noise of every sample and the error of the start, carried along the window. Both
are known here: the encoder's rounding and any noise that was added, and the true state where a window starts. So the true arm, with its
hidden effects, is run in MuJoCo once more; at every window's start its true state is displaced by the error that the measured start has,
and it runs on under the logged torque. What that run and the measurement differ by is the floor, without any model, derivative or estimate
of noise. Where the windows begin, and from which measured states, the diagnosis says.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from armgap.trial.cases.case import simulated_arm_of
from armgap.trial.simulation.actuator import Encoder
from armgap.trial.simulation.arms import TrialArm, random_arm
from armgap.trial.simulation.engine import mujoco
from armgap.trial.simulation.plant import Plant
from armgap.trial.simulation.simulated_arm import SimulatedArm

from .case import Array
from .making import Kept

#: The true motion is run again to this [rad or m].
SAME = 1e-9


class Starts(NamedTuple):
    """Where the windows of one log start.

    Attributes
    ----------
    t : sequence of float
        Times of the first predicted samples [s since the log's start].
    q, dq : ndarray, shape (n_windows, n_joints)
        Measured states one sample before, from which the windows are predicted [rad or m, and per second].
    """

    t: Sequence[float]
    q: Array
    dq: Array


def true_floor(case: Kept, starts: Mapping[str, Starts]) -> dict[str, list[float]]:
    """Return ``floor``, RMS per joint, and ``travel``: RMS displacement over a window.

    Parameters
    ----------
    case : Kept
        A case as it was diagnosed.
    starts : mapping of str to Starts
        Of every holdout log, as the diagnosis cut it.
    """
    squares, travels = [], []
    for name, table in case.inputs.holdout.items():
        windows = rows_of(table.t, starts[name].t)
        squares += list(_missed(case, name, windows, starts[name]))
        travels += [table.q_true[last] - table.q_true[first] for first, last in windows]
    return {
        "floor": np.sqrt(np.mean(squares, axis=0)).tolist(),
        "travel": np.sqrt(np.mean(np.array(travels) ** 2, axis=0)).tolist(),
    }


def measured_again(case: Kept, noise: Array, rng: np.random.Generator) -> Kept:
    """The same motion measured with white noise before rounding; without noise, as it was."""
    if not np.any(noise):
        return case
    inputs = case.inputs
    for name, table in case.inputs.logs.items():
        shown = shown_by(_encoders(case, name), table.q_true)
        noisy = shown + noise * rng.standard_normal(shown.shape)
        again = table.changed(q=np.round(noisy / case.truth.step) * case.truth.step)
        inputs = inputs.with_log(name, again)
    return replace(case, inputs=inputs)


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


def _missed(case: Kept, name: str, windows: list[tuple[int, int]], starts: Starts) -> Iterator[Array]:
    """Mean square error of every window, shape (n_joints,)."""
    table, encoders = case.inputs.holdout[name], _encoders(case, name)
    rig = simulated_arm_of(arm_of(case), case.key.effects, name)
    plant = Plant(rig.config)
    now = 0
    for (first, last), q, dq in zip(windows, starts.q, starts.dq, strict=True):
        run_commands(plant, rig, table.tau[now:first])
        now, true_q = first, table.q_true[first]
        if np.max(np.abs(np.array(plant.position()) - true_q)) > SAME:
            raise RuntimeError(f"{case.name}: the true motion is not made again")
        shown, rate = shown_by(encoders, true_q), rate_shown_by(encoders, true_q, table.dq_true[first])
        run = displaced(plant, rig, q - shown, dq - rate, table.tau[first:last])
        yield np.mean((table.q[first + 1 : last + 1] - shown_by(encoders, run)) ** 2, axis=0)


def displaced(plant: Plant, rig: SimulatedArm, error_q: Array, error_dq: Array, tau: Array) -> Array:
    """Positions after a displaced start, with everything that the arm remembers, and motors behind a shaft or play, as they are.

    A motor's state is no measurement of the window's start: predictions carry it along the log.
    """
    rig = copy.deepcopy(rig)
    twin: Any = Plant(rig.config)
    mujoco().mj_copyData(twin.data, twin.model, plant.data)
    twin._slope = list(plant._slope)
    twin.data.qpos[twin.dof] += error_q
    twin.data.qvel[twin.dof] += error_dq
    return run_commands(twin, rig, tau)


def run_commands(plant: Plant, rig: SimulatedArm, tau: Array) -> Array:
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
