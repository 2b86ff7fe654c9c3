"""Identification by recursive least squares with the three regression models of Reyes and Kelly (1997)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armgap import _native
from armgap.arm.arm import Arm, checked_arm
from armgap.errors import ColumnError, OptionError
from armgap.estimation.base_columns import BaseParameters
from armgap.estimation.estimator import Estimator
from armgap.files.json_result import JsonResult
from armgap.literals import FILTERS, SCHEMES, VELOCITIES, Filters, Scheme, VelocityMethod
from armgap.log.log import Log
from armgap.progress import report_progress

__all__ = ["SCHEMES", "Identification", "identify", "velocity"]

# A parameter estimate depends on the filters' cut-off if halving the cut-off moves it by more than both thresholds: on noise-free and encoder-noise
# runs of the right model the movement stays below 3 sigma or 1 %, on the real arm of docs/real-arm.md it is 10 to 30 sigma and 15 to 35 %.
DRIFT_SIGMAS = 5.0
DRIFT_SHARE = 0.02


@dataclass(frozen=True)
class Identification(JsonResult):
    """Result of `identify`: parameters of an arm, estimated from one log by recursive least squares.

    Attributes
    ----------
    log, scheme, filters, velocity : str
        Name of the log, regression model, filters, and source of velocities.
    cutoff : float
        Cut-off of the filters [rad/s].
    parameter_names, parameter_units : tuple of str
        Names and SI units of the entries of `theta`.
    theta : ndarray, shape (n_parameters,)
        Estimate after the last sample.
    sigma : ndarray, shape (n_parameters,)
        Standard deviations, from the last covariance and the prediction errors of the second half of the log, as if these errors were white.
    nominal : ndarray, shape (n_parameters,)
        The arm file's values of the parameters in `theta`; NaN for a parameter that it lacks.
    base : BaseParameters, optional
        Base parameters that the entries of `theta` stand for, for a serial arm.
    t : ndarray, shape (n_samples,)
        Sample times [s].
    history : ndarray, shape (n_samples, n_parameters)
        Estimate after each sample [SI].
    errors : ndarray, shape (n_samples, n_joints) or (n_samples, 1)
        Prediction errors; NaN before the first regression.
    cutoff_drift : ndarray, shape (n_parameters,), or None
        Estimate at this cut-off less the estimate at half of it. With a right model and good velocities the difference is of the size of
        `sigma`; None for the supplied energy, which has no cut-off.
    updates, rejected : int
        Samples used, and samples rejected because they were not finite.
    """

    _allows_nan: ClassVar[bool] = True

    log: str
    scheme: Scheme
    filters: Filters
    velocity: VelocityMethod
    cutoff: float
    parameter_names: tuple[str, ...]
    parameter_units: tuple[str, ...]
    theta: NDArray[np.float64]
    sigma: NDArray[np.float64]
    cutoff_drift: NDArray[np.float64] | None
    updates: int
    rejected: int
    nominal: NDArray[np.float64] = field(repr=False)
    base: BaseParameters | None = field(repr=False)
    t: NDArray[np.float64] = field(repr=False)
    history: NDArray[np.float64] = field(repr=False)
    errors: NDArray[np.float64] = field(repr=False)

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the quality of the estimates; empty if none applies."""
        if self.cutoff_drift is None:
            return ()
        moved = np.abs(self.cutoff_drift)
        far = (moved > DRIFT_SIGMAS * self.sigma) & (moved > DRIFT_SHARE * np.abs(self.theta))
        names = [name for name, is_far in zip(self.parameter_names, far, strict=True) if is_far]
        if not names:
            return ()
        return (
            f"{', '.join(names)} depend on the cut-off, so they are biased, by more than sigma says: by noise of the velocities, by an "
            "effect that the model lacks, or by the paper's filters; try a lower cut-off, or fit with `diagnose`, which needs no velocities",
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the identification as a dict ready for JSON, without time series."""
        parameters: dict[str, dict[str, Any]] = {
            name: {"value": float(v), "sigma": float(s), "unit": unit}
            for name, v, s, unit in zip(self.parameter_names, self.theta, self.sigma, self.parameter_units, strict=True)
        }
        if self.base is not None:
            for name, text in zip(self.parameter_names, self.base.texts, strict=True):
                parameters[name]["combination"] = text
        return {
            "schema": "armgap.identification/1",
            "log": self.log,
            "scheme": self.scheme,
            "filters": self.filters,
            "velocity": self.velocity,
            "cutoff_rad_s": self.cutoff,
            "parameters": parameters,
            "cutoff_drift": None if self.cutoff_drift is None else self.cutoff_drift.tolist(),
            "notes": list(self.notes),
            "updates": self.updates,
            "rejected": self.rejected,
        }


def velocity(
    t: ArrayLike,
    q: ArrayLike,
    method: Literal["backward", "central", "local-cubic"] = "local-cubic",
    half_width: int = 3,
) -> NDArray[np.float64]:
    """Return velocities computed from positions.

    Parameters
    ----------
    t : array_like, shape (n_samples,)
        Sample times [s], evenly spaced or not.
    q : array_like, shape (n_samples, n_joints)
        Positions [rad or m].
    method : str
        ``"backward"``: the mean velocity of the preceding period, as in Reyes and Kelly (1997), so half a period late; zero at the first sample.
        ``"central"``: the slope of the parabola through a sample and its neighbours.
        ``"local-cubic"``: local cubic least squares over ``2 half_width + 1`` samples.
    half_width : int, default 3
        Half width of the local cubic, at least 2.

    Returns
    -------
    ndarray, shape (n_samples, n_joints)

    Examples
    --------
    >>> t = np.arange(5.0)
    >>> velocity(t, (t**2)[:, None], "central")[1:-1, 0].round(9).tolist()
    [2.0, 4.0, 6.0]
    """
    t = np.ascontiguousarray(t, dtype=np.float64)
    q = np.ascontiguousarray(q, dtype=np.float64)
    if t.ndim != 1 or q.ndim != 2 or len(q) != len(t):
        raise OptionError(f"`q` has shape {q.shape} for {t.shape} times", remedy="give one row of `q` per time")
    return _native.velocity(t, q, method, half_width)


def identify(
    log: Log,
    arm: Arm,
    *,
    scheme: Scheme = "filtered-power",
    filters: Filters = "exact",
    cutoff: float = 50.0,
    forgetting: float = 1.0,
    p0: float = 1000.0,
    theta0: ArrayLike | None = None,
    asymmetry: bool = False,
    fixed: Iterable[str] = (),
    velocity: VelocityMethod | None = None,
) -> Identification:
    """Estimate the parameters of an arm from a log.

    Parameters
    ----------
    log : Log
        Log of the arm.
    arm : Arm
        Arm; only values of fixed parameters are used. For a serial arm base parameters are estimated: combinations of the arm's
        parameters, see `base_parameters`.
    scheme : {"filtered-power", "filtered-dynamic", "supplied-energy"}
        Regression model: equations (30), (24) and (28) of Reyes and Kelly (1997).
    filters : {"exact", "paper"}
        Consistent filters, or those of Reyes and Kelly (1997) as printed.
    cutoff : float, default 50
        Cut-off of the filters [rad/s].
    forgetting : float, default 1
        Forgetting factor in (0, 1].
    p0 : float, default 1000
        Initial covariance ``P(0) = p0 I``.
    theta0 : array_like, shape (n_parameters,), optional
        Initial parameters ``theta(0)`` [SI], zero by default.
    asymmetry : bool, default False
        Estimate a constant resisting torque per joint too, which is what Coulomb friction of different levels adds in motion.
    fixed : iterable of str, optional
        Parameters of a serial arm that keep the arm's value, by name (``"mass7"``) or, for all joints, by the beginning of the name (``"rotor"``).
    velocity : {"backward", "central", "local-cubic", "sensor", "midpoint"}, optional
        Source of the velocities. ``"midpoint"`` takes the difference of two positions as the velocity half-way between them and aligns
        all other terms with that time, as the online estimator does. By default backward for the paper's filters, central for the exact ones.

    Returns
    -------
    Identification

    Raises
    ------
    OptionError
        If an option has an impossible value.
    ColumnError
        If the sensor's velocity is asked for and the log has none.

    References
    ----------
    F. Reyes and R. Kelly, Robotica 15 (1997) 563-571, equations (20)-(30).
    """
    checked_arm(arm)
    velocity = velocity or ("backward" if filters == "paper" else "central")
    _check(scheme, filters, cutoff, forgetting, p0, velocity)
    fixed = tuple(fixed)
    t, q, tau = (np.ascontiguousarray(x) for x in (log.t, log.q, log.with_torques("identification").tau))
    dq = _velocities(log, velocity)

    def estimator(cutoff: float) -> Estimator:
        return Estimator(
            arm,
            scheme=scheme,
            filters=filters,
            cutoff=cutoff,
            forgetting=forgetting,
            p0=p0,
            theta0=theta0,
            asymmetry=asymmetry,
            fixed=fixed,
        )

    report_progress(scheme, 0.0)
    whole = estimator(cutoff)
    run = whole.run(q, tau, dq, t=t)
    report_progress(scheme, 0.5)
    names, base, theta = whole.parameter_names, whole.base, whole.theta
    drift = None
    if scheme != "supplied-energy":
        half = estimator(cutoff / 2)
        half.run(q, tau, dq, t=t)
        drift = theta - half.theta
    nominal = np.full(len(names), np.nan)
    given = arm.theta if base is None else base.of(arm.theta)
    nominal[: len(given)] = given
    nominal[[name.startswith("asymmetry") for name in names]] = np.nan
    return Identification(
        log=log.name,
        scheme=scheme,
        filters=filters,
        velocity=velocity,
        cutoff=cutoff,
        parameter_names=names,
        parameter_units=whole.parameter_units,
        theta=theta,
        sigma=_sigma(run.errors, whole.covariance),
        cutoff_drift=drift,
        updates=whole.updates,
        rejected=whole.rejected,
        nominal=nominal,
        base=base,
        t=log.t,
        history=run.theta,
        errors=run.errors,
    )


def _sigma(errors: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return standard deviations of estimates, with prediction errors of the second half of the log taken as white."""
    late = errors[len(errors) // 2 :]
    spread = float(np.nanmean(late**2)) if np.isfinite(late).any() else 0.0
    return np.asarray(np.sqrt(spread * np.maximum(np.diag(covariance), 0.0)))


def _velocities(log: Log, method: str) -> NDArray[np.float64] | None:
    if method == "midpoint":
        return None
    if method == "sensor":
        if log.dq is None:
            raise ColumnError(
                "has no velocity columns",
                remedy="map dq1, dq2 ... or choose another velocity",
                file=log.path or log.name,
                column="dq1",
            )
        return np.ascontiguousarray(log.dq)
    return _native.velocity(np.ascontiguousarray(log.t), np.ascontiguousarray(log.q), method)


def _check(scheme: str, filters: str, cutoff: float, forgetting: float, p0: float, velocity: str) -> None:
    for name, value, known in (
        ("scheme", scheme, SCHEMES),
        ("filters", filters, FILTERS),
        ("velocity", velocity, VELOCITIES),
    ):
        if value not in known:
            raise OptionError(f"`{name}` is {value!r}", remedy=f"known: {', '.join(known)}")
    for name, number, fine in (
        ("cutoff", cutoff, cutoff > 0),
        ("forgetting", forgetting, 0 < forgetting <= 1),
        ("p0", p0, p0 > 0),
    ):
        if not (np.isfinite(number) and fine):
            raise OptionError(f"`{name}` is {number}", remedy="give a positive number (at most 1 for forgetting)")
