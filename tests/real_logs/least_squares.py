"""Inverse-dynamics least squares of a serial arm (Siciliano 2009, section 7.3), by Pinocchio's regressor and SciPy's filters.

Nothing of armgap is used here: positions are smoothed and differentiated, torque and regressor pass the same zero-phase low-pass filter, and
the parameters are the weighted least squares solution of smallest norm in scaled columns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio
import scipy.signal
from numpy.typing import NDArray

from .causes import Motion

Array = NDArray[np.float64]

#: Pinocchio's order of a link's ten parameters, by armgap's names (moments of inertia about the origin of the joint frame).
LINK_PARAMETERS = ("mass", "mx", "my", "mz", "ixx", "ixy", "iyy", "ixz", "iyz", "izz")
#: Names of the parameters of a drive: inertia of the rotor, viscous and Coulomb friction.
DRIVE_PARAMETERS = ("rotor", "viscous", "coulomb")
#: Singular values below this share of the largest are taken as zero: combinations that the motion does not excite.
RANK = 1e-6


@dataclass(frozen=True)
class Columns:
    """Columns of a log: times [s], shape (n_rows,), positions [rad or m] and torques [N m or N], shape (n_rows, n)."""

    t: Array
    q: Array
    tau: Array


def model_of(urdf: Path, joints: list[str]) -> pinocchio.Model:
    """Return Pinocchio's model of the `joints`; all others of the file stand at zero."""
    whole = pinocchio.buildModelFromUrdf(str(urdf))
    locked = [whole.getJointId(name) for name in whole.names[1:] if name not in joints]
    return pinocchio.buildReducedModel(whole, locked, pinocchio.neutral(whole))


def names_of(n: int) -> list[str]:
    """Return the parameters' names in the order of `regression`'s columns."""
    links = [f"{name}{j + 1}" for j in range(n) for name in LINK_PARAMETERS]
    return links + [f"{name}{j + 1}" for name in DRIVE_PARAMETERS for j in range(n)]


def regression(
    model: pinocchio.Model,
    log: Columns,
    *,
    cutoff: float,
    widths: Array,
    beside: Callable[[Motion], Array] | None = None,
    links: Array | None = None,
) -> tuple[Array, Array]:
    """Return torques, shape (n_rows, n), and their regressor, shape (n_rows, n, 13 n), both low-passed at `cutoff` [Hz].

    The torques are less those that `beside` gives along the motion, whose loads follow from the links' parameters `links`, shape (10 n,).

    Rows are resampled to an even spacing. `widths` [rad/s or m/s], shape (n,): dry friction changes its sign as tanh(dq / width), or as the
    sign where a width is zero. The first and last second are left out, where the filter has no data on one side.
    """
    period = float(np.median(np.diff(log.t)))
    t = np.arange(log.t[0], log.t[-1], period)
    q, tau = (np.stack([np.interp(t, log.t, column) for column in x.T], axis=1) for x in (log.q, log.tau))
    low_pass = scipy.signal.butter(4, cutoff, fs=1 / period, output="sos")

    def smooth(x: Array) -> Array:
        return np.asarray(scipy.signal.sosfiltfilt(low_pass, x, axis=0))

    # A wider filter for the positions keeps the motion whole, and the steps of an encoder out of the accelerations.
    q = np.asarray(
        scipy.signal.sosfiltfilt(
            scipy.signal.butter(4, min(4 * cutoff, 0.4 / period), fs=1 / period, output="sos"), q, axis=0
        )
    )
    dq = np.gradient(q, period, axis=0)
    ddq = np.gradient(dq, period, axis=0)
    n = model.nv
    data = model.createData()
    whole = np.zeros((len(t), n, 13 * n))
    for row in range(len(t)):
        whole[row, :, : 10 * n] = pinocchio.computeJointTorqueRegressor(model, data, q[row], dq[row], ddq[row])
    dry = np.where(widths > 0, np.tanh(dq / np.where(widths > 0, widths, 1.0)), np.sign(dq))
    joints = np.arange(n)
    for place, column in enumerate((ddq, dq, dry)):
        whole[:, joints, (10 + place) * n + joints] = column
    if beside is not None and links is not None:
        tau = tau - beside(Motion(q, dq, ddq, dry, tau, whole[:, :, : 10 * n] @ links))
    edge = round(1.0 / period)
    return smooth(tau)[edge:-edge], smooth(whole)[edge:-edge]


def solve(
    tau: Array, regressor: Array, theta: Array | None = None, sigma: Array | None = None, independent: float = 1.0
) -> Array:
    """Return the least squares parameters, shape (13 n,); every joint's rows are weighted by the RMS of what is left of its torque.

    With `theta` and `sigma`, shape (13 n,), the arm file's values and standard deviations are a prior, which keeps what the motion does not
    excite near them; `independent` is the share of rows that count as independent.
    Without, the solution of smallest norm is not bound to what a body can have.
    """
    weight = 1.0 / np.sqrt(np.mean(tau**2, axis=0))
    start = np.zeros(regressor.shape[2]) if theta is None else theta
    found = start
    for _ in range(5):
        rows = (regressor * weight[:, None]).reshape(-1, regressor.shape[2])
        right = ((tau - regressor @ start) * weight).ravel()
        if sigma is None:
            scale = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
            found = start + np.linalg.lstsq(rows / scale, right, rcond=RANK)[0] / scale
        else:
            known = sigma > 0
            normal = independent * rows[:, known].T @ rows[:, known] + np.diag(sigma[known] ** -2)
            found = start.copy()
            found[known] += np.linalg.solve(normal, independent * rows[:, known].T @ right)
        weight = 1.0 / np.sqrt(np.mean((tau - regressor @ found) ** 2, axis=0))
    return found


def share_left(rows: list[tuple[Array, Array]], theta: Array) -> Array:
    """Return the share of each joint's torque that `theta` leaves (RMS) over pairs of torques and regressor, shape (n,)."""
    left, whole = np.zeros(rows[0][0].shape[1]), np.zeros(rows[0][0].shape[1])
    for tau, regressor in rows:
        left += np.sum((tau - regressor @ theta) ** 2, axis=0)
        whole += np.sum(tau**2, axis=0)
    return np.asarray(np.sqrt(left / whole))
