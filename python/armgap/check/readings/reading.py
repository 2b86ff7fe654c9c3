"""Another reading of the input: a defect that it may have, and the corrections that undo it."""

from __future__ import annotations

from dataclasses import dataclass

from armgap.arm.corrections import Corrections
from armgap.check.check import CheckName

__all__ = ["Reading", "reading"]


@dataclass(frozen=True)
class Reading:
    """A defect of columns or arm file, and what undoes it.

    Attributes
    ----------
    check : str
        Which defect.
    what : str
        The defect in words, continuing "as if".
    corrections : Corrections
        What undoes it.
    remedies : tuple of str
        Options, or lines of the arm file, that undo it; more than one where nothing tells them apart.
    joint : int, optional
        Joint, from 1.
    """

    check: CheckName
    what: str
    corrections: Corrections
    remedies: tuple[str, ...]
    joint: int | None = None


def reading(
    check: CheckName, what: str, corrections: Corrections, *others: Corrections | str, joint: int | None = None
) -> Reading:
    """Return a reading whose remedies are its own corrections' options, then those of `others`."""
    words = [" ".join(corrections.options())]
    words += [other if isinstance(other, str) else " ".join(other.options()) for other in others]
    return Reading(check, what, corrections, tuple(words), joint)
