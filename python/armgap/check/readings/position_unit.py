"""`position_unit`: positions of rotary joints are in degrees or in turns."""

from __future__ import annotations

from collections.abc import Iterator

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.readings.reading import Reading, reading

__all__ = ["readings"]

# Smallest travel of a joint in degrees, and largest travel in turns, in a log worth diagnosing.
_LEAST_DEGREES = 10.0
_MOST_TURNS = 3.0


def readings(arm: Arm, travel: float) -> Iterator[Reading]:
    """Yield readings with degrees or turns as unit of positions, where the largest range `travel` of a rotary joint in the logs allows them."""
    if arm.rotary and travel < _MOST_TURNS:
        yield reading("position_unit", "positions are in turns", Corrections(unit="turns"))
    if arm.rotary and travel > _LEAST_DEGREES:
        yield reading("position_unit", "positions are in degrees", Corrections(unit="deg"))
