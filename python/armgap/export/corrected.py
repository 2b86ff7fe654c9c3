"""A corrected model: parameters and causes of a diagnosed arm, ready to be written for a simulator."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Container
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm.arm import Arm
from armgap.diagnosis.result import Cause, Equivalent
from armgap.export.chain.joint import Joint
from armgap.export.chain.model import SimulatorModel
from armgap.export.errors import ExportError
from armgap.export.fields import FIELDS, FORMATS, field_of
from armgap.several_joints import place_text

__all__ = ["LEAST_SIGMA", "Corrected", "placed", "value"]

#: Smallest relative standard deviation of an exported parameter. An estimate's sigma holds for its own logs only: at another temperature the
#: arm's parameters differ, and with so small sigmas a diagnosis of other logs would explain the difference by an effect such as a payload.
LEAST_SIGMA = 0.01


@dataclass(frozen=True)
class Corrected(ABC):
    """Model of an arm with the parameters and causes of a diagnosis, ready to be written for a simulator.

    Attributes
    ----------
    arm : Arm
        Arm file of the diagnosis.
    stage : str
        Model of the diagnosis that is exported: ``"with_causes"`` or ``"refit"`` (re-estimated, without causes).
    theta, sigma : ndarray, shape (n_parameters,)
        Parameters of the arm, including causes that only change parameters, and their standard deviations [SI].
    joints : tuple of Joint
        Friction, springs, drive, encoder and stop of each joint.
    causes : tuple of Cause
        All causes of the exported model, whether or not a format has a field for them.
    notes : tuple of str
        Remarks on the corrected parameters, one line each.
    verdict : str
        The diagnosis' verdict.
    """

    arm: Arm
    stage: str
    theta: NDArray[np.float64]
    sigma: NDArray[np.float64]
    joints: tuple[Joint, ...]
    causes: tuple[Cause, ...]
    notes: tuple[str, ...]
    verdict: str

    @abstractmethod
    def simulated(self, form: str) -> SimulatorModel:
        """Return the arm as a chain for MJCF (``"mjcf"``) or URDF (``"urdf"``).

        Raises
        ------
        ExportError
            If no physically possible arm has the corrected parameters.
        """

    @abstractmethod
    def nominal(self) -> Arm:
        """Return the arm with the corrected parameters, as nominal model for further diagnoses."""

    @abstractmethod
    def remarks(self, form: str) -> tuple[str, ...]:
        """Return remarks on the exported file of a format, one line each: what the format cannot hold, and what was chosen."""

    @abstractmethod
    def data(self) -> dict[str, Any]:
        """Return entries of the exported JSON object that depend on the kind of arm: links and gravity."""

    def field_of(self, cause: Cause, form: str) -> str | None:
        """Return the field of a format that a cause is written to; None if the format has none."""
        return None if cause.row else field_of(cause.effect, cause.joint, form, self.arm.kind)

    def short(self, cause: Cause, form: str) -> str:
        """Return what the field of a format does not express of a cause, or the reason why the format has none; empty for nothing to be said."""
        return FIELDS[cause.effect].short if cause.effect in FIELDS else ""

    def missing(self, form: str, written: Container[str] = ()) -> tuple[str, ...]:
        """Return one line for each cause for which a format has no field, or a field that expresses it in part only, but for effects `written`."""
        lines = []
        for cause in self.causes:
            if cause.effect in written:
                continue
            short = self.short(cause, form)
            where = self.field_of(cause, form)
            if where is None:
                lines.append(f"no field for {_named(cause)}: {short or _equation(cause)}")
            elif short and form != "json":
                lines.append(f"{_named(cause)} is in {where}, {short}")
        return tuple(lines)

    def render(self, form: str) -> str:
        """Return the text of the exported file: ``"mjcf"``, ``"urdf"``, ``"toml"`` or ``"json"``.

        Raises
        ------
        ExportError
            If the format does not exist, or needs links and no physically possible arm has the corrected parameters.
        """
        from armgap.export import data
        from armgap.export.formats import mjcf, toml, urdf

        writers = {"mjcf": mjcf.render, "urdf": urdf.render, "toml": toml.render, "json": data.render}
        if form not in writers:
            raise ExportError(f"`{form}` is not a format", remedy=f"formats: {', '.join(FORMATS)}")
        return writers[form](self)


def value(cause: Cause, name: str) -> float:
    """Return the value of a cause's parameter [SI] by name."""
    return cause.parameters[name].value


def placed(found: Cause | Equivalent) -> str:
    """Return the name of an effect with its joint or joints as text."""
    if found.joint is None and not found.joints:
        return found.effect
    return f"{found.effect} of {place_text(vars(found))}"


def _named(cause: Cause) -> str:
    sizes = ", ".join(f"{name} {v.value:.6g} {v.unit}".removesuffix(" 1") for name, v in cause.parameters.items())
    return f"{placed(cause)} ({sizes}{f', shape {cause.shape}' if cause.shape else ''})"


def _equation(cause: Cause) -> str:
    law = next((e["equation"] for e in _native.effects() if e["name"] == cause.effect), None)
    return f"add {law} in your own code" if law else "add it in your own code"
