"""Picture of an effect for the documentation: positions with and without it under equal torques, and residual torque of the nominal model.

The curves are simulated when the site is built.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap import Arm, effects, simulate
from armgap.simulation import Effect

__all__ = ["SIGNATURES", "Signature", "draw", "residual_torque"]

PERIOD_S = 0.002
DURATION_S = 8.0
INK = "#808890"
WITHOUT = "#0072B2"
WITH = "#D55E00"
#: Parameters of a bench pendulum: inertia [kg m^2], m g l [N m], viscous [N m s/rad] and Coulomb friction [N m]; and those of a two-link
#: arm of two pendulums, for effects between joints.
THETA = {
    "pendulum": np.array([0.05, 0.6, 0.02, 0.1]),
    "two-link": np.array([0.12, 0.02, 0.03, 1.4, 0.5, 0.02, 0.01, 0.1, 0.06]),
}
#: Labels of the horizontal axis in the chart of the residual torque, by variable.
AXES = {
    "dq": "velocity dq [rad/s]",
    "q": "position q [rad]",
    "t": "time t [s]",
    "tau": "commanded torque tau [N m]",
    "dtau": "rate of the commanded torque [N m/s]",
    "ddq": "acceleration ddq [rad/s^2]",
    "gravity": "gravity torque m g l sin q [N m]",
    "other dq": "velocity of the other joint [rad/s]",
    "other ddq": "acceleration of the other joint [rad/s^2]",
}


@dataclass(frozen=True)
class Signature:
    """Settings of an effect's picture: parameters, variable that reveals the effect, factor on the torques, and kind of arm.

    The picture shows joint 1, which also has the effect if it is an effect of one joint.
    """

    parameters: dict[str, float]
    against: str
    drive: float = 0.8
    kind: str = "pendulum"
    tolerance: float = 1e-4
    """Tolerance of the simulated positions [rad]; a larger one for effects with impacts, which amplify errors."""


SIGNATURES: dict[str, Signature] = {
    "coulomb_asymmetry": Signature({"delta": 0.05}, "dq"),
    "torque_offset": Signature({"offset": 0.08}, "t"),
    "stribeck": Signature({"amplitude": 0.12, "velocity": 0.4}, "dq"),
    "quadratic_drag": Signature({"c": 0.008}, "dq", 1.1),
    "cubic_drag": Signature({"c3": 0.002}, "dq", 1.1),
    "load_dependent_friction": Signature({"mu": 0.25}, "gravity"),
    "position_dependent_friction": Signature({"a": 0.06, "b": 0.05}, "q", 1.1),
    "friction_warmup": Signature({"amplitude": 1.2, "time_constant": 2.0}, "t"),
    "presliding": Signature({"amplitude": 0.1, "stiffness": 0.4}, "q"),
    "viscous_asymmetry": Signature({"delta": 0.015}, "dq"),
    "cross_friction": Signature({"level": 0.08}, "other dq", kind="two-link"),
    "gear_efficiency": Signature({"loss": 0.2}, "tau"),
    "joint_elasticity": Signature({"stiffness": 40.0, "damping": 0.02, "rotor_inertia": 0.01}, "t"),
    "backlash": Signature({"gap": 0.05, "rotor_share": 0.2, "riding": 1.0}, "t", tolerance=5e-3),
    "torque_gain": Signature({"gain": 1.25}, "tau"),
    "actuator_lag": Signature({"time_constant": 0.02}, "dtau"),
    "actuator_delay": Signature({"delay": 0.02}, "dtau"),
    "torque_saturation": Signature({"level": 0.5}, "tau"),
    "torque_ripple": Signature({"amplitude": 0.06, "n": 8.0, "phase": 0.0}, "q", 1.1),
    "torque_dead_zone": Signature({"level": 0.15}, "tau"),
    "payload": Signature({"mass": 0.08, "distance": 0.4}, "gravity"),
    "base_tilt": Signature({"angle": 0.15}, "q", 1.1),
    "joint_spring": Signature({"k": 0.2, "q0": 0.2}, "q", 1.1),
    "hardening_spring": Signature({"k": 0.05, "cubic": 0.06, "q0": 0.2}, "q", 1.1),
    "rotor_inertia": Signature({"inertia": 0.01}, "ddq"),
    "rotor_coupling": Signature({"inertia": 0.01}, "other ddq", kind="two-link"),
    "encoder_offset": Signature({"offset": 0.15}, "q", 1.1),
    "encoder_eccentricity": Signature({"a": 0.05, "b": 0.03}, "q", 1.1),
    "contact": Signature({"position": 0.6, "stiffness": 8.0, "damping": 0.05}, "q"),
    "external_pulse": Signature({"impulse": 0.06, "time": 4.0, "duration": 0.2}, "t"),
}
"""Settings of the pictures by effect; parameters are large enough for a visible difference."""


def residual_torque(kind: str, q: NDArray[np.float64], tau: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Return the residual torque of joint 1 of the nominal arm, and the variables on which it may depend.

    Parameters
    ----------
    kind : {"pendulum", "two-link"}
        Key of `THETA`.
    q, tau : ndarray, shape (n, n_joints)
        Positions [rad] and torques [N m] at the samples; torques are held until the next sample.

    Returns
    -------
    dict of ndarray, shape (n - 2,)
        Variables of `AXES` and ``"residual"`` [N m], at all samples but the first and the last.
    """
    dq = (q[2:] - q[:-2]) / (2 * PERIOD_S)
    ddq = (q[2:] - 2 * q[1:-1] + q[:-2]) / PERIOD_S**2
    middle, held = q[1:-1], 0.5 * (tau[:-2] + tau[1:-1])
    rigid, gravity = _first_joint(kind, middle, dq, ddq)
    other = min(1, q.shape[1] - 1)
    return {
        "residual": rigid + gravity - held[:, 0],
        "q": middle[:, 0],
        "dq": dq[:, 0],
        "ddq": ddq[:, 0],
        "t": PERIOD_S * np.arange(1, len(q) - 1),
        "tau": held[:, 0],
        "dtau": (tau[1:-1, 0] - tau[:-2, 0]) / PERIOD_S,
        "gravity": gravity,
        "other dq": dq[:, other],
        "other ddq": ddq[:, other],
    }


def _first_joint(
    kind: str, q: NDArray[np.float64], dq: NDArray[np.float64], ddq: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return inertial plus friction torque, and gravity torque, of joint 1 by its equation of motion [N m], shape (n,) each."""
    p = THETA[kind]
    if kind == "pendulum":
        friction = p[2] * dq[:, 0] + p[3] * np.sign(dq[:, 0])
        return p[0] * ddq[:, 0] + friction, p[1] * np.sin(q[:, 0])
    c2, s2 = np.cos(q[:, 1]), np.sin(q[:, 1])
    inertial = (p[0] + 2 * p[1] * c2) * ddq[:, 0] + (p[2] + p[1] * c2) * ddq[:, 1]
    coriolis = -p[1] * s2 * dq[:, 1] * (2 * dq[:, 0] + dq[:, 1])
    friction = p[5] * dq[:, 0] + p[7] * np.sign(dq[:, 0])
    return inertial + coriolis + friction, p[3] * np.sin(q[:, 0]) + p[4] * np.sin(q[:, 0] + q[:, 1])


def placed(name: str) -> list[Effect]:
    """Return the effect of a picture, with those parameters of its settings that the effect library has."""
    entry = next(e for e in effects() if e["name"] == name)
    sizes = SIGNATURES[name].parameters
    known = {p["name"]: sizes[p["name"]] for p in entry["parameters"]}
    return [Effect(name, 1 if entry["scope"] == "joint" else None, known)]


def motion(name: str, *, present: bool = True) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return times [s], positions [rad] and torques [N m] of the arm in an effect's picture, with the effect or without it."""
    shown = SIGNATURES[name]
    theta = THETA[shown.kind]
    arm = Arm("bench arm", shown.kind, 9.81, PERIOD_S, theta, 0.1 * theta)
    t = PERIOD_S * np.arange(round(DURATION_S / PERIOD_S))
    tau = 0.45 * np.sin(2.1 * t) + 0.35 * np.sin(5.3 * t + 1.0) + 0.2 * np.sin(11.0 * t + 2.0)
    second = 0.25 * np.sin(3.3 * t + 1.0) + 0.2 * np.sin(7.9 * t)
    driven = tau[:, None] if shown.kind == "pendulum" else np.column_stack([1.5 * tau, second])
    log = simulate(arm, t, shown.drive * driven, effects=placed(name) if present else [], tolerance=shown.tolerance)
    return t, log.q, log.tau


def draw(name: str) -> bytes:
    """Return the picture of an effect as an SVG file."""
    from matplotlib.figure import Figure

    shown = SIGNATURES[name]
    t, with_it, tau = motion(name)
    _, without, _ = motion(name, present=False)
    figure = Figure(figsize=(8.4, 3.2), layout="constrained")
    figure.patch.set_alpha(0.0)
    left, right = figure.subplots(1, 2)
    left.plot(t[::16], without[::16, 0], color=WITHOUT, label="model")
    left.plot(t[::16], with_it[::16, 0], color=WITH, linestyle="--", label="with the effect")
    left.legend(frameon=False, labelcolor=INK, fontsize=8)
    _dress(left, "the same torques", "time t [s]", "measured position [rad]")
    seen = residual_torque(shown.kind, with_it, tau)
    # At a joint at rest the friction torque is not determined; samples at which a joint stops or starts mix two accelerations.
    quiet = (np.abs(seen["dq"]) > 1e-3) & (np.abs(seen["residual"]) < 4 * np.quantile(np.abs(seen["residual"]), 0.98))
    right.plot(seen[shown.against][quiet][::5], seen["residual"][quiet][::5], ".", markersize=1.8, color=WITH)
    _dress(right, "residual torque", AXES[shown.against], "torque [N m]")
    out = io.BytesIO()
    figure.savefig(out, format="svg", metadata={"Date": None})
    return out.getvalue()


def _dress(axes: Any, title: str, x: str, y: str) -> None:
    axes.patch.set_alpha(0.0)
    axes.set_title(title, color=INK, fontsize=10)
    axes.set_xlabel(x, color=INK, fontsize=9)
    axes.set_ylabel(y, color=INK, fontsize=9)
    axes.tick_params(colors=INK, labelsize=8)
    axes.grid(color=INK, alpha=0.2)
    for spine in axes.spines.values():
        spine.set_visible(False)
