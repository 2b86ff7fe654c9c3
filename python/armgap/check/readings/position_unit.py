"""`position_unit`: positions of joints that turn are in degrees or in turns."""

from __future__ import annotations

from collections.abc import Iterator

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.readings.reading import Reading, reading

__all__ = ["readings"]

# Joints of a log worth diagnosing move over more than this many degrees, and over less than this many turns.
_LEAST_DEGREES = 10.0
_MOST_TURNS = 3.0


def readings(arm: Arm, travel: float) -> Iterator[Reading]:
    """Yield the units that `travel`, the farthest that a position column goes, may be in, for an arm that turns."""
    if arm.rotary and travel < _MOST_TURNS:
        yield reading("position_unit", "positions are in turns", Corrections(unit="turns"))
    if arm.rotary and travel > _LEAST_DEGREES:
        yield reading("position_unit", "positions are in degrees", Corrections(unit="deg"))
