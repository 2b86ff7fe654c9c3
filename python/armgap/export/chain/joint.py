"""Friction, springs, drive, encoder and stops of one joint of a corrected model, and their changes by effects."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from armgap.diagnosis.result import Cause

__all__ = ["ON_JOINT", "Joint", "with_causes"]


@dataclass(frozen=True)
class Joint:
    """Friction, springs, drive, encoder and stop of one joint of a corrected model [SI].

    Attributes
    ----------
    viscous, coulomb : float
        Friction coefficients [N m s/rad, N m; N s/m, N].
    armature : float
        Reflected rotor inertia, which acts on the joint's own acceleration only [kg m^2 or kg].
    stiffness, cubic, rest : float
        Spring ``-stiffness (q - rest) - cubic (q - rest)^3``.
    drag, cubic_drag : float
        Torques ``-drag dq |dq|`` and ``-cubic_drag dq^3``.
    offset, gain, delay, lag : float
        Drive: torque ``gain u + offset`` [N m or N], with the command `u` delayed by `delay` [s] and lagged by `lag` [s].
    limit : float, optional
        Command beyond which the torque no longer grows [N m or N]; None without a limit.
    reading : float
        Encoder reading at ``q = 0`` [rad or m].
    stop : (position, stiffness), optional
        Position [rad or m] beyond which a spring acts, and its stiffness [N m/rad or N/m]; the spring acts on the side away from zero, or
        towards zero where the stiffness is negative.
    """

    viscous: float
    coulomb: float
    armature: float = 0.0
    stiffness: float = 0.0
    cubic: float = 0.0
    rest: float = 0.0
    drag: float = 0.0
    offset: float = 0.0
    gain: float = 1.0
    delay: float = 0.0
    lag: float = 0.0
    limit: float | None = None
    reading: float = 0.0
    stop: tuple[float, float] | None = None
    cubic_drag: float = 0.0

    @property
    def damping(self) -> NDArray[np.float64]:
        """Coefficients of ``dq``, ``dq |dq|`` and ``dq^3`` in the torque against the velocity, up to the last that is not zero."""
        given = [self.viscous, self.drag, self.cubic_drag]
        return np.array(given[: 3 if self.cubic_drag else 2 if self.drag else 1])

    def free(self, far: float) -> tuple[float, float, float] | None:
        """Return the encoder readings between which no stop acts, `far` on the side without one, and the stop's stiffness; None without a stop."""
        if self.stop is None:
            return None
        position, stiffness = self.stop
        edge = position + self.reading
        towards_larger = (position >= 0) == (stiffness >= 0)
        return (-far, edge, abs(stiffness)) if towards_larger else (edge, far, abs(stiffness))


def _spring(joint: Joint, p: Mapping[str, float]) -> Joint:
    """Return the joint with one more spring; a hardening spring's rest position is kept, and preload becomes a torque offset."""
    k, q0, cubic = p["k"], p["q0"], p.get("cubic", 0.0)
    stiffness, preload = joint.stiffness + k, joint.stiffness * joint.rest + k * q0
    if cubic or joint.cubic:
        rest = q0 if cubic else joint.rest
        offset = joint.offset + preload - stiffness * rest
        return replace(joint, stiffness=stiffness, cubic=joint.cubic + cubic, rest=rest, offset=offset)
    return replace(joint, stiffness=stiffness, rest=preload / stiffness if stiffness else 0.0)


def _saturation(joint: Joint, p: Mapping[str, float]) -> Joint:
    level = p["level"] / joint.gain
    return replace(joint, limit=level if joint.limit is None else min(level, joint.limit))


ON_JOINT: dict[str, Callable[[Joint, Mapping[str, float]], Joint]] = {
    "rotor_inertia": lambda j, p: replace(j, armature=j.armature + p["inertia"]),
    "joint_spring": _spring,
    "hardening_spring": _spring,
    "quadratic_drag": lambda j, p: replace(j, drag=j.drag + p["c"]),
    "cubic_drag": lambda j, p: replace(j, cubic_drag=j.cubic_drag + p["c3"]),
    "torque_offset": lambda j, p: replace(j, offset=j.offset + p["offset"]),
    "coulomb_asymmetry": lambda j, p: replace(j, offset=j.offset - p["delta"]),
    "torque_gain": lambda j, p: replace(j, gain=j.gain * p["gain"]),
    "torque_saturation": _saturation,
    "actuator_lag": lambda j, p: replace(j, lag=j.lag + p["time_constant"]),
    "actuator_delay": lambda j, p: replace(j, delay=j.delay + p["delay"]),
    "encoder_offset": lambda j, p: replace(j, reading=j.reading + p["offset"]),
    "contact": lambda j, p: replace(j, stop=(p["position"], p["stiffness"])),
}
"""Functions that apply an effect to a joint, by name of the effect; payload and tilt concern the whole arm."""


def with_causes(joints: Iterable[Joint], causes: Iterable[Cause]) -> tuple[Joint, ...]:
    """Return joints with the changes by all causes applied, one after the other."""
    changed = list(joints)
    for cause in causes:
        if cause.effect in ON_JOINT and cause.joint is not None:
            values = {name: v.value for name, v in cause.parameters.items()}
            changed[cause.joint - 1] = ON_JOINT[cause.effect](changed[cause.joint - 1], values)
    return tuple(changed)
