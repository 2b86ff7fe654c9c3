"""Windows of a log, their measured starts, and the prediction error of a MuJoCo model over the windows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Half widths of local cubics in samples, and largest difference of their velocities in standard deviations (docs/decisions/037-measured-starts.md).
HALF_WIDTHS = (3, 4, 6, 8, 11, 15, 20, 27)
CONFIDENCE = 2.0


@dataclass(frozen=True)
class Window:
    """Samples `first` to `last` of a log, with position and velocity measured at `first`, from which the samples after it are predicted."""

    first: int
    last: int
    q: Array
    dq: Array


def windows_of(diagnosis: dict[str, Any], t: Array, q: Array) -> list[Window]:
    """Return the windows of the only holdout log of a diagnosis, with their measured starts."""
    series = next(s for s in diagnosis["series"] if s["joint"] == 1)
    stamps = np.array(series["t"])
    # The first predicted sample is the one after the start.
    firsts = [int(np.argmin(np.abs(t - stamps[k]))) - 1 for k in series["window_start"]]
    lasts = [*firsts[1:], int(np.argmin(np.abs(t - stamps[-1])))]
    sigma = np.array(diagnosis["noise"]["position_sigma"])
    found = []
    for first, last in zip(firsts, lasts, strict=True):
        starts = [_measured(t, q[:, j], first, float(sigma[j])) for j in range(q.shape[1])]
        found.append(Window(first, last, *np.array(starts).T))
    return found


def _measured(t: Array, q: Array, at: int, sigma: float) -> tuple[float, float]:
    """Return position and velocity at a sample from a local cubic: the second widest of those whose velocities agree with all narrower ones."""
    kept, low, high = [], -np.inf, np.inf
    for half in HALF_WIDTHS:
        count = 2 * half + 1
        if count > len(t) and kept:
            break
        first = min(max(at - half, 0), len(t) - count)
        x = t[first : first + count] - t[at]
        powers = x[:, None] ** np.arange(4) / np.max(np.abs(x)) ** np.arange(4)
        inverse = np.linalg.inv(powers.T @ powers)
        c = inverse @ (powers.T @ (q[first : first + count] - q[at]))
        scale = np.max(np.abs(x))
        speed, deviation = c[1] / scale, np.sqrt(inverse[1, 1]) / scale
        low, high = max(low, speed - CONFIDENCE * sigma * deviation), min(high, speed + CONFIDENCE * sigma * deviation)
        if low > high and kept:
            break
        kept.append((q[at] + c[0], speed))
    return kept[-2] if len(kept) > 1 else kept[0]


def missed(model: Any, windows: list[Window], t: Array, q: Array, tau: Array, *, apply_torque: bool) -> Array:
    """Return the RMS position error per joint of a compiled MuJoCo model over all windows [rad or m], shape (n_joints,).

    Parameters
    ----------
    model : mujoco.MjModel
        Compiled model, with the joints in the order of the log.
    windows : list of Window
        Windows of the log over which the model is simulated.
    t, q, tau : ndarray
        Time stamps, positions and torques of the log.
    apply_torque : bool
        Whether torques act on the joints directly, for a model without actuators; otherwise the torques are the actuators' commands.
    """
    data = mujoco.MjData(model)
    squares, rows = np.zeros(q.shape[1]), 0
    for window in windows:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = window.q, window.dq
        for k in range(window.first, window.last):
            if apply_torque:
                data.qfrc_applied[:] = tau[k]
            else:
                data.ctrl[:] = tau[k]
            for _ in range(round((t[k + 1] - t[k]) / model.opt.timestep)):
                mujoco.mj_step(model, data)
            squares += (data.qpos - q[k + 1]) ** 2
            rows += 1
    return np.asarray(np.sqrt(squares / rows))
