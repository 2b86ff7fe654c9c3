"""`position_unit`: positions of rotary joints are in degrees or in turns."""

from __future__ import annotations

from collections.abc import Iterator

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.readings.reading import Reading, reading

__all__ = ["readings"]

# Travel of a joint in degrees, at least, and in turns, at most, in a log worth diagnosing.
_LEAST_DEGREES = 10.0
_MOST_TURNS = 3.0


def readings(arm: Arm, travel: float) -> Iterator[Reading]:
    """Yield degrees or turns as unit of positions, where possible for the largest position `travel` in the logs, for an arm with rotary joints."""
    if arm.rotary and travel < _MOST_TURNS:
        yield reading("position_unit", "positions are in turns", Corrections(unit="turns"))
    if arm.rotary and travel > _LEAST_DEGREES:
        yield reading("position_unit", "positions are in degrees", Corrections(unit="deg"))
