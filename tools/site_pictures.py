"""The picture of an effect's signature: the same torques with and without it, and the torque the model lacks.

Everything is simulated when the site is built; nothing is drawn from memory.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap import Arm, effects, simulate
from armgap.simulation import Effect

__all__ = ["SIGNATURES", "Signature", "draw", "lacking"]

PERIOD_S = 0.002
DURATION_S = 8.0
INK = "#808890"
WITHOUT = "#0072B2"
WITH = "#D55E00"
#: Inertia [kg m^2], m g l [N m], viscous [N m s/rad], Coulomb [N m] of a bench pendulum.
THETA = np.array([0.05, 0.6, 0.02, 0.1])
#: What stands on the horizontal axis of the second panel.
AXES = {
    "dq": "velocity dq [rad/s]",
    "q": "position q [rad]",
    "t": "time t [s]",
    "tau": "commanded torque tau [N m]",
    "dtau": "rate of the commanded torque [N m/s]",
    "ddq": "acceleration ddq [rad/s^2]",
    "gravity": "gravity torque m g l sin q [N m]",
}


@dataclass(frozen=True)
class Signature:
    """How an effect is shown: its size, the variable that reveals it, and how strongly the arm is driven."""

    parameters: dict[str, float]
    against: str
    drive: float = 0.8


SIGNATURES: dict[str, Signature] = {
    "coulomb_asymmetry": Signature({"delta": 0.05}, "dq"),
    "torque_offset": Signature({"offset": 0.08}, "t"),
    "stribeck": Signature({"amplitude": 0.12, "velocity": 0.4}, "dq"),
    "quadratic_drag": Signature({"c": 0.008}, "dq", 1.1),
    "load_dependent_friction": Signature({"mu": 0.25}, "gravity"),
    "position_dependent_friction": Signature({"a": 0.06, "b": 0.05}, "q", 1.1),
    "friction_warmup": Signature({"amplitude": 1.2, "time_constant": 2.0}, "t"),
    "presliding": Signature({"amplitude": 0.1, "stiffness": 5.0}, "q"),
    "joint_elasticity": Signature({"stiffness": 40.0, "damping": 0.05, "rotor_inertia": 0.01}, "t"),
    "backlash": Signature({"gap": 0.02}, "t"),
    "torque_gain": Signature({"gain": 1.25}, "tau"),
    "actuator_lag": Signature({"time_constant": 0.02}, "dtau"),
    "actuator_delay": Signature({"delay": 0.02}, "dtau"),
    "torque_saturation": Signature({"level": 0.5}, "tau"),
    "torque_ripple": Signature({"amplitude": 0.06, "n": 8.0, "phase": 0.0}, "q", 1.1),
    "torque_dead_zone": Signature({"level": 0.15}, "tau"),
    "payload": Signature({"mass": 0.08, "distance": 0.4}, "ddq"),
    "base_tilt": Signature({"angle": 0.15}, "q", 1.1),
    "joint_spring": Signature({"k": 0.2, "q0": 0.2}, "q", 1.1),
    "rotor_inertia": Signature({"inertia": 0.01}, "ddq"),
    "encoder_offset": Signature({"offset": 0.15}, "q", 1.1),
    "encoder_eccentricity": Signature({"a": 0.05, "b": 0.03}, "q", 1.1),
    "contact": Signature({"position": 0.6, "stiffness": 8.0, "damping": 0.05}, "q"),
    "external_pulse": Signature({"time": 4.0, "duration": 0.1, "impulse": 0.05}, "t"),
}
"""One per effect; sizes are large enough to be seen with the naked eye."""


def lacking(q: NDArray[np.float64], tau: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Torque the nominal pendulum lacks between samples, and what it may depend on.

    Parameters
    ----------
    q, tau : ndarray, shape (n,)
        Positions [rad] and held torques [N m] at the samples.

    Returns
    -------
    dict of ndarray, shape (n - 2,)
        Keys of `AXES` and ``"lack"``, at all samples but the outer ones.
    """
    dq = (q[2:] - q[:-2]) / (2 * PERIOD_S)
    ddq = (q[2:] - 2 * q[1:-1] + q[:-2]) / PERIOD_S**2
    middle, held = q[1:-1], 0.5 * (tau[:-2] + tau[1:-1])
    gravity = THETA[1] * np.sin(middle)
    model = THETA[0] * ddq + gravity + THETA[2] * dq + THETA[3] * np.sign(dq)
    return {
        "lack": model - held,
        "q": middle,
        "dq": dq,
        "ddq": ddq,
        "t": PERIOD_S * np.arange(1, len(q) - 1),
        "tau": held,
        "dtau": (tau[1:-1] - tau[:-2]) / PERIOD_S,
        "gravity": gravity,
    }


def motion(name: str | None) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Times, positions and torques of the pendulum, with an effect or without."""
    shown = SIGNATURES[name] if name else Signature({}, "t")
    return _simulated(placed(name) if name else [], shown.drive)


def placed(name: str) -> list[Effect]:
    """The effect as the picture shows it, with the parameters the catalogue knows."""
    entry = next(e for e in effects() if e["name"] == name)
    sizes = SIGNATURES[name].parameters
    known = {p["name"]: sizes[p["name"]] for p in entry["parameters"]}
    return [Effect(name, 1 if entry["scope"] == "joint" else None, known)]


def _simulated(
    present: list[Effect], drive: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    arm = Arm("bench pendulum", "pendulum", 9.81, PERIOD_S, THETA, 0.1 * THETA)
    t = PERIOD_S * np.arange(round(DURATION_S / PERIOD_S))
    tau = drive * (0.45 * np.sin(2.1 * t) + 0.35 * np.sin(5.3 * t + 1.0) + 0.2 * np.sin(11.0 * t + 2.0))
    log = simulate(arm, t, tau, effects=present, tolerance=1e-4)
    return t, log.q[:, 0], tau


def draw(name: str) -> bytes:
    """Return the picture of an effect as SVG."""
    from matplotlib.figure import Figure

    shown = SIGNATURES[name]
    t, with_it, tau = _simulated(placed(name), shown.drive)
    _, without, _ = _simulated([], shown.drive)
    figure = Figure(figsize=(8.4, 3.2), layout="constrained")
    figure.patch.set_alpha(0.0)
    left, right = figure.subplots(1, 2)
    left.plot(t[::16], without[::16], color=WITHOUT, label="model")
    left.plot(t[::16], with_it[::16], color=WITH, linestyle="--", label="with the effect")
    left.legend(frameon=False, labelcolor=INK, fontsize=8)
    _dress(left, "the same torques", "time t [s]", "measured position [rad]")
    seen = lacking(with_it, tau)
    quiet = np.abs(seen["lack"]) < 4 * np.quantile(np.abs(seen["lack"]), 0.98)  # stops and starts last one sample
    right.plot(seen[shown.against][quiet][::5], seen["lack"][quiet][::5], ".", markersize=1.8, color=WITH)
    _dress(right, "what the model lacks", AXES[shown.against], "torque [N m]")
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
