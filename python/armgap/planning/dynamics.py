"""Torques that a motion needs, by inverse dynamics from the compiled core."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.evidence.hypothesis import TOLERANCE, EffectInstance, Hypothesis

__all__ = ["LATENT", "inverse_dynamics", "torque_with"]

Array = NDArray[np.float64]

#: Effects with a state that no encoder shows: their torque is no function of the present motion alone.
LATENT = ("joint_elasticity", "backlash", "presliding", "actuator_lag", "actuator_delay")
#: Effects that limit the torque, or whose torque has no bound, so that inverse dynamics fail.
UNREACHABLE = ("contact", "torque_saturation")
#: Length of the simulation whose change of velocity gives an acceleration, s.
INSTANT = 1e-5
#: Speed below which a joint may stick, rad/s or m/s.
MOVING = 1e-3


def accelerations(model: Hypothesis, q: Array, dq: Array, tau: Array, t: Array) -> Array:
    """Return accelerations of a model in given states under given torques [rad/s^2 or m/s^2]; shape of `q`."""
    arm = model.arm
    lengths = None if arm.link_length is None else arm.link_length.tolist()
    effects, theta = [e.on(e.joint) for e in model.effects], list(model.theta)
    times = (t[:, None] + np.array([0.0, INSTANT])).ravel()
    rows = [(2 * k, 2 * k + 2) for k in range(len(q))]
    _, speed, _ = _native.simulate_windows(
        arm.kind, arm.gravity, lengths, theta, times, np.repeat(tau, 2, axis=0), rows, 2, q, dq, effects, TOLERANCE, model.smoothing
    )  # fmt: skip
    return (speed[:, 1] - speed[:, 0]) / INSTANT


def inverse_dynamics(model: Hypothesis, q: Array, dq: Array, ddq: Array) -> Array:
    """Return the torques of a motion for the arm without effects, dry friction included [N m or N]; shape of `q`.

    The torque is the inertia matrix times the difference of `ddq` from the accelerations without torque and friction, plus friction.
    """
    arm = model.arm
    b, n = arm.n_inertial, arm.n_joints
    theta = np.array(model.theta)
    smooth = replace(model, theta=tuple(np.concatenate([theta[:b], np.zeros(2 * n)])), effects=(), smoothing=())
    free = accelerations(smooth, q, dq, np.zeros_like(q), np.zeros(len(q)))
    needed = np.einsum("kij,kj->ki", smooth.inertia(q), ddq - free)
    return np.asarray(needed + theta[b : b + n] * dq + theta[b + n :] * np.sign(dq), dtype=np.float64)


def torque_with(
    model: Hypothesis, effects: Sequence[EffectInstance], t: Array, motion: tuple[Array, Array, Array], tau: Array
) -> Array:
    """Return the torques of a motion with effects added to a model, to first order from torques `tau` without them; shape of `tau`.

    Effects in `LATENT` and `UNREACHABLE` are left out; at instants at which a joint is slower than `MOVING`, `tau` is returned.
    """
    changed = tuple(e for e in effects if e.effect not in (*LATENT, *UNREACHABLE))
    if not changed:
        return tau
    full = model.only((*(e for e in model.effects if e.effect not in (*LATENT, *UNREACHABLE)), *changed))
    q, dq, ddq = motion
    missing = ddq - accelerations(full, q, dq, tau, t)
    more = np.einsum("kij,kj->ki", full.inertia(q), missing)
    moving = np.all(np.abs(dq) > MOVING, axis=1)
    return np.asarray(np.where(moving[:, None], tau + more, tau), dtype=np.float64)
