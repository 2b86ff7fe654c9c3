"""A corrected model: base parameters, links that could be built, and per joint what simulators have fields for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm import Arm
from armgap.diagnosis import Cause
from armgap.export.errors import ExportError
from armgap.export.fields import FIELDS, field_of
from armgap.export.joint import Joint
from armgap.export.links import Links, links_of

__all__ = ["Corrected"]


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
        x = sum(value(cause, "inertia") for cause in self.causes if cause.effect == "rotor_coupling")
        if not x:
            return self
        first, second = self.joints
        theta = self.theta + x * (np.arange(len(self.theta)) == 2)
        links, _ = links_of(self.arm, theta)
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


def value(cause: Cause, name: str) -> float:
    """Value of a cause's parameter."""
    return cause.parameters[name].value


def placed(effect: str, joint: int | None) -> str:
    """Name of an effect where it sits."""
    return effect if joint is None else f"{effect} of joint {joint}"


def _named(cause: Cause) -> str:
    sizes = ", ".join(f"{name} {v.value:.6g} {v.unit}" for name, v in cause.parameters.items())
    return f"{placed(cause.effect, cause.joint)} ({sizes})"


def _equation(cause: Cause) -> str:
    law = next((e["equation"] for e in _native.effects() if e["name"] == cause.effect), None)
    return f"add {law} in your own code" if law else "add it in your own code"
