"""Options of functions, checked: what is no number, or none that the option can have, is an `OptionError` in one line."""

from __future__ import annotations

import math
import operator
from typing import Any

from armgap.errors import OptionError

__all__ = ["LARGEST_SEED", "positive", "seed", "whole"]

LARGEST_SEED = 2**64 - 1
"""The core's generator takes 64 bits."""


def positive(value: Any, what: str, remedy: str = "give a positive number of seconds") -> float:
    """Return a positive finite number.

    Raises
    ------
    OptionError
        If it is none.
    """
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not (math.isfinite(number) and number > 0):
        raise OptionError(f"the {what} is {value}", remedy=remedy)
    return number


def whole(value: Any, what: str, least: int, most: int) -> int:
    """Return a whole number from `least` to `most`.

    Raises
    ------
    OptionError
        If it is none.
    """
    try:
        number = operator.index(value)
    except TypeError:
        raise OptionError(f"the {what} is {value!r}", remedy=f"give a whole number from {least} to {most}") from None
    if not least <= number <= most:
        raise OptionError(f"the {what} is {value}", remedy=f"give a whole number from {least} to {most}")
    return number


def seed(value: Any) -> int:
    """Return a seed.

    Raises
    ------
    OptionError
        If it is negative, too large or no whole number.
    """
    return whole(value, "seed", 0, LARGEST_SEED)
