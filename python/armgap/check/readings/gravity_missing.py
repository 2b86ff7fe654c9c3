"""`gravity_missing`: torques or arm file lack the arm's weight.

Torques lack it by gravity compensation, or because the arm moves in a horizontal plane. The file of a serial arm lacks it with a gravity of zero.
"""

from __future__ import annotations

from collections.abc import Iterator

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.readings.reading import Reading, reading

__all__ = ["readings"]


def readings(arm: Arm, _travel: float) -> Iterator[Reading]:
    """Yield a reading without gravity, or with standard gravity for a serial arm without it."""
    weighs = arm.theta[arm.gravity_parameters] if arm.chain is None else arm.chain.gravity
    if weighs.any():
        yield reading(
            "gravity_missing",
            "the torques carry no weight: logged after gravity compensation, or moved in a horizontal plane",
            Corrections(gravity="compensated"),
        )
    elif arm.chain is not None:
        yield reading(
            "gravity_missing",
            "the arm file leaves out gravity: the torques carry a weight along the z axis of the base",
            Corrections(gravity="standard"),
            "gravity = [0.0, 0.0, -9.81]",
        )
