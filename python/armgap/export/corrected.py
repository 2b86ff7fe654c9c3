"""A diagnosis as a corrected model: base parameters, links that could be built, and per joint what simulators have fields for."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm import Arm
from armgap.diagnosis import Cause, Diagnosis, Value
from armgap.export.errors import ExportError
from armgap.export.fields import FIELDS, field_of
from armgap.export.links import Links, physical

__all__ = ["STAGES", "Corrected", "Joint", "correct"]

#: Stages of a diagnosis that can be exported.
STAGES = ("with_causes", "refit")
#: Values of the arm file and the diagnosis agree to this, relative.
_SAME = 1e-9


@dataclass(frozen=True)
class Joint:
    """One corrected joint, SI.

    Attributes
    ----------
    viscous, coulomb : float
        Friction.
    armature : float
        Inertia on the joint's own acceleration only.
    stiffness, cubic, rest : float
        Spring ``-stiffness (q - rest) - cubic (q - rest)^3``.
    drag : float
        Torque ``-drag dq |dq|``.
    offset, gain, delay, lag : float
        Drive: torque ``gain u + offset`` with the command `u` delayed [s] and lagged [s].
    limit : float, optional
        Largest command that gives more torque.
    reading : float
        What the encoder shows at ``q = 0``.
    stop : (position, stiffness), optional
        Spring beyond a position, on the side away from zero.
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


@dataclass(frozen=True)
class Corrected:
    """An arm as a diagnosis found it, ready to be written for a simulator.

    Attributes
    ----------
    arm : Arm
        The arm file it started from.
    stage : str
        ``"with_causes"`` or ``"refit"``.
    theta, sigma : ndarray, shape (n_parameters,)
        Base parameters with every cause in them that is a change of base parameters, and their standard deviations.
    links : Links or None
        Link parameters that have these base parameters; None if no arm that could be built has them.
    joints : tuple of Joint
        What sits at the joints.
    tilt : float
        Angle of the base against gravity [rad]; on a linear axis it is part of the slope.
    causes : tuple of Cause
        All causes of the stage, with a field or without.
    notes : tuple of str
        What to know about these values.
    verdict : str
        The diagnosis' verdict.
    unbuildable : ExportError, optional
        Why there are no links.
    """

    arm: Arm
    stage: str
    theta: NDArray[np.float64]
    sigma: NDArray[np.float64]
    links: Links | None
    joints: tuple[Joint, ...]
    tilt: float
    causes: tuple[Cause, ...]
    notes: tuple[str, ...]
    verdict: str
    unbuildable: ExportError | None = None

    def field_of(self, cause: Cause, form: str) -> str | None:
        """Return where a cause goes in a format, None if it has no field there."""
        if cause.effect == "rotor_coupling" and self.uncoupled() is None:
            return field_of(cause.effect, cause.joint, form, self.arm.kind) if form == "json" else None
        return field_of(cause.effect, cause.joint, form, self.arm.kind)

    def uncoupled(self) -> Corrected | None:
        """Return a model of the same motion without inertial coupling of a remote rotor.

        An inertia `x` that is added to ``M_12`` alone is theta3 larger by `x` with a rotor of joint 2 smaller by `x`. None if
        that leaves no rotor that could be built, as for a positive coupling without a rotor inertia of joint 2.
        """
        x = sum(_value(cause, "inertia") for cause in self.causes if cause.effect == "rotor_coupling")
        if not x:
            return self
        first, second = self.joints
        theta = self.theta + x * (np.arange(len(self.theta)) == 2)
        links, _ = _links(self.arm, theta)
        if links is None or second.armature < x:
            return None
        return replace(self, theta=theta, links=links, joints=(first, replace(second, armature=second.armature - x)))

    def missing(self, form: str) -> tuple[str, ...]:
        """Return one line per cause that a format has no field for, or only in part."""
        lines = []
        for cause in self.causes:
            short = FIELDS[cause.effect].short if cause.effect in FIELDS else ""
            where = self.field_of(cause, form)
            if where is None:
                lines.append(f"no field for {_named(cause)}: {short or _equation(cause)}")
            elif short and form != "json":
                lines.append(f"{_named(cause)} is in {where}, {short}")
        return tuple(lines)

    def remarks(self, form: str) -> tuple[str, ...]:
        """Return everything to know about the file of a format: what is missing in it, what was chosen, one line each."""
        links = ((self.uncoupled() or self) if form == "mjcf" else self).links
        chosen = links.choices if links is not None and form != "toml" else ()
        gone = (str(self.unbuildable),) if self.unbuildable is not None else ()
        force = self.links.surplus if self.links is not None and form == "urdf" else 0.0
        lost = (f"no field for the constant force of {force:.6g} N on the axis",) if force else ()
        return (*self.missing(form), *lost, *self.notes, *gone, *chosen)

    def built(self) -> Links:
        """Return the links, or raise why there are none."""
        if self.links is None:
            raise self.unbuildable or ExportError("has no links")
        return self.links

    def render(self, form: str) -> str:
        """Return the file of a format: ``"mjcf"``, ``"urdf"``, ``"toml"`` or ``"json"``.

        Raises
        ------
        ExportError
            If the format does not exist, or needs links and no arm that could be built has these values.
        """
        from armgap.export import data, mjcf, toml, urdf

        writers = {"mjcf": mjcf.render, "urdf": urdf.render, "toml": toml.render, "json": data.render}
        if form not in writers:
            raise ExportError(f"`{form}` is not a format", remedy=f"formats: {', '.join(writers)}")
        return writers[form](self)


def correct(diagnosis: Diagnosis, arm: Arm, *, stage: str = "with_causes", keep_lengths: bool = False) -> Corrected:
    """Turn a diagnosis into a corrected model.

    Parameters
    ----------
    diagnosis : Diagnosis
        What was found.
    arm : Arm
        The arm file it was found with.
    stage : {"with_causes", "refit"}, default "with_causes"
        Re-estimated parameters with the causes, or without them.
    keep_lengths : bool, default False
        Keep the arm file's length of link 1, and move theta2 and theta5 to it in the ratio of their variances. Without it
        the length is the one that they imply, and the dynamics are exactly those found.

    Returns
    -------
    Corrected

    Raises
    ------
    ExportError
        If the diagnosis belongs to another arm, or there is no length to keep.
    """
    _check(diagnosis, arm, stage)
    values = [diagnosis.parameters[stage][name] for name in arm.parameter_names]
    causes = diagnosis.causes if stage == "with_causes" else ()
    theta, tilt = np.array([v.value for v in values]), 0.0
    for cause in causes:
        theta = theta + _payload(arm, cause)
        tilt += _value(cause, "angle") if cause.effect == "base_tilt" else 0.0
    if arm.kind == "axis":
        theta[1] = theta[1] * math.cos(tilt) + theta[0] * arm.gravity * math.sin(tilt)
        tilt = 0.0
    notes = _notes(diagnosis, stage)
    if keep_lengths:
        theta, moved = _with_length(theta, values, arm)
        notes += moved
    links, unbuildable = _links(arm, theta)
    return Corrected(
        arm,
        stage,
        theta,
        np.array([v.sigma for v in values]),
        links,
        _joints(arm, theta, links, causes),
        tilt,
        causes,
        notes,
        diagnosis.verdict,
        unbuildable,
    )


def _links(arm: Arm, theta: NDArray[np.float64]) -> tuple[Links | None, ExportError | None]:
    inertial = theta[: arm.n_inertial].tolist()
    try:
        return physical(
            arm.kind, arm.gravity, inertial, length=_listed(arm.link_length), mass=_listed(arm.link_mass)
        ), None
    except ExportError as error:
        return None, error


def _listed(values: NDArray[np.float64] | None) -> list[float] | None:
    return None if values is None else [float(v) for v in values]


def _check(diagnosis: Diagnosis, arm: Arm, stage: str) -> None:
    if stage not in STAGES:
        raise ExportError(f"`{stage}` is not a stage", remedy=f"stages: {', '.join(STAGES)}")
    nominal = diagnosis.parameters["nominal"]
    if set(nominal) != set(arm.parameter_names):
        raise ExportError(
            f"the diagnosis is of an arm with parameters {', '.join(nominal)}, the arm file's kind is `{arm.kind}`",
            remedy="give the arm file of the diagnosis",
            file=arm.path,
        )
    for name, value in zip(arm.parameter_names, arm.theta, strict=True):
        if abs(nominal[name].value - value) > _SAME * max(1.0, abs(value)):
            raise ExportError(
                f"is {value:.6g} in the arm file, but the diagnosis was made with {nominal[name].value:.6g}",
                remedy="give the arm file of the diagnosis",
                file=arm.path,
                column=name,
            )


def _notes(diagnosis: Diagnosis, stage: str) -> tuple[str, ...]:
    if diagnosis.verdict == "none":
        return ("the diagnosis found no gap: these values differ from the arm file's by what noise allows",)
    if diagnosis.verdict == "unexplained":
        return ("the diagnosis leaves a gap unexplained: these values are the best of a model that does not fit",)
    unsure = [c for c in diagnosis.causes if c.equivalents] if stage == "with_causes" else []
    return tuple(
        f"these logs do not tell {_placed(c.effect, c.joint)} from "
        + ", ".join(_placed(e.effect, e.joint) for e in c.equivalents)
        for c in unsure
    )


def _payload(arm: Arm, cause: Cause) -> NDArray[np.float64]:
    """Change of the base parameters by a payload."""
    change = np.zeros(len(arm.parameter_names))
    if cause.effect != "payload":
        return change
    mass, distance, n = _value(cause, "mass"), _value(cause, "distance"), arm.n_joints
    masses, places, lengths = ([0.0] * (n - 1) + [x] for x in (mass, distance, 0.0))
    if n > 1:
        lengths[0] = _first_length(arm)
    change[: arm.n_inertial] = _native.theta_from_links(arm.kind, arm.gravity, masses, lengths, places, [0.0] * n)
    if arm.kind == "axis" and arm.theta[0] > 0:
        change[1] = mass * arm.theta[1] / arm.theta[0]
    return change


def _first_length(arm: Arm) -> float:
    """Length of link 1 with which the diagnosis placed a payload."""
    if arm.link_length is not None:
        return float(arm.link_length[0])
    return arm.gravity * float(arm.theta[1]) / float(arm.theta[4]) if arm.theta[4] > 0 else 0.0


def _with_length(
    theta: NDArray[np.float64], values: list[Value], arm: Arm
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Nearest theta2 and theta5, in units of their sigmas, with ``g theta2 = l1 theta5``."""
    if arm.kind != "two-link" or arm.link_length is None or arm.gravity == 0:
        raise ExportError(
            "there is no length of link 1 to keep",
            remedy="--keep-lengths needs a two-link arm with [geometry] link_length and gravity",
            file=arm.path,
        )
    k = float(arm.link_length[0]) / arm.gravity
    w2, w5 = values[1].sigma ** -2, values[4].sigma ** -2
    moved = theta.copy()
    moved[4] = (w5 * theta[4] + k * w2 * theta[1]) / (w5 + k * k * w2)
    moved[1] = k * moved[4]
    return moved, tuple(
        f"theta{i + 1} moved from {theta[i]:.6g} to {moved[i]:.6g} ({(moved[i] - theta[i]) / values[i].sigma:+.1f} sigma) "
        "so that link 1 keeps its length"
        for i in (1, 4)
    )


def _joints(arm: Arm, theta: NDArray[np.float64], links: Links | None, causes: tuple[Cause, ...]) -> tuple[Joint, ...]:
    n, b = arm.n_joints, arm.n_inertial
    limits = [None] * n if arm.torque_limit is None else arm.torque_limit.tolist()
    joints = [Joint(float(theta[b + j]), float(theta[b + n + j]), limit=limits[j]) for j in range(n)]
    if links is not None and links.surplus:
        joints[0] = replace(joints[0], offset=-links.surplus)
    for cause in causes:
        if cause.effect in ON_JOINT and cause.joint is not None:
            values = {name: v.value for name, v in cause.parameters.items()}
            joints[cause.joint - 1] = ON_JOINT[cause.effect](joints[cause.joint - 1], values)
    return tuple(joints)


def _spring(joint: Joint, p: Mapping[str, float]) -> Joint:
    """One more spring; where one of them hardens, its rest position is kept and the others' preload becomes an offset."""
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
    "torque_offset": lambda j, p: replace(j, offset=j.offset + p["offset"]),
    "coulomb_asymmetry": lambda j, p: replace(j, offset=j.offset - p["delta"]),
    "torque_gain": lambda j, p: replace(j, gain=j.gain * p["gain"]),
    "torque_saturation": _saturation,
    "actuator_lag": lambda j, p: replace(j, lag=j.lag + p["time_constant"]),
    "actuator_delay": lambda j, p: replace(j, delay=j.delay + p["delay"]),
    "encoder_offset": lambda j, p: replace(j, reading=j.reading + p["offset"]),
    "contact": lambda j, p: replace(j, stop=(p["position"], p["stiffness"])),
}
"""What an effect of a joint changes in it; payload and tilt concern the whole arm."""


def _value(cause: Cause, name: str) -> float:
    return cause.parameters[name].value


def _placed(effect: str, joint: int | None) -> str:
    return effect if joint is None else f"{effect} of joint {joint}"


def _named(cause: Cause) -> str:
    sizes = ", ".join(f"{name} {v.value:.6g} {v.unit}" for name, v in cause.parameters.items())
    return f"{_placed(cause.effect, cause.joint)} ({sizes})"


def _equation(cause: Cause) -> str:
    law = next((e["equation"] for e in _native.effects() if e["name"] == cause.effect), None)
    return f"add {law} in your own code" if law else "add it in your own code"
