"""From a diagnosis to a corrected model."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm import Arm, only_planar
from armgap.diagnosis import Cause, Diagnosis, Value
from armgap.export.corrected import Corrected, placed, value
from armgap.export.errors import ExportError
from armgap.export.joint import ON_JOINT, Joint
from armgap.export.links import Links, links_of

__all__ = ["STAGES", "correct"]

#: Stages of a diagnosis that can be exported.
STAGES = ("with_causes", "refit")
#: Values of the arm file and the diagnosis agree to this, relative.
_SAME = 1e-9


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
        tilt += value(cause, "angle") if cause.effect == "base_tilt" else 0.0
    if arm.kind == "axis":
        theta[1] = theta[1] * math.cos(tilt) + theta[0] * arm.gravity * math.sin(tilt)
        tilt = 0.0
    notes = _notes(diagnosis, stage)
    if keep_lengths:
        theta, moved = _with_length(theta, values, arm)
        notes += moved
    links, unbuildable = links_of(arm, theta)
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


def _check(diagnosis: Diagnosis, arm: Arm, stage: str) -> None:
    only_planar(arm, "export")
    if stage not in STAGES:
        raise ExportError(f"`{stage}` is not a stage", remedy=f"stages: {', '.join(STAGES)}")
    nominal = diagnosis.parameters["nominal"]
    if set(nominal) != set(arm.parameter_names):
        raise ExportError(
            f"the diagnosis is of an arm with parameters {', '.join(nominal)}, the arm file's kind is `{arm.kind}`",
            remedy="give the arm file of the diagnosis",
            file=arm.path,
        )
    for name, stated in zip(arm.parameter_names, arm.theta, strict=True):
        if abs(nominal[name].value - stated) > _SAME * max(1.0, abs(stated)):
            raise ExportError(
                f"is {stated:.6g} in the arm file, but the diagnosis was made with {nominal[name].value:.6g}",
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
        f"these logs do not tell {placed(c.effect, c.joint)} from "
        + ", ".join(placed(e.effect, e.joint) for e in c.equivalents)
        for c in unsure
    )


def _payload(arm: Arm, cause: Cause) -> NDArray[np.float64]:
    """Change of the base parameters by a payload."""
    change = np.zeros(len(arm.parameter_names))
    if cause.effect != "payload":
        return change
    mass, distance, n = value(cause, "mass"), value(cause, "distance"), arm.n_joints
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
