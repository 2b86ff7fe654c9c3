"""Physical plausibility of fitted parameters: positive definite inertia, gravity in its nominal direction, positive friction.

A base parameter set belongs to some arm of rigid bodies only if its inertia matrix is positive definite in every pose;
friction that feeds energy into the arm is impossible at any speed; reversed gravity means another zero of the positions,
another sign or another mount, not a property of the arm.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, TypedDict

import numpy as np

from armgap.arm.arm import Arm
from armgap.evidence.hypothesis import Array, Hypothesis

__all__ = ["plausibility"]

#: Poses per joint at which the inertia matrix is checked.
_POSES_PER_TURN = 24


class Plausibility(TypedDict):
    """Whether a parameter of the model with causes is physically possible."""

    check: Annotated[str, "What has to hold, in words."]
    holds: bool
    figure: Annotated[str, "The value it rests on, with its unit, in words."]


def plausibility(data: dict[str, Any], arm: Arm) -> list[Plausibility]:
    """Return for the parameters of the model with causes whether they are physically possible."""
    model = Hypothesis.of(data, arm)
    found = data["parameters"]["with_causes"]
    friction = (_friction(name, found[name]) for name in arm.parameter_names[arm.n_inertial :])
    return [_inertia(model), *_gravity(data), *friction]


def _inertia(model: Hypothesis) -> Plausibility:
    stiffest = _largest_compliance(model)
    unit = "kg m^2" if model.arm.rotary else "kg"
    figure = "in some pose it is not" if stiffest is None else f"smallest eigenvalue {1 / stiffest:.3g} {unit}"
    return {
        "check": "the inertia matrix is positive definite in every pose",
        "holds": stiffest is not None,
        "figure": figure,
    }


def _gravity(data: dict[str, Any]) -> list[Plausibility]:
    """Return one entry for gravity parameters with reversed sign; empty if there are none."""
    tables = data["parameters"]
    return [
        {
            "check": f"gravity on {s['parameter']} has the arm file's sign",
            "holds": False,
            "figure": " → ".join(_rounded(**tables[t][s["parameter"]]) for t in ("nominal", "with_causes")),
        }
        for s in data.get("sanity", ())
        if s["kind"] == "sign"
    ]


def _largest_compliance(model: Hypothesis) -> float | None:
    """Return the largest eigenvalue of the inverse inertia matrix over all poses; None if the matrix is not positive definite."""
    try:
        eigenvalues = np.linalg.eigvalsh(np.linalg.inv(model.inertia(_poses(model.arm))))
    except ValueError:  # a singular inertia matrix, or more effects than the simulator carries
        return None
    return float(eigenvalues.max()) if np.isfinite(eigenvalues).all() and eigenvalues.min() > 0 else None


def _poses(arm: Arm) -> Array:
    """Return poses over a whole turn of every joint, shape (n_poses, n_joints)."""
    turn = np.linspace(-np.pi, np.pi, _POSES_PER_TURN, endpoint=False)
    grid = np.meshgrid(*([turn] * arm.n_joints), indexing="ij")
    return np.column_stack([g.ravel() for g in grid])


def _friction(name: str, value: dict[str, Any]) -> Plausibility:
    """Return whether a friction coefficient is possible: not negative by more than its uncertainty."""
    sigma = value["sigma"] or 0.0
    holds = value["value"] + 2.0 * sigma >= 0.0
    within = ", within twice its uncertainty" if holds and value["value"] < 0 else ""
    return {
        "check": f"{name} is not negative{within}",
        "holds": bool(holds),
        "figure": _rounded(value["value"], sigma, value["unit"]),
    }


def _rounded(value: float, sigma: float, unit: str) -> str:
    """Return a value and its uncertainty as text, rounded to one common digit."""
    if sigma <= 0:
        return f"{value:.3g} {unit}"
    places = max(0, 1 - math.floor(math.log10(sigma)))
    return f"{value:.{places}f} ± {sigma:.{places}f} {unit}"
