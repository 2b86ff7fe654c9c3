"""Corrected models of planar arms: base parameters, and physically possible links with these."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.arm.load import payload_change
from armgap.arm.rigid_body import about_axis, about_origin
from armgap.arm.serial.chain import JointKind, SerialChain
from armgap.diagnosis.result import Cause, Value
from armgap.export.chain.joint import Joint, with_causes
from armgap.export.chain.links import Links, links_of, physical
from armgap.export.chain.model import SimulatorModel
from armgap.export.corrected import LEAST_SIGMA, Corrected, value
from armgap.export.errors import ExportError
from armgap.export.fields import field_of

__all__ = ["CorrectedPlanar", "correct_planar"]

Array = NDArray[np.float64]

#: Axis of the rotary joints of planar arms in the frame of the base.
_ACROSS = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class CorrectedPlanar(Corrected):
    """Model of a planar arm with the parameters and causes of a diagnosis.

    Attributes
    ----------
    links : Links or None
        Link parameters with the corrected base parameters; None if no physically possible arm has them.
    tilt : float
        Angle of the base against gravity [rad]; for a linear axis it is part of the slope.
    unbuildable : ExportError, optional
        Reason why `links` is None.
    """

    links: Links | None = None
    tilt: float = 0.0
    unbuildable: ExportError | None = None

    def field_of(self, cause: Cause, form: str) -> str | None:
        """Return the field of a format that a cause is written to; None if the format has none."""
        if cause.effect == "rotor_coupling" and self.uncoupled() is None:
            return field_of(cause.effect, cause.joint, form, self.arm.kind) if form == "json" else None
        return super().field_of(cause, form)

    def uncoupled(self) -> CorrectedPlanar | None:
        """Return a model of equal motion without the inertial coupling of a rotor that sits apart from its joint.

        With ``M_12 = theta3 + theta2 cos q2`` and ``M_22 = theta3 + I_r2``, a coupling inertia `x`, kg m^2, added to ``M_12`` equals
        theta3 larger by `x` and the rotor inertia ``I_r2`` of joint 2 smaller by `x`. None if ``I_r2`` would become negative.
        """
        x = sum(value(cause, "inertia") for cause in self.causes if cause.effect == "rotor_coupling")
        if not x:
            return self
        first, second = self.joints
        theta = self.theta + x * (np.arange(len(self.theta)) == 2)
        links, _ = links_of(self.arm, theta)
        if links is None or second.armature < x:
            return None
        return replace(self, theta=theta, links=links, joints=(first, replace(second, armature=second.armature - x)))

    def remarks(self, form: str) -> tuple[str, ...]:
        """Return remarks on the exported file of a format, one line each: what the format cannot hold, and what was chosen."""
        links = ((self.uncoupled() or self) if form == "mjcf" else self).links
        chosen = links.choices if links is not None and form != "toml" else ()
        gone = (str(self.unbuildable),) if self.unbuildable is not None else ()
        force = self.links.surplus if self.links is not None and form == "urdf" else 0.0
        lost = (f"no field for the constant force of {force:.6g} N on the axis",) if force else ()
        return (*self.missing(form), *lost, *self.notes, *gone, *chosen)

    def built(self) -> Links:
        """Return the links, or raise an error if no physically possible links exist."""
        if self.links is None:
            raise self.unbuildable or ExportError("has no links")
        return self.links

    def simulated(self, form: str) -> SimulatorModel:
        """Return the arm as a chain for MJCF or URDF: links hang down along -z and turn about y.

        In URDF the rotor inertia of joint 1 is part of its link's inertia, which gives the same motion.
        """
        model = (self.uncoupled() or self) if form == "mjcf" else self
        links, joints, n = model.built(), model.joints, self.arm.n_joints
        slide = self.arm.kind == "axis"
        inertia = list(links.inertia)
        if form == "urdf":
            rotor, joints = joints[0].armature, (replace(joints[0], armature=0.0), *joints[1:])
            if slide:
                links = physical("axis", self.arm.gravity, [float(self.theta[0]) + rotor, float(self.theta[1])])
                inertia = list(links.inertia)
            else:
                inertia[0] += rotor
        kind: JointKind = "prismatic" if slide else "revolute"
        axis = np.array([math.cos(links.slope), 0.0, math.sin(links.slope)]) if slide else _ACROSS
        reach = [0.0, *(length or 0.0 for length in links.length)]
        down = np.array([0.0, 0.0, -1.0])
        chain = SerialChain(
            joint_names=tuple(f"joint{j + 1}" for j in range(n)),
            link_names=tuple(f"link{j + 1}" for j in range(n)),
            kinds=(kind,) * n,
            rotation=np.array([np.eye(3)] * n),
            translation=np.array([length * down for length in reach[:n]]) + 0.0,
            axis=np.array([axis] * n),
            gravity=about_axis(_ACROSS, -self.tilt) @ (self.arm.gravity * down) + 0.0,
        )
        bodies = zip(links.mass, links.com, inertia, strict=True)
        inertial = np.array([about_origin(m, com * down, moment * np.eye(3)) for m, com, moment in bodies])
        tip = reach[-1] * down + 0.0 if reach[-1] else None
        return SimulatorModel(self.arm.name, chain, inertial, joints, self.arm.sample_period, tip)

    def nominal(self) -> Arm:
        """Return the arm with this corrected model's base parameters as nominal ones; the rotor inertia of joint 1 is added to the first of them."""
        theta = self.theta.copy()
        theta[0] += self.joints[0].armature
        scale = np.where(theta != 0, np.abs(theta), np.max(np.abs(theta)))
        sigma = np.maximum(self.sigma, LEAST_SIGMA * scale)
        return replace(self.arm, name=f"{self.arm.name}, corrected", theta=theta, sigma=sigma, sealed=None)

    def data(self) -> dict[str, Any]:
        """Return entries of the exported JSON object that only planar arms have: links, slope and tilt."""
        return {
            "links": None if self.links is None else _rows(self.links),
            "slope": None if self.links is None else self.links.slope,
            "base_tilt": self.tilt,
        }


def _rows(links: Links) -> list[dict[str, Any]]:
    columns: tuple[Sequence[float | None], ...] = (links.mass, links.com, links.inertia, links.length)
    return [dict(zip(("mass", "com", "inertia", "length"), row, strict=True)) for row in zip(*columns, strict=True)]


def correct_planar(
    arm: Arm,
    stage: str,
    values: Sequence[Value],
    causes: tuple[Cause, ...],
    notes: tuple[str, ...],
    verdict: str,
    *,
    keep_lengths: bool,
) -> CorrectedPlanar:
    """Make a corrected model from the estimated parameters and causes of a planar arm; see `armgap.correct`."""
    theta, tilt = np.array([v.value for v in values]), 0.0
    for cause in causes:
        if cause.effect == "payload":
            theta = theta + payload_change(arm, value(cause, "mass"), value(cause, "distance"))
        tilt += value(cause, "angle") if cause.effect == "base_tilt" else 0.0
    if arm.kind == "axis":
        theta[1] = theta[1] * math.cos(tilt) + theta[0] * arm.gravity * math.sin(tilt)
        tilt = 0.0
    if keep_lengths:
        theta, moved = _with_length(theta, values, arm)
        notes += moved
    links, unbuildable = links_of(arm, theta)
    return CorrectedPlanar(
        arm,
        stage,
        theta,
        np.array([v.sigma for v in values]),
        _joints(arm, theta, links, causes),
        causes,
        notes,
        verdict,
        links,
        tilt,
        unbuildable,
    )


def _with_length(theta: Array, values: Sequence[Value], arm: Arm) -> tuple[Array, tuple[str, ...]]:
    """Return theta with theta2 and theta5 changed by as few sigmas as possible so that ``g theta2 = l1 theta5``, and notes on it."""
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


def _joints(arm: Arm, theta: Array, links: Links | None, causes: tuple[Cause, ...]) -> tuple[Joint, ...]:
    n, b = arm.n_joints, arm.n_inertial
    limits = [None] * n if arm.torque_limit is None else arm.torque_limit.tolist()
    joints = [Joint(float(theta[b + j]), float(theta[b + n + j]), limit=limits[j]) for j in range(n)]
    if links is not None and links.surplus:
        joints[0] = replace(joints[0], offset=-links.surplus)
    return with_causes(joints, causes)
