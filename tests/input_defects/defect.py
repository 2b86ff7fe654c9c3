"""Type of a defect: one way to make the inputs of a case wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .case import Inputs, Truth
from .expected import Expected

ANY = ("axis", "pendulum", "two-link")
ROTARY = ("pendulum", "two-link")
TWO_LINK = ("two-link",)
AXIS = ("axis",)

Apply = Callable[[Inputs, Truth, np.random.Generator], tuple[Inputs, Expected]]


@dataclass(frozen=True)
class Defect:
    """One way to make the inputs of a case wrong.

    Attributes
    ----------
    name : str
        Name of the check that should find the defect, and of the variant: ``check:variant``.
    apply : callable
        ``apply(inputs, truth, rng)`` returns the inputs with the defect and what the answer has to say; it leaves `inputs` unchanged
        and raises `NotApplicableError` where the case cannot have the defect.
    kinds : tuple of str
        Kinds of arm on which the defect exists.
    changes : tuple of str
        Parts of the inputs that the defect changes: ``t``, ``q``, ``tau``, ``arm``, ``rows`` (number of rows), ``holdout`` (which log it is).
    conflicts : tuple of str
        Hidden effects that the defect equals or hides, so that either answer is right.
    """

    name: str
    apply: Apply
    kinds: tuple[str, ...] = ANY
    changes: tuple[str, ...] = ()
    conflicts: tuple[str, ...] = ()

    @property
    def check(self) -> str:
        """Part of the name before the variant: the check that should find the defect, or ``arm_file`` or ``other_arm``."""
        return self.name.partition(":")[0]
