"""Torques of a diagnosis' causes along a motion, from the equations in `docs/effects`, without armgap's code."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """Motion of all joints, arrays of shape (n_rows, n) [SI]: positions, velocities, accelerations, directions of dry friction from -1 to 1, torques
    of the motors, and torques that the transmissions pass on to the links.
    """

    q: Array
    dq: Array
    ddq: Array
    direction: Array
    tau: Array
    load: Array


def _dry(level: Callable[[Motion, int, dict[str, float]], Array]) -> Callable[[Motion, int, dict[str, float]], Array]:
    return lambda x, j, p: level(x, j, p) * x.direction[:, j]


#: Torque that a motor gives on top because of an effect of its joint, from the motion, the joint (from 0) and the effect's parameters.
TORQUES: dict[str, Callable[[Motion, int, dict[str, float]], Array]] = {
    "torque_offset": lambda x, j, p: np.full(len(x.q), -p["offset"]),
    "rotor_inertia": lambda x, j, p: p["inertia"] * x.ddq[:, j],
    "joint_spring": lambda x, j, p: p["k"] * (x.q[:, j] - p["q0"]),
    "quadratic_drag": lambda x, j, p: p["c"] * x.dq[:, j] * np.abs(x.dq[:, j]),
    "coulomb_asymmetry": _dry(lambda x, j, p: p["delta"] * np.sign(x.dq[:, j])),
    "load_dependent_friction": _dry(lambda x, j, p: p["mu"] * np.abs(x.load[:, j])),
    "stribeck": _dry(lambda x, j, p: p["amplitude"] * np.exp(-((x.dq[:, j] / p["velocity"]) ** 2))),
    "position_dependent_friction": _dry(lambda x, j, p: p["a"] * np.cos(x.q[:, j]) + p["b"] * np.sin(x.q[:, j])),
    "gear_efficiency": _dry(lambda x, j, p: p["loss"] * np.maximum(x.tau[:, j] * np.sign(x.dq[:, j]), 0.0)),
}


def unknown(causes: list[dict[str, Any]]) -> list[str]:
    """Return the effects among the causes whose torque is not known here."""
    return sorted(
        {c["effect"] for c in causes if c["effect"] not in TORQUES or (_is_row(c) and c["effect"] != "joint_spring")}
    )


def torque_of(causes: list[dict[str, Any]], motion: Motion) -> Array:
    """Return the motors' torques due to all causes, shape (n_rows, n)."""
    total = np.zeros_like(motion.q)
    for cause in causes:
        values = {name: v["value"] for name, v in cause["parameters"].items()}
        joints = [j - 1 for j in cause.get("joints") or [cause["joint"]]]
        if _is_row(cause):
            row = np.array(cause["row"], float)
            along = values["k"] * (motion.q[:, joints] @ row - values["q0"])
            total[:, joints] += along[:, None] * row
            continue
        for place, j in enumerate(joints):
            own = {name: v[place] if isinstance(v, list) else v for name, v in values.items()}
            total[:, j] += TORQUES[cause["effect"]](motion, j, own)
    return total


def _is_row(cause: dict[str, Any]) -> bool:
    return cause.get("row") is not None
