"""The position controller of an arm: it computes the torques of logs that hold references in place of torques."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

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
        One standard deviation of trust in the gains; without `sigma_kp` the gains are known exactly, with it `sigma_kd` and `sigma_ki` are
        by default the same shares of `kd` and `ki` as `sigma_kp` is of `kp`.
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
    def sigmas(self) -> dict[str, NDArray[np.float64]]:
        """Standard deviations of ``kp``, ``kd`` and ``ki``, zero for a gain that is known exactly."""
        none = np.zeros(len(self.kp))
        shares = (
            none if self.sigma_kp is None else np.divide(self.sigma_kp, self.kp, out=none.copy(), where=self.kp > 0)
        )
        found = {"sigma_kp": none if self.sigma_kp is None else self.sigma_kp}
        for name, gain, given in (("sigma_kd", self.kd, self.sigma_kd), ("sigma_ki", self.ki, self.sigma_ki)):
            found[name] = given if given is not None else none if gain is None else shares * gain
        return found

    def torque(
        self,
        t: NDArray[np.float64],
        q: NDArray[np.float64],
        q_ref: NDArray[np.float64],
        dq_ref: NDArray[np.float64] | None = None,
        limit: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Return the controller's mean torques over the sample intervals of a log, without delay, deadband and integral part.

        Parameters
        ----------
        t : ndarray, shape (n_samples,)
            Sample times [s].
        q, q_ref : ndarray, shape (n_samples, n_joints)
            Positions [rad or m], and references that are held until the next sample.
        dq_ref : ndarray, as `q_ref`, optional
            Velocities of the reference; differences of `q_ref` by default.
        limit : ndarray, shape (n_joints,), optional
            Largest torques [N m or N].

        Returns
        -------
        ndarray, shape (n_samples, n_joints)
            Torques [N m or N]; the last row repeats the row before it.
        """
        h = np.diff(t)[:, None]
        rate = -np.diff(q, axis=0) / h
        if self.kd_on == "error":
            rate = rate + (np.gradient(q_ref, t, axis=0) if dq_ref is None else dq_ref)[:-1]
        tau = self.kp * (q_ref[:-1] - 0.5 * (q[1:] + q[:-1])) + self.kd * rate
        if limit is not None:
            tau = np.clip(tau, -limit, limit)
        return np.concatenate([tau, tau[-1:]])

    def to_native(self) -> dict[str, Any]:
        """Return the controller as the dict that the compiled core reads."""
        given = {name: values.tolist() for name, values in self.vectors if not name.startswith("sigma")}
        sigmas = {name: values.tolist() for name, values in self.sigmas.items()}
        return {**given, **sigmas, "rate_of_error": self.kd_on == "error"}

    @property
    def vectors(self) -> Iterator[tuple[str, NDArray[np.float64]]]:
        """Names and values, shape (n_joints,), of those settings in `VECTORS` that the controller has."""
        for name in VECTORS:
            if (values := getattr(self, name)) is not None:
                yield name, values


VECTORS: tuple[str, ...] = (
    "kp", "kd", "ki", "sigma_kp", "sigma_kd", "sigma_ki", "delay", "deadband", "speed_limit",
)  # fmt: skip
"""Keys of a controller in an arm file that take one number per joint."""
