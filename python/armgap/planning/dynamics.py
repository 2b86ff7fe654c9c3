"""Torques that a motion needs, by the compiled core: nothing here knows an arm's equation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.evidence.hypothesis import TOLERANCE, EffectInstance, Hypothesis

__all__ = ["LATENT", "inverse_dynamics", "torque_with"]

Array = NDArray[np.float64]

#: Effects with a state that no encoder shows: their torque is not that of an instant.
LATENT = ("joint_elasticity", "backlash", "presliding", "actuator_lag", "actuator_delay")
#: Effects that let no torque suffice, or whose torque has no bound.
UNREACHABLE = ("contact", "torque_saturation")
#: Time over which an acceleration is taken, s.
INSTANT = 1e-5
#: Speed below which a joint may stick, rad/s or m/s.
MOVING = 1e-3


def accelerations(model: Hypothesis, q: Array, dq: Array, tau: Array, t: Array) -> Array:
    """Accelerations of a model in some states, under some torques; shape of `q`."""
    arm = model.arm
    lengths = None if arm.link_length is None else arm.link_length.tolist()
    effects, theta = [e.on(e.joint) for e in model.effects], list(model.theta)
    times = t[:, None] + np.array([0.0, INSTANT])
    held = np.repeat(tau[:, None], 2, axis=1)
    found = np.empty_like(q)
    for k in range(len(q)):
        _, speed = _native.simulate(
            arm.kind, arm.gravity, lengths, theta, times[k], held[k], q[k], dq[k], effects, TOLERANCE, model.smoothing
        )
        found[k] = (speed[1] - speed[0]) / INSTANT
    return found


def inverse_dynamics(model: Hypothesis, q: Array, dq: Array, ddq: Array) -> Array:
    """Torques of a motion of the arm without effects, dry friction included; shape of `q`.

    The motion's accelerations differ from those of the arm without friction and torque by what the torque gives it.
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
    """Torques of a motion with effects added to a model, to first order from torques `tau` without them; shape of `tau`.

    Effects with latent states, and those that no torque overcomes, are left out; so are instants at which a joint hardly moves.
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
