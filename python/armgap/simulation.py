"""Simulation of an arm with its nominal parameters and, on request, with effects of real arms."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armgap import _native, options
from armgap.arm.arm import Arm, checked_arm
from armgap.errors import OptionError
from armgap.log.log import Log
from armgap.progress import report_progress

__all__ = ["TOLERANCE_RATE", "Effect", "effects", "seed_torque", "simulate"]

TOLERANCE_RATE = 1e-9
"""Default tolerance of a simulation per second [rad/s or m/s], as errors grow with time: far below the step of any encoder (10^-6 rad), and above
what rounding leaves where joints with dry friction stick and slide, 1.5e-9 rad in 10 s.
"""
#: Words of the compiled core's error where the steps that it takes do not reach the tolerance.
_NOT_REACHED = "when the steps are halved"


@dataclass(frozen=True)
class Effect:
    """An effect on a joint, with its parameters.

    Attributes
    ----------
    name : str
        Name of the effect, see `effects`.
    joint : int or None
        1-based joint; None for an effect of the whole arm.
    parameters : mapping of str to float
        Values of the effect's parameters [SI], by name.
    """

    name: str
    joint: int | None
    parameters: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def parse(cls, text: str) -> Effect:
        """Read an effect from a text ``NAME:JOINT:key=value,…``; the joint of a whole-arm effect is left empty.

        Raises
        ------
        OptionError
            If the text has another form.
        """
        match = re.fullmatch(r"([a-z_]+):([0-9]*):(.*)", text.strip())
        if match is None:
            raise OptionError(
                f"`{text}` is not an effect",
                remedy="write NAME:JOINT:key=value,... such as stribeck:2:amplitude=0.5,velocity=0.2",
            )
        name, joint, pairs = match.groups()
        values = {}
        for pair in filter(None, pairs.split(",")):
            key, _, value = pair.partition("=")
            try:
                values[key.strip()] = float(value)
            except ValueError:
                raise OptionError(f"`{pair}` of effect `{name}` is not key=number", remedy="write key=value") from None
        return cls(name, int(joint) if joint else None, values)


def effects() -> list[dict[str, Any]]:
    """Return the effect library: name, title, equation, source, scope and parameters of each effect."""
    return _native.effects()


def seed_torque(t: ArrayLike) -> NDArray[np.float64]:
    """Return the excitation torques of a two-link arm in equations (31) and (32) of Reyes and Kelly (1997).

    Parameters
    ----------
    t : array_like, shape (n_samples,)
        Times [s].

    Returns
    -------
    ndarray, shape (n_samples, 2)
        Torques [N m].

    Examples
    --------
    >>> seed_torque([0.0]).round(3).tolist()
    [[8.134, 1.306]]
    """
    t = np.asarray(t, dtype=np.float64)
    tau1 = (1 - np.exp(-0.8 * t)) * 29.0 + 68 * np.sin(16 * t + 0.1) + 9 * np.sin(20 * t + 0.15)
    tau2 = (1 - np.exp(-1.8 * t)) * 1.2 + 8 * np.sin(26 * t + 0.08) + 2 * np.sin(12 * t + 0.34)
    return np.column_stack([tau1, tau2])


def simulate(
    arm: Arm,
    t: ArrayLike,
    tau: ArrayLike,
    *,
    q0: ArrayLike | None = None,
    dq0: ArrayLike | None = None,
    effects: Sequence[Effect] = (),
    encoder: bool = True,
    noise: float = 0.0,
    seed: int = 0,
    tolerance: float | None = None,
    smoothing: ArrayLike = 0.0,
    sensor: bool = False,
    name: str = "simulated",
) -> Log:
    """Simulate an arm under torques held from sample to sample.

    Classical Runge-Kutta with the changes between sliding and sticking located inside the steps; the steps are halved
    until no position changes by more than `tolerance`.

    Parameters
    ----------
    arm : Arm
        Arm to simulate.
    t : array_like, shape (n_samples,)
        Sample times [s], increasing, evenly spaced or not.
    tau : array_like, shape (n_samples, n_joints)
        Torques, held until the next sample [N m].
    q0, dq0 : array_like, shape (n_joints,), optional
        Initial positions and velocities; by default at rest at ``q = 0``.
    effects : sequence of Effect
        Effects added to the arm.
    encoder : bool, default True
        Round positions to the arm's encoder counts, if it has them.
    noise : float, default 0
        Standard deviation of white noise on positions [rad or m], added before rounding.
    seed : int, default 0
        Seed of the noise.
    tolerance : float, optional
        Largest admissible change of a position when steps are halved [rad or m]; by default `TOLERANCE_RATE` times the duration, at least 1 s.
    smoothing : float or array_like, shape (n_joints,), default 0
        Width of the friction regularisation [rad/s], of all joints or joint by joint; 0 is dry friction.
    sensor : bool, default False
        Keep the simulated velocities as the log's `dq`.
    name : str
        Name of the log.

    Returns
    -------
    Log

    Raises
    ------
    OptionError
        If a shape, an effect or a value is impossible, or the motion diverges.
    """
    checked_arm(arm)
    seed = options.seed(seed)
    _check_effects(effects)
    t = np.ascontiguousarray(t, dtype=np.float64)
    tau = np.ascontiguousarray(tau, dtype=np.float64)
    tau = np.ascontiguousarray(tau[:, None]) if tau.ndim == 1 else tau
    n = arm.n_joints
    start = np.zeros(n) if q0 is None else np.ascontiguousarray(q0, dtype=np.float64)
    speed = np.zeros(n) if dq0 is None else np.ascontiguousarray(dq0, dtype=np.float64)
    if len(t) < 2 or np.any(np.diff(t) <= 0) or not (np.isfinite(t).all() and np.isfinite(tau).all()):
        raise OptionError("`t` must increase and everything be finite", remedy="correct the torque table")
    if not (noise >= 0 and np.isfinite(noise)):
        raise OptionError(f"the noise is {noise}", remedy="give its standard deviation, 0 or more")
    if tolerance is None:
        tolerance = TOLERANCE_RATE * max(1.0, float(t[-1] - t[0]))
    tolerance = options.positive(tolerance, "tolerance", remedy="give a positive number of rad or m")
    widths = np.broadcast_to(np.asarray(smoothing, dtype=np.float64), n).tolist()
    placed = [(e.name, e.joint, dict(e.parameters)) for e in effects]
    try:
        if arm.chain is not None:
            theta = arm.theta.tolist()
            motion = arm.chain.native().simulate(
                theta, t, tau, start, speed, placed, tolerance, widths, report_progress
            )
        else:
            lengths = None if arm.link_length is None else arm.link_length.tolist()
            motion = _native.simulate(
                arm.kind,
                arm.gravity,
                lengths,
                arm.theta.tolist(),
                t,
                tau,
                start,
                speed,
                placed,
                tolerance,
                widths,
                report_progress,
            )
        q, dq = motion
    except (ValueError, TypeError, OverflowError) as error:
        remedy = "see `armgap.effects()` and the arm file"
        if _NOT_REACHED in str(error):
            remedy = f"allow more with tolerance (--tolerance), which is {tolerance:.2g}, or simulate a shorter time"
        raise OptionError(str(error), remedy=remedy) from None
    if noise > 0:
        with np.errstate(over="ignore"):
            q = q + noise * np.random.default_rng(seed).standard_normal(q.shape)
    if not np.isfinite(q).all():
        raise OptionError(f"positions under a noise of {noise} are not finite", remedy="give less noise")
    step = arm.encoder_step
    if encoder and step is not None:
        q = np.round(q / step) * step
    return Log(name, t - t[0], q, tau, dq if sensor else None)


def _check_effects(effects: Any) -> None:
    """Raise if a sequence holds anything but effects of the library (`Effect`)."""
    for effect in (effects,) if isinstance(effects, str | Effect) else effects:
        if not isinstance(effect, Effect) or effect is effects:
            remedy = (
                "give a list of armgap.simulation.Effect, such as [Effect.parse('stribeck:1:amplitude=1,velocity=0.1')]"
            )
            raise OptionError(f"`effects` holds {effect!r}", remedy=remedy)
