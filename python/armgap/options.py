"""Checks of function options: an invalid or impossible number raises an `OptionError` of one line."""

from __future__ import annotations

import math
import operator
import os
from typing import Any

from armgap.errors import OptionError

__all__ = [
    "LARGEST_SEED",
    "LONGEST_PLAN_S",
    "SHORTEST_PLAN_S",
    "indentation",
    "not_an_arm",
    "positive",
    "seed",
    "whole",
]

LARGEST_SEED = 2**64 - 1
"""Largest seed of the compiled core's random generator, which takes 64 bits."""
SHORTEST_PLAN_S, LONGEST_PLAN_S = 2.0, 120.0
"""Shortest and longest motion that can be planned [s]: two phases with their moves, and predictions of minutes."""
#: Widest indentation of JSON [blanks]: deeper levels would leave no room for values on a screen.
_WIDEST_INDENT = 16


def positive(value: Any, what: str, remedy: str = "give a positive number of seconds") -> float:
    """Return an option's value as a float if it is a positive finite number.

    Raises
    ------
    OptionError
        If the value is no positive finite number.
    """
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not (math.isfinite(number) and number > 0):
        raise OptionError(f"the {what} is {value}", remedy=remedy)
    return number


def whole(value: Any, what: str, least: int, most: int) -> int:
    """Return an option's value as an integer if it is a whole number from `least` to `most`.

    Raises
    ------
    OptionError
        If the value is no whole number from `least` to `most`.
    """
    try:
        number = operator.index(value)
    except TypeError:
        raise OptionError(f"the {what} is {value!r}", remedy=f"give a whole number from {least} to {most}") from None
    if not least <= number <= most:
        raise OptionError(f"the {what} is {value}", remedy=f"give a whole number from {least} to {most}")
    return number


def indentation(value: Any) -> int | None:
    """Return the option `indent` of a method ``to_json``: a number of blanks from 0 to 16, or None for one line.

    Raises
    ------
    OptionError
        If the value is anything else, such as the name of a file.
    """
    if value is None:
        return None
    if isinstance(value, str | os.PathLike):
        remedy = (
            f'to write a file: from armgap.files.output import write; write("{os.fspath(value)}", result.to_json())'
        )
        raise OptionError(f"`indent` is {os.fspath(value)!r}, not a number of blanks", remedy=remedy)
    return whole(value, "`indent`", 0, _WIDEST_INDENT)


def seed(value: Any) -> int:
    """Return an option's value as the seed of a random generator.

    Raises
    ------
    OptionError
        If the value is negative, too large or no whole number.
    """
    return whole(value, "seed", 0, LARGEST_SEED)


def not_an_arm(arm: Any) -> OptionError:
    """Return the error for an argument `arm` that is no `Arm`; its message names how an `Arm` is made."""
    found = repr(arm) if isinstance(arm, str | int | float | bytes | None) else f"a {type(arm).__name__}"
    remedy = 'give an Arm: Arm.read("arm.toml"), or read_model("robot.urdf")'
    return OptionError(f"the arm is {found[:80]}, not an Arm", remedy=remedy)
