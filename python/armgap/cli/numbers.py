"""Types of command-line parameters for numbers."""

from __future__ import annotations

import math
from typing import Any

import click

from armgap.options import LARGEST_SEED

__all__ = ["Number", "Seed"]


class Number(click.FloatRange):
    """Type of a command-line parameter for a finite number in a range; NaN is refused."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number given on the command line, or fail if it is not finite."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number", param, ctx)
        return number


class Seed(click.IntRange):
    """Type of a command-line parameter for the seed of a random generator."""

    def __init__(self) -> None:
        super().__init__(0, LARGEST_SEED)

    def _describe_range(self) -> str:
        return "x>=0"
