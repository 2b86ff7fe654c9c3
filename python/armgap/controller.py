"""The position controller of an arm whose logs hold references in place of torques."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["VECTORS", "Controller", "DerivativeOn"]

DerivativeOn = Literal["measurement", "error"]


@dataclass(frozen=True)
class Controller:
    """A PD or PID controller per joint: ``tau = kp (q_ref - q) + kd (dq_ref - dq) + ki integral(q_ref - q)``.

    Attributes
    ----------
    kp, kd : ndarray, shape (n_joints,)
        Gains [N m/rad, N m s/rad; N/m, N s/m of a linear joint].
    kd_on : {"measurement", "error"}
        Whether `kd` acts on ``-dq`` or on ``dq_ref - dq``.
    ki : ndarray, shape (n_joints,), optional
        Integral gain [N m/(rad s)].
    sigma_kp, sigma_kd, sigma_ki : ndarray, shape (n_joints,), optional
        One standard deviation of trust in the gains.
    delay : ndarray, shape (n_joints,), optional
        Time by which the controller's torque is late [s].
    deadband : ndarray, shape (n_joints,), optional
        Position error below which the proportional part is zero [rad or m].
    speed_limit : ndarray, shape (n_joints,), optional
        Largest speed of the reference that the controller follows [rad/s or m/s].
    kind : {"pd"}
        Kind of controller.
    """

    kp: NDArray[np.float64]
    kd: NDArray[np.float64]
    kd_on: DerivativeOn = "measurement"
    ki: NDArray[np.float64] | None = None
    sigma_kp: NDArray[np.float64] | None = None
    sigma_kd: NDArray[np.float64] | None = None
    sigma_ki: NDArray[np.float64] | None = None
    delay: NDArray[np.float64] | None = None
    deadband: NDArray[np.float64] | None = None
    speed_limit: NDArray[np.float64] | None = None
    kind: Literal["pd"] = "pd"

    @property
    def vectors(self) -> Iterator[tuple[str, NDArray[np.float64]]]:
        """Names and values of what is given per joint."""
        for name in VECTORS:
            if (values := getattr(self, name)) is not None:
                yield name, values


VECTORS: tuple[str, ...] = (
    "kp", "kd", "ki", "sigma_kp", "sigma_kd", "sigma_ki", "delay", "deadband", "speed_limit",
)  # fmt: skip
"""Keys with one number per joint."""
