"""A corrected model: what was found about an arm, ready to be written for a simulator."""

from __future__ import annotations

from abc import ABC, abstractmethod
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

#: Trust in an exported value, relative, at best. An estimate's sigma holds for the logs it came from; tomorrow's arm is
#: warmer, and values trusted to their last digit would make every other log look like a payload.
LEAST_SIGMA = 0.01


@dataclass(frozen=True)
class Corrected(ABC):
    """An arm as a diagnosis found it, ready to be written for a simulator.

    Attributes
    ----------
    arm : Arm
        The arm file it started from.
    stage : str
        ``"with_causes"`` or ``"refit"``.
    theta, sigma : ndarray, shape (n_parameters,)
        The arm's parameters with every cause in them that is a change of these, and their standard deviations.
    joints : tuple of Joint
        What sits at the joints.
    causes : tuple of Cause
        All causes of the stage, with a field or without.
    notes : tuple of str
        What to know about these values.
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
        """Return the arm as MJCF (``"mjcf"``) or URDF (``"urdf"``) has it.

        Raises
        ------
        ExportError
            If no arm that could be built has these values.
        """

    @abstractmethod
    def nominal(self) -> Arm:
        """Return the arm with the values found, as the nominal model of further diagnoses."""

    @abstractmethod
    def remarks(self, form: str) -> tuple[str, ...]:
        """Return everything to know about the file of a format: what is missing in it, what was chosen, one line each."""

    @abstractmethod
    def data(self) -> dict[str, Any]:
        """Return what the JSON object has of this kind of arm: links and gravity."""

    def field_of(self, cause: Cause, form: str) -> str | None:
        """Return where a cause goes in a format, None if it has no field there."""
        return None if cause.row else field_of(cause.effect, cause.joint, form, self.arm.kind)

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

    def render(self, form: str) -> str:
        """Return the file of a format: ``"mjcf"``, ``"urdf"``, ``"toml"`` or ``"json"``.

        Raises
        ------
        ExportError
            If the format does not exist, or needs links and no arm that could be built has these values.
        """
        from armgap.export import data
        from armgap.export.formats import mjcf, toml, urdf

        writers = {"mjcf": mjcf.render, "urdf": urdf.render, "toml": toml.render, "json": data.render}
        if form not in writers:
            raise ExportError(f"`{form}` is not a format", remedy=f"formats: {', '.join(FORMATS)}")
        return writers[form](self)


def value(cause: Cause, name: str) -> float:
    """Value of a cause's parameter."""
    return cause.parameters[name].value


def placed(found: Cause | Equivalent) -> str:
    """Name of an effect where it sits."""
    if found.joint is None and not found.joints:
        return found.effect
    return f"{found.effect} of {place_text(vars(found))}"


def _named(cause: Cause) -> str:
    sizes = ", ".join(f"{name} {v.value:.6g} {v.unit}" for name, v in cause.parameters.items())
    return f"{placed(cause)} ({sizes})"


def _equation(cause: Cause) -> str:
    law = next((e["equation"] for e in _native.effects() if e["name"] == cause.effect), None)
    return f"add {law} in your own code" if law else "add it in your own code"
