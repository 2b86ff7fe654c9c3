"""`gravity_missing`: torques lack the part that carries the arm's weight, by gravity compensation or because the arm moves in a horizontal plane."""

from __future__ import annotations

from collections.abc import Iterator

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.readings.reading import Reading, reading

__all__ = ["readings"]


def readings(arm: Arm, _travel: float) -> Iterator[Reading]:
    """Yield a reading with gravity parameters of zero, if the arm has gravity parameters other than zero."""
    weighs = arm.theta[arm.gravity_parameters] if arm.chain is None else arm.chain.gravity
    if weighs.any():
        yield reading(
            "gravity_missing",
            "the torques carry no weight: logged after gravity compensation, or moved in a horizontal plane",
            Corrections(gravity="compensated"),
        )
