"""`position_unit`: positions of joints that turn are in degrees or in turns."""

from __future__ import annotations

from collections.abc import Iterator

from armgap.arm import Arm
from armgap.check.corrections import Corrections
from armgap.check.reading import Reading, reading

__all__ = ["readings"]


def readings(arm: Arm) -> Iterator[Reading]:
    """Yield both units for an arm that turns."""
    if arm.rotary:
        yield reading("position_unit", "positions are in turns", Corrections(unit="turns"))
        yield reading("position_unit", "positions are in degrees", Corrections(unit="deg"))
