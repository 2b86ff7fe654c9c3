"""How far hidden effects move the arm: windows predicted with the nominal arm, in encoder steps."""

from __future__ import annotations

import numpy as np

from armgap.trial.arms import TrialArm
from armgap.trial.plant import Build, Plant
from armgap.trial.rig import Array, Trace

#: Length of a window, s.
WINDOW = 0.2


def visibility(arm: TrialArm, logs: dict[str, Trace]) -> dict[str, list[float]]:
    """RMS deviation of each log from the arm without effects, per joint, in encoder steps.

    Every window starts from the measured position and true velocity and runs under the logged command.
    """
    return {name: _steps(arm, trace) for name, trace in logs.items()}


def _steps(arm: TrialArm, trace: Trace) -> list[float]:
    deviation = np.concatenate([_window(arm, trace, s) for s in _starts(arm, trace)])
    rms = np.sqrt(np.mean(deviation**2, axis=0)) / np.array(arm.step)
    return [float(f"{x:.4g}") for x in rms]


def _starts(arm: TrialArm, trace: Trace) -> range:
    length = _length(arm)
    return range(0, len(trace.t) - length, length)


def _length(arm: TrialArm) -> int:
    return round(WINDOW / arm.sample_period)


def _window(arm: TrialArm, trace: Trace, start: int) -> Array:
    plant = Plant(Build(arm))
    plant.place(trace.q[start].tolist(), trace.dq_true[start].tolist())
    rows = []
    for k in range(start, start + _length(arm)):
        plant.hold(trace.tau[k].tolist())
        rows.append(trace.q[k + 1] - np.array(plant.position()))
    return np.array(rows)
