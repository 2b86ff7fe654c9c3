"""Arm file of a trial case: nominal parameters as given to the diagnosis."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from armgap.trial.simulation.arms import TURN, TrialArm

#: Relative standard deviations that the arm file of a trial case states: of inertial parameters, and of friction coefficients.
SIGMA_INERTIAL = 0.05
SIGMA_FRICTION = 0.20


@dataclass(frozen=True)
class Nominal:
    """Nominal parameters of a trial case's arm file, with their standard deviations.

    Attributes
    ----------
    theta, sigma : tuple of float
        Parameters, in the order inertial, viscous, Coulomb, and their standard deviations [SI].
    """

    theta: tuple[float, ...]
    sigma: tuple[float, ...]


def draw_nominal(rng: np.random.Generator, arm: TrialArm, exact: bool) -> Nominal:
    """Return the nominal parameters of an arm: the true ones if `exact`, else with errors drawn from N(0, sigma) within 2.5 sigma."""
    truth = np.array(arm.theta)
    # Errors beyond 2.5 sigma would contradict the standard deviations that the arm file states.
    error = np.zeros(truth.size) if exact else np.clip(rng.standard_normal(truth.size), -2.5, 2.5)
    theta = tuple(float(x) for x in truth * (1.0 + _relative(arm) * error))
    return Nominal(theta, tuple(float(f"{x:.3g}") for x in spread(arm, theta)))


def spread(arm: TrialArm, theta: tuple[float, ...]) -> tuple[float, ...]:
    """Return the standard deviations that the arm file of a trial case states for parameters `theta` [SI]."""
    truth, stated = np.array(arm.theta), np.abs(theta)
    sigma = np.where(truth != 0, _relative(arm) * stated, SIGMA_INERTIAL * np.max(truth))
    return tuple(float(x) for x in sigma)


def _relative(arm: TrialArm) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    friction = 2 * arm.n_joints
    return np.repeat([SIGMA_INERTIAL, SIGMA_FRICTION], [len(arm.theta) - friction, friction])


def arm_toml(arm: TrialArm, nominal: Nominal, name: str, sha256: str) -> str:
    """Return the text of a case's arm file, with the hash of the sealed key."""
    base, n = len(arm.inertial), arm.n_joints
    inertial, viscous, coulomb = (slice(0, base), slice(base, base + n), slice(base + n, None))
    full_turn = 1.0 if arm.kind == "axis" else TURN
    lines = [
        f'name = "{name}"',
        f'kind = "{arm.kind}"',
        f"gravity = {arm.gravity!r}",
        f"sample_period = {arm.sample_period!r}",
        "",
        "[inertial]",
        f"theta = {_array(nominal.theta[inertial])}",
        f"sigma = {_array(nominal.sigma[inertial])}",
        "",
        "[friction]",
        f"viscous = {_array(nominal.theta[viscous])}",
        f"coulomb = {_array(nominal.theta[coulomb])}",
        f"sigma_viscous = {_array(nominal.sigma[viscous])}",
        f"sigma_coulomb = {_array(nominal.sigma[coulomb])}",
        "",
        "[encoder]",
        f"counts_per_rev = {[round(full_turn / s) for s in arm.step]}",
        "",
        "[actuator]",
        f"torque_limit = {_array(arm.torque_limit)}",
        "",
        "[geometry]",
        f"link_length = {_array(arm.length)}",
        "",
        "# What is hidden in the logs beside this file stands in key.json; this is that file's hash.",
        "[sealed]",
        f'sha256 = "{sha256}"',
        "",
    ]
    return "\n".join(lines)


def _array(values: tuple[float, ...]) -> str:
    if not all(math.isfinite(v) for v in values):
        raise ValueError(f"arm parameters are not finite: {values}")
    return "[" + ", ".join(repr(float(v)) for v in values) + "]"
