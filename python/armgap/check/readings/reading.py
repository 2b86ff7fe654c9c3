"""Alternative reading of the input: a possible defect, and the corrections that undo it."""

from __future__ import annotations

from dataclasses import dataclass

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.check import CheckName

__all__ = ["Reading", "reading", "weighs_constantly"]


@dataclass(frozen=True)
class Reading:
    """Possible defect of a log's columns or of an arm file, and the corrections that undo it.

    Attributes
    ----------
    check : str
        Identifier of the defect.
    what : str
        The defect in words, as a clause after "logs and arm file agree as if".
    corrections : Corrections
        Corrections that undo the defect.
    remedies : tuple of str
        Options, or lines of the arm file, that undo the defect; more than one where no log tells them apart.
    joint : int, optional
        Joint, from 1.
    """

    check: CheckName
    what: str
    corrections: Corrections
    remedies: tuple[str, ...]
    joint: int | None = None


def weighs_constantly(arm: Arm) -> bool:
    """Whether gravity acts on an axis with a force that its position does not change.

    The equation of motion of all other arms is odd in ``(q, tau)``, so that reversed positions are equivalent to reversed torques. For such an axis
    reversed positions are equivalent to reversed torques and reversed gravity.
    """
    return arm.chain is None and not arm.rotary and bool(arm.theta[arm.gravity_parameters].any())


def reading(
    check: CheckName, what: str, corrections: Corrections, *others: Corrections | str, joint: int | None = None
) -> Reading:
    """Return a reading whose remedies are the options of `corrections`, then those of `others`."""
    words = [" ".join(corrections.options())]
    words += [other if isinstance(other, str) else " ".join(other.options()) for other in others]
    return Reading(check, what, corrections, tuple(words), joint)
