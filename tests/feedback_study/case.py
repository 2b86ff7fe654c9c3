"""Runs of the study: an arm, its nominal model, and logs of its motion in closed loop, all drawn from a seed and a number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from tests.serial_trial.arms import SerialRobot, draw_robot, perturbed
from tests.serial_trial.effects import Null
from tests.serial_trial.motion import Reference, Run, coloured, draw_controller, draw_reference, simulate

Array = NDArray[np.float64]

FAMILY, JOINTS = "Panda-like", 7
PERIOD_S = 0.004
#: Lengths of each training log and of the holdout log, which is not used for estimates [s].
TRAINING_S, HOLDOUT_S = 12.0, 4.0
LOGS = ("train-1", "train-2", "holdout-1")
#: Smallest and largest correlation time of the disturbance, drawn for each joint on a logarithmic scale [s].
CORRELATION_S = (0.005, 0.1)
#: Largest relative errors of the nominal model: of inertial values, rotor inertias, friction.
OFF = (0.08, 0.24, 0.4)
#: Smallest and largest time between the knots of a spline [s].
_KNOTS_S = (0.6, 1.2)
_DRAWS = 40


@dataclass(frozen=True)
class Case:
    """One run of the study.

    Attributes
    ----------
    truth, nominal : SerialRobot
        Arm that moves, and nominal model of it in controller and arm file.
    quiet, disturbed : list of Run
        Logs along the same references without and with the disturbance; both have the encoders' steps.
    times : ndarray, shape (n,)
        Correlation times of the disturbance [s].
    """

    truth: SerialRobot
    nominal: SerialRobot
    quiet: list[Run]
    disturbed: list[Run]
    times: Array


def draw_truth(seed: int) -> SerialRobot:
    """Draw the arm that all runs of a seed share."""
    return draw_robot(np.random.default_rng([seed, 0]), FAMILY, JOINTS)


def make_case(seed: int, number: int, share: float) -> Case:
    """Make one run of the study.

    Parameters
    ----------
    seed, number : int
        Seed of the study and number of the run, which decide everything; the arm depends on the seed alone.
    share : float
        Standard deviation of the disturbance, as a share of each joint's RMS torque.

    Raises
    ------
    RuntimeError
        If no draw gives a motion within the arm's range.
    """
    truth = draw_truth(seed)
    for draw in range(_DRAWS):
        case = _draw(truth, np.random.default_rng([seed, number, draw, 1]), share)
        if case is not None:
            return case
    raise RuntimeError(f"run {number} of seed {seed}: no motion keeps to the arm's range")


def _draw(truth: SerialRobot, rng: np.random.Generator, share: float) -> Case | None:
    nominal = perturbed(truth, rng, *OFF)
    samples = [round(seconds / PERIOD_S) for seconds in (TRAINING_S, TRAINING_S, HOLDOUT_S)]
    kinds = [draw_reference, draw_spline, draw_reference]
    references = [kind(truth, count, PERIOD_S, rng) for kind, count in zip(kinds, samples, strict=True)]
    controller = draw_controller("pd", nominal, references[0], PERIOD_S, rng)
    times = np.exp(rng.uniform(*np.log(CORRELATION_S), truth.n))

    def moved(torques: list[Array]) -> list[Run]:
        given = zip(references, torques, strict=True)
        return [simulate(truth, nominal, Null(None), of, controller, torque, PERIOD_S) for of, torque in given]

    quiet = moved([np.zeros((count, truth.n)) for count in samples])
    size = share * np.sqrt(np.mean(np.concatenate([run.tau for run in quiet]) ** 2, axis=0))
    disturbed = moved([coloured(size, times, count, PERIOD_S, rng) for count in samples])
    runs = zip((*quiet, *disturbed), references * 2, strict=True)
    if not all(run.sane(truth, reference, follows=True) for run, reference in runs):
        return None
    return Case(truth, nominal, quiet, disturbed, times)


def draw_spline(robot: SerialRobot, samples: int, period: float, rng: np.random.Generator) -> Reference:
    """Draw a cubic spline through random positions within the joints' ranges as a reference that starts from rest and keeps to their speeds."""
    t = period * np.arange(samples)
    q = np.empty((samples, robot.n))
    for j in range(robot.n):
        times = [0.0]
        while times[-1] < t[-1]:
            times.append(times[-1] + float(rng.uniform(*_KNOTS_S)))
        middle, half = (robot.lower[j] + robot.upper[j]) / 2, (robot.upper[j] - robot.lower[j]) / 2
        knots = rng.uniform(-0.8, 0.8, len(times))
        spline = CubicSpline(times, knots, bc_type="clamped")
        wave = spline(t) / max(1.0, float(np.max(np.abs(spline(t)))) / 0.95)
        fastest = half * float(np.max(np.abs(np.gradient(wave, period))))
        q[:, j] = middle + half * wave * min(1.0, float(robot.speed[j]) / fastest)
    dq = np.gradient(q, period, axis=0)
    return Reference(q, dq, np.gradient(dq, period, axis=0))
