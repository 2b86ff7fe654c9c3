"""Whether a diagnosis was made with an arm file: its nominal parameters."""

from __future__ import annotations

from armgap.arm.arm import Arm
from armgap.diagnosis.result import Diagnosis

__all__ = ["mismatch"]

#: Relative difference up to which parameters of arm file and diagnosis count as equal.
_EQUAL_PARAMETER_TOLERANCE = 1e-9


def mismatch(diagnosis: Diagnosis, arm: Arm) -> tuple[str, str | None] | None:
    """Return why a diagnosis was not made with an arm file, in words, and the parameter that differs; None if it was."""
    nominal = diagnosis.parameters["nominal"]
    if set(nominal) != set(arm.parameter_names):
        return (
            f"the diagnosis is of an arm with parameters {', '.join(nominal)}, the arm file's kind is `{arm.kind}`",
            None,
        )
    for name, stated in zip(arm.parameter_names, arm.theta, strict=True):
        if abs(nominal[name].value - stated) > _EQUAL_PARAMETER_TOLERANCE * max(1.0, abs(stated)):
            return f"is {stated:.6g} in the arm file, but the diagnosis was made with {nominal[name].value:.6g}", name
    return None
