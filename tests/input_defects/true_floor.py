"""True noise floor of a case: the prediction error of a perfect model, from the true motion and the known noise.

A gap is the RMS of measured minus predicted positions over windows of the holdout, each predicted from its measured start
(docs/notation.md). For a perfect model, the noise of every sample and the error of the measured start remain; the latter propagates along the
window. Both are known here: the encoder's rounding, any added noise, and the true state at the start of a window. The true arm, with its
hidden effects, is simulated in MuJoCo again; at the start of every window its state is displaced by the error of the measured start, and it
is simulated from there under the logged torque. The RMS difference from the measured positions is the floor, without any model, derivative
or estimate of noise. The starts of the windows and their measured states are taken from the diagnosis.
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

#: Largest difference between the repeated simulation and the recorded true positions [rad or m].
SAME = 1e-9


class Starts(NamedTuple):
    """Starts of the windows of one holdout log.

    Attributes
    ----------
    t : sequence of float
        Times of the first predicted samples [s since the log's start].
    q, dq : ndarray, shape (n_windows, n_joints)
        Measured states at the sample before, from which the windows are predicted [rad or m, and per second].
    """

    t: Sequence[float]
    q: Array
    dq: Array


def true_floor(case: Kept, starts: Mapping[str, Starts]) -> dict[str, list[float]]:
    """Return ``floor``, the true noise floor per joint, and ``travel``, the RMS displacement over a window per joint [rad or m].

    Parameters
    ----------
    case : Kept
        Case as it was diagnosed.
    starts : mapping of str to Starts
        Starts of the windows of every holdout log, as the diagnosis chose them.
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
    """Return the case with positions measured again, with white noise [rad or m] before rounding; unchanged if the noise is zero."""
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
    """Return true positions (..., n_joints) as encoders with hidden errors show them, before rounding."""
    return np.stack([x + e.a * np.sin(x) + e.b * np.cos(x) + e.offset for e, x in zip(encoders, q.T, strict=True)], -1)


def rate_shown_by(encoders: list[Encoder], q: Array, dq: Array) -> Array:
    """Return true velocities (n_joints,) as encoders with hidden errors show them at positions `q`."""
    slopes = [1 + e.a * np.cos(x) - e.b * np.sin(x) for e, x in zip(encoders, q, strict=True)]
    return np.asarray(dq * np.array(slopes))


def arm_of(case: Kept) -> TrialArm:
    """Return the true arm: the first that the generator draws from the case's seed."""
    return random_arm(np.random.default_rng(case.key.details["seed"]), case.truth.model)


def _missed(case: Kept, name: str, windows: list[tuple[int, int]], starts: Starts) -> Iterator[Array]:
    """Yield the mean square position error of every window of a log [rad^2 or m^2], shape (n_joints,)."""
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
    """Return positions simulated from a start that is displaced by the given errors, shape (n_samples, n_joints); the plant is unchanged.

    Latent states, such as a motor behind an elastic shaft, are not displaced: predictions carry them along the log without measurement.
    """
    rig = copy.deepcopy(rig)
    twin: Any = Plant(rig.config)
    mujoco().mj_copyData(twin.data, twin.model, plant.data)
    twin._slope = list(plant._slope)
    twin.data.qpos[twin.dof] += error_q
    twin.data.qvel[twin.dof] += error_dq
    return run_commands(twin, rig, tau)


def run_commands(plant: Plant, rig: SimulatedArm, tau: Array) -> Array:
    """Advance the plant under the held commands `tau`; return the positions after each row, shape (n_samples, n_joints)."""
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
    """Return first and last rows of consecutive windows of a log; `starts` are the times of their first predicted samples since its start [s]."""
    first = np.searchsorted(t - t[0], np.array(starts) - 1e-6) - 1
    return list(itertools.pairwise([*map(int, first), len(t) - 1]))
