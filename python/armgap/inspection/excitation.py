"""Excitation of an arm's parameters by the motion of a log.

The filtered dynamic regression ``y = psi theta`` of the arm is run over the log; the information ``A = sum psi' psi`` follows from the
covariance of recursive least squares, ``A = P^-1 - P(0)^-1``, and adds up over stretches. Parameters are measured in units of the arm
file's values, so that the condition number of the regressor, ``sqrt(cond(A))``, does not depend on units.

References
----------
J. Swevers et al., Optimal robot excitation and identification, IEEE Trans. Robotics and Automation 13 (1997) 730-740.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap._renamed import old_names
from armgap.arm.arm import Arm
from armgap.estimation.estimator import Estimator
from armgap.log.log import Log
from armgap.log.stretches import choose

__all__ = ["Excitation", "ParameterExcitation", "excitation"]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__)

#: Initial variance of a parameter in recursive least squares, in squares of its SI unit: so large that it does not matter.
_P0 = 1e9
_REGRESSION_CUTOFF = 50.0  # cut-off of the filters of the regression, rad/s
_BUDGET = 200_000  # largest number of samples of a log that are used
# RMS of the white torque error, as a part of the RMS torque, for which standard deviations of parameters are stated.
_ERROR = 0.01
# Part of the largest eigenvalue of the information matrix below which an eigenvalue counts as zero, within rounding.
_EIGENVALUE_TOLERANCE = 1e-14
# Standard deviation, as a part of the value, below which a parameter counts as well excited, and from which as not excited.
_WELL, _HARDLY = 0.05, 0.5


@dataclass(frozen=True)
class ParameterExcitation:
    """Excitation of one parameter of an arm by a log.

    Attributes
    ----------
    name : str
        Name of the parameter.
    value : float
        The arm file's value [SI].
    sigma : float
        Standard deviation, as part of the value, that a white error of 1 % of the RMS torque leaves.
    alone : float
        Standard deviation, as part of the value, if all other parameters were known.
    excited : str
        ``"well"`` (sigma below 5 %), ``"weakly"`` or ``"not"`` (above 50 %).
    """

    name: str
    value: float
    sigma: float
    alone: float
    excited: str


@dataclass(frozen=True)
class Excitation:
    """Excitation of the parameters of an arm by a log.

    Attributes
    ----------
    condition : float
        Condition number of the regressor with parameters in units of the arm file's values; infinite if some combination is not excited.
    parameters : tuple of ParameterExcitation
        Excitation of each parameter, in the arm's order.
    weakest : str
        Combination of parameters that the log excites least.
    samples : int
        Number of samples of the log that were used.
    """

    condition: float
    parameters: tuple[ParameterExcitation, ...]
    weakest: str
    samples: int


def excitation(log: Log, arm: Arm) -> Excitation:
    """Return the excitation of an arm's parameters by a log; for a long log, its informative stretches are used."""
    parts = choose([log], _BUDGET)
    scale = np.where(arm.theta != 0.0, np.abs(arm.theta), arm.sigma)
    information = sum((_information(part, arm) for part in parts), np.zeros((len(scale), len(scale))))
    scaled = information * np.outer(scale, scale)
    values, vectors = np.linalg.eigh((scaled + scaled.T) / 2)
    floor = _EIGENVALUE_TOLERANCE * values[-1]
    torque = float(np.sqrt(np.mean([np.mean(part.tau**2) for part in parts])))
    with np.errstate(divide="ignore"):
        spread = np.sqrt((vectors**2) @ (1.0 / np.maximum(values, floor)))
        alone = 1.0 / np.sqrt(np.diag(scaled))
    condition = float(np.sqrt(values[-1] / values[0])) if values[0] > floor else float("inf")
    parameters = tuple(
        ParameterExcitation(name, float(value), float(s), float(a), _word(float(s)))
        for name, value, s, a in zip(
            arm.parameter_names, arm.theta, _ERROR * torque * spread, _ERROR * torque * alone, strict=True
        )
    )
    return Excitation(condition, parameters, _combination(vectors[:, 0], arm), sum(len(part) for part in parts))


def _information(log: Log, arm: Arm) -> NDArray[np.float64]:
    """Return the information matrix ``sum psi' psi`` of a log's filtered dynamic regression."""
    t, q, tau = (np.ascontiguousarray(x) for x in (log.t, log.q, log.tau))
    estimator = Estimator(arm, scheme="filtered-dynamic", cutoff=_REGRESSION_CUTOFF, p0=_P0)
    estimator.run(q, tau, _native.velocity(t, q, "local-cubic", 3), t=t)
    values, vectors = np.linalg.eigh(estimator.covariance)
    information = np.maximum(1.0 / np.maximum(values, np.finfo(float).tiny) - 1.0 / _P0, 0.0)
    return np.asarray((vectors * information) @ vectors.T)


def _word(sigma: float) -> str:
    return "well" if sigma < _WELL else "weakly" if sigma < _HARDLY else "not"


def _combination(direction: NDArray[np.float64], arm: Arm) -> str:
    """Return a direction of parameter space as text: coefficients and names of the parameters with the largest parts."""
    direction = direction / direction[np.argmax(np.abs(direction))]
    terms = [
        (abs(c), f"{c:+.2g} {name}") for c, name in zip(direction, arm.parameter_names, strict=True) if abs(c) > 0.2
    ]
    return " ".join(text for _, text in sorted(terms, reverse=True))
