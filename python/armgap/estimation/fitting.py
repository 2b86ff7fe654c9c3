"""Estimation of all parameters of an arm from one log by output error, with exact dry friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap import _native, options
from armgap.arm.arm import Arm, only_planar
from armgap.errors import LogShapeError
from armgap.log.log import Log

__all__ = ["ArmFit", "fit"]


@dataclass(frozen=True)
class ArmFit:
    """Result of `fit`: parameters of an arm, estimated from one log by output error.

    Attributes
    ----------
    log : str
        Name of the log.
    parameter_names, parameter_units : tuple of str
        Names and SI units of the entries of `theta`.
    theta : ndarray, shape (n_parameters,)
        Parameters at the minimum [SI].
    sigma : ndarray, shape (n_parameters,)
        Standard deviations, as if output errors were white and the windows' initial states exact.
    rms : float
        RMS difference between measured and predicted positions, all joints together [rad or m].
    iterations : int
        Number of Gauss-Newton steps.
    settled : bool
        Whether the iteration converged.
    """

    log: str
    parameter_names: tuple[str, ...]
    parameter_units: tuple[str, ...]
    theta: NDArray[np.float64]
    sigma: NDArray[np.float64]
    rms: float
    iterations: int
    settled: bool

    def to_dict(self) -> dict[str, Any]:
        """Return the result of the fit as a dict ready for JSON."""
        rows = zip(self.parameter_names, self.theta, self.sigma, self.parameter_units, strict=True)
        return {
            "log": self.log,
            "parameters": {name: {"value": float(v), "sigma": float(s), "unit": unit} for name, v, s, unit in rows},
            "rms": self.rms,
            "iterations": self.iterations,
            "settled": self.settled,
        }


def fit(log: Log, arm: Arm, *, horizon: float = 0.25) -> ArmFit:
    """Fit all parameters of an arm to a log by output error.

    The log is cut into windows, each of which is simulated from its measured initial state under the logged torque; the squared differences
    of positions are minimised by Gauss-Newton steps from the arm's own values. The model is that of the arm file without
    effects; `diagnose` finds missing effects.

    Parameters
    ----------
    log : Log
        Log to fit.
    arm : Arm
        Arm; its parameters are the initial values of the fit.
    horizon : float, default 0.25
        Length of a window [s]. Longer windows are more sensitive to the parameters and less to initial states.

    Returns
    -------
    ArmFit

    Raises
    ------
    OptionError
        If the horizon is not a positive number.
    LogShapeError
        If the log has another number of joints, or fewer samples within whole windows than the arm has parameters.

    References
    ----------
    L. Ljung, *System Identification: Theory for the User* (1999), section 7.2.
    """
    only_planar(arm, "fit")
    horizon = options.positive(horizon, "horizon")
    if log.n_joints != arm.n_joints:
        raise LogShapeError(
            f"has {log.n_joints} joints, the arm has {arm.n_joints}",
            remedy="use the arm file that belongs to this log",
            file=log.path or log.name,
        )
    t, q, tau = (np.ascontiguousarray(x) for x in (log.t, log.q, log.with_torques("a fit").tau))
    found = _native.fit(arm.to_native(), t, q, tau, horizon)
    if found is None:
        raise LogShapeError(
            f"lasts {log.duration:.3g} s, too short for {len(arm.theta)} parameters in windows of {horizon:g} s",
            remedy="give a longer log or a shorter horizon",
            file=log.path or log.name,
        )
    return ArmFit(
        log=log.name,
        parameter_names=tuple(arm.parameter_names),
        parameter_units=tuple(arm.parameter_units),
        theta=np.asarray(found["theta"]),
        sigma=np.asarray(found["sigma"]),
        rms=found["rms"],
        iterations=found["iterations"],
        settled=found["settled"],
    )
