"""`gravity_direction`: a serial arm hangs on a wall or stands on its side, and its arm file says otherwise."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import numpy as np

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.readings.reading import Reading, reading
from armgap.literals import GravityCorrection

__all__ = ["readings"]

# Cosine of the angle between two directions from which they count as one, or as opposite: smaller angles are tilts of the base, which are effects.
_ALONG = 0.9


def readings(arm: Arm, _travel: float) -> Iterator[Reading]:
    """Yield readings with gravity along the axes of the base, but for that of the arm file in either direction (`gravity_sign`)."""
    if arm.chain is None or not arm.chain.gravity.any():
        return
    direction = arm.chain.gravity / np.linalg.norm(arm.chain.gravity)
    for axis, along in zip("xyz", direction, strict=True):
        if abs(along) > _ALONG:
            continue
        for sign in "+-":
            yield reading(
                "gravity_direction",
                f"gravity acts along {sign}{axis} of the base, as on a wall",
                Corrections(gravity=cast(GravityCorrection, f"{sign}{axis}")),
            )
