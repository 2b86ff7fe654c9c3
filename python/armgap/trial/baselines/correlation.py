"""Baseline by residual correlation: re-estimate the arm, then name the effect whose signature correlates best with the residual torque.

The residual torque is the equation error; the signature of each candidate is fitted to it. The arm is re-estimated with
the arm file's sigmas as prior; one cause is named if it explains at least a tenth of the residual's power.
"""

from __future__ import annotations

import numpy as np

from armgap.arm.arm import Arm
from armgap.trial.answers import Answer, NamedCause
from armgap.trial.baselines.regression import Array, RegressionData, regression_data
from armgap.trial.baselines.signatures import Signature, signatures
from armgap.trial.cases.sealed import SealedCase
from armgap.trial.methods import Method

__all__ = ["CORRELATION", "refit_residual"]

#: Smallest share of the residual torque's power that an effect has to explain to be named.
_MIN_EFFECT_SHARE = 0.1


def answer(case: SealedCase) -> Answer:
    """Return an answer that names the effect of the signature with the lowest BIC, with its squared correlation as probability."""
    made = regression_data(case)
    residual = refit_residual(case.arm, made)
    shares = [(s, _explained(s, residual)) for s in signatures(case.arm, made, made.motions[0])]
    best, share = min(shares, key=lambda x: _bic(*x))
    if share < _MIN_EFFECT_SHARE:
        return Answer("correlation", "none")
    return Answer("correlation", "effect", (NamedCause(best.effect, best.joint, min(share, 1.0)),))


def _bic(s: Signature, share: float) -> float:
    """Return the BIC of a signature that explains `share` of the residual's power; it favours fewer columns at equal share."""
    rows, columns = s.columns.shape
    return float(rows * np.log(max(1.0 - share, 1e-12)) + columns * np.log(rows))


def refit_residual(arm: Arm, made: RegressionData) -> Array:
    """Return the residual torques of the re-estimated arm, with the arm file's sigmas as prior."""
    theta = arm.theta + _step(made.base, made.tau - made.base @ arm.theta, arm.sigma)
    left: Array = made.tau - made.base @ theta
    return left


def _step(base: Array, left: Array, sigma: Array) -> Array:
    rows = np.vstack([base, np.diag(1.0 / sigma)])
    step: Array = np.linalg.lstsq(rows, np.concatenate([left, np.zeros(len(sigma))]), rcond=None)[0]
    return step


def _explained(s: Signature, residual: Array) -> float:
    """Return the squared multiple correlation, 0 to 1, of a signature with the residual torque."""
    fitted = s.columns @ np.linalg.lstsq(s.columns, residual, rcond=None)[0]
    return float(fitted @ fitted / (residual @ residual))


CORRELATION = Method(
    "correlation",
    "residual correlation",
    "arm re-estimated by least squares on torques with the arm file's sigmas as prior; names the effect whose signature "
    f"has the largest squared correlation with the torque residual, if that is at least {_MIN_EFFECT_SHARE:g}",
    answer,
)
