"""Arms, sizes of effects and diagnoses that the tests of exported models share."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np

from armgap import Arm, Diagnosis

THETA = {
    "axis": [12.0, 31.0, 25.0, 18.0],
    "pendulum": [0.31, 9.2, 0.2, 0.9],
    "two-link": [2.351, 0.0838, 0.102, 38.465, 1.8266, 2.288, 0.175, 7.6, 1.734],
}
# Parameters of one instance, on the last joint, of every effect for which some simulator has a field; names are those of the effect library.
SIZES: dict[str, dict[str, float]] = {
    "payload": {"mass": 0.7, "distance": 0.2},
    "rotor_inertia": {"inertia": 0.05},
    "rotor_coupling": {"inertia": -0.02},
    "joint_spring": {"k": 3.0, "q0": 0.4},
    "hardening_spring": {"cubic": 0.8, "k": 2.0, "q0": -0.3},
    "quadratic_drag": {"c": 0.3},
    "cubic_drag": {"c3": 0.2},
    "torque_offset": {"offset": 0.6},
    "coulomb_asymmetry": {"delta": 0.2},
    "torque_gain": {"gain": 1.2},
    "torque_saturation": {"level": 2.5},
    "actuator_lag": {"time_constant": 0.004},
    "actuator_delay": {"delay": 0.005},
    "base_tilt": {"angle": 0.12},
    "encoder_offset": {"offset": 0.15},
    "contact": {"position": 0.5, "stiffness": 60.0, "damping": 0.0},
}


def make_arm(kind: str, **more: Any) -> Arm:
    theta = np.array(THETA[kind])
    return Arm("an arm", kind, 9.81, 0.0025, theta, 0.1 * np.abs(theta), **more)


def found(arm: Arm, *causes: tuple[str, int | None, dict[str, float]], verdict: str = "effect") -> Diagnosis:
    """Return a diagnosis with the arm's own parameter values and the given causes."""
    values = {
        n: {"value": float(v), "sigma": float(s), "unit": u}
        for n, v, s, u in zip(arm.parameter_names, arm.theta, arm.sigma, arm.parameter_units, strict=True)
    }
    zeros = [0.0] * arm.n_joints
    gap = {k: zeros for k in ("before", "refit", "after", "floor")}
    return Diagnosis.from_dict(
        {
            "schema": "armgap.diagnosis/1",
            "verdict": verdict,
            "gap": {**gap, "horizon_s": 0.25, "closed": 1.0, "closed_ci": [1, 1], "free_run": gap},
            "where": [],
            "causes": [
                {
                    "effect": name,
                    "joint": joint,
                    "probability": 1.0,
                    "parameters": {k: {"value": v, "sigma": 0.01, "unit": "1"} for k, v in p.items()},
                    "closed": 1.0,
                    "equivalents": [],
                }
                for name, joint, p in causes
            ],
            "ruled_out": [],
            "parameters": {stage: deepcopy(values) for stage in ("nominal", "refit", "with_causes")},
        }
    )


def place(name: str, arm: Arm) -> tuple[str, int | None, dict[str, float]]:
    whole = name in ("payload", "base_tilt", "rotor_coupling")
    return name, None if whole else arm.n_joints, SIZES[name]
