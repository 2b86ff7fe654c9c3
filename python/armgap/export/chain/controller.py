"""The position controller of a corrected model: the arm file's, with the settings that causes change."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from armgap.arm.controller import Controller
from armgap.export.errors import ExportError

if TYPE_CHECKING:
    from armgap.arm.arm import Arm
    from armgap.diagnosis.result import Cause

__all__ = ["OF_CONTROLLER", "controller_with_causes", "reference_delays"]

#: Causes that are settings of the position controller, and no effects of the library.
OF_CONTROLLER = ("controller_gain", "controller_damping", "reference_delay")


def controller_with_causes(arm: Arm, causes: Iterable[Cause]) -> tuple[Controller | None, tuple[str, ...]]:
    """Return an arm's position controller with the gains that causes change, and remarks; None for an arm without one.

    Raises
    ------
    ExportError
        If a cause is a setting of a controller that the arm does not have.
    """
    named = [cause for cause in causes if cause.effect in OF_CONTROLLER]
    if arm.controller is None:
        if named:
            raise ExportError(
                f"has no [controller], of which the diagnosis names {named[0].effect}",
                remedy="give the arm file of the diagnosis",
                file=arm.path,
            )
        return None, ()
    kp, kd, notes = arm.controller.kp.copy(), arm.controller.kd.copy(), []
    for cause in named:
        assert cause.joint is not None
        j = cause.joint - 1
        if cause.effect == "controller_gain":
            kp[j] *= cause.parameters["gain"].value
        elif cause.effect == "controller_damping":
            kd[j] += cause.parameters["kd_difference"].value
            if kd[j] < 0.0:
                notes.append(f"kd of joint {cause.joint} would be {kd[j]:.6g}, which no controller has: it is 0")
                kd[j] = 0.0
    return replace(arm.controller, kp=kp, kd=kd), tuple(notes)


def reference_delays(causes: Iterable[Cause], n: int) -> list[float]:
    """Return the time by which the reference of each joint's controller is late [s], by causes."""
    late = [0.0] * n
    for cause in causes:
        if cause.effect == "reference_delay" and cause.joint is not None:
            late[cause.joint - 1] += cause.parameters["delay"].value
    return late
