"""One way to spoil a case."""

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
    """One way to spoil a case.

    Attributes
    ----------
    name : str
        Check and variant, ``check:variant``.
    apply : callable
        ``apply(inputs, truth, rng)`` gives the spoilt inputs and what the answer has to say; inputs stay as they are.
        Raises `NotApplicableError` where a case has no such defect.
    kinds : tuple of str
        Kinds of arm it exists on.
    changes : tuple of str
        What it changes: of ``t``, ``q``, ``tau``, ``arm``, ``rows`` (their number), ``holdout`` (which log that is).
    conflicts : tuple of str
        Hidden effects that it equals or hides, so that either answer is right.
    """

    name: str
    apply: Apply
    kinds: tuple[str, ...] = ANY
    changes: tuple[str, ...] = ()
    conflicts: tuple[str, ...] = ()

    @property
    def check(self) -> str:
        """What comes before the variant: the check that has it, or ``arm_file``, ``other_arm``."""
        return self.name.partition(":")[0]
