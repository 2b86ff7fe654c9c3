"""Whether fitted values are physically possible: positive definite inertia, positive masses and friction.

A base parameter set belongs to some arm of rigid bodies only if its inertia matrix is positive definite in every pose;
friction that feeds energy into the arm is impossible at any speed.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from armgap.arm import Arm
from armgap.evidence.hypothesis import Array, Hypothesis

__all__ = ["plausibility"]

#: Poses per joint at which the inertia matrix is looked at.
POSES = 24


def plausibility(data: dict[str, Any], arm: Arm) -> list[dict[str, Any]]:
    """Return what makes the model with causes physically possible or not.

    Returns
    -------
    list of dict
        ``check`` in words, ``holds`` (bool) and ``figure``, the value it rests on, with its unit, in words.
    """
    model = Hypothesis.of(data, arm)
    found = data["parameters"]["with_causes"]
    return [_inertia(model), *(_friction(name, found[name]) for name in arm.parameter_names[arm.n_inertial :])]


def _inertia(model: Hypothesis) -> dict[str, Any]:
    stiffest = _largest_compliance(model)
    unit = "kg m^2" if model.arm.rotary else "kg"
    figure = "in some pose it is not" if stiffest is None else f"smallest eigenvalue {1 / stiffest:.3g} {unit}"
    return {
        "check": "the inertia matrix is positive definite in every pose",
        "holds": stiffest is not None,
        "figure": figure,
    }


def _largest_compliance(model: Hypothesis) -> float | None:
    """Largest eigenvalue of the inverse inertia matrix over all poses; None where it is not positive definite."""
    try:
        compliance = np.array([model.compliance(q) for q in _poses(model.arm)])
    except ValueError:  # the simulator has no acceleration for such an arm
        return None
    eigenvalues = np.linalg.eigvalsh((compliance + np.swapaxes(compliance, 1, 2)) / 2)
    return float(eigenvalues.max()) if np.isfinite(eigenvalues).all() and eigenvalues.min() > 0 else None


def _poses(arm: Arm) -> Array:
    """Poses over a whole turn of every joint, shape (n_poses, n_joints)."""
    turn = np.linspace(-np.pi, np.pi, POSES, endpoint=False)
    grid = np.meshgrid(*([turn] * arm.n_joints), indexing="ij")
    return np.column_stack([g.ravel() for g in grid])


def _friction(name: str, value: dict[str, Any]) -> dict[str, Any]:
    """A friction coefficient is possible unless it is negative by more than its uncertainty."""
    sigma = value["sigma"] or 0.0
    holds = value["value"] + 2.0 * sigma >= 0.0
    within = ", within twice its uncertainty" if holds and value["value"] < 0 else ""
    return {
        "check": f"{name} is not negative{within}",
        "holds": bool(holds),
        "figure": _rounded(value["value"], sigma, value["unit"]),
    }


def _rounded(number: float, sigma: float, unit: str) -> str:
    """A value and its uncertainty to the same place."""
    if sigma <= 0:
        return f"{number:.3g} {unit}"
    places = max(0, 1 - math.floor(math.log10(sigma)))
    return f"{number:.{places}f} ± {sigma:.{places}f} {unit}"
