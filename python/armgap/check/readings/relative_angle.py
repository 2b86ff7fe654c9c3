"""`relative_angle`: a joint's angle is relative to the world where the model's is relative to the preceding link, or the reverse."""

from __future__ import annotations

from collections.abc import Iterator

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.readings.reading import Reading, reading

__all__ = ["readings"]


def readings(arm: Arm, _travel: float) -> Iterator[Reading]:
    """Yield readings with positions relative to the world, and relative to the preceding link, for every joint after the first of a rotary arm."""
    if not arm.rotary:
        return
    for j in range(2, arm.n_joints + 1):
        column = f"q{j}"
        absolute, relative = Corrections(absolute=(column,)), Corrections(relative=(column,))
        yield reading("relative_angle", f"`{column}` counts from the world, not from link {j - 1}", absolute, joint=j)
        yield reading(
            "relative_angle",
            f"`{column}` counts from link {j - 1} where the arm file means the world",
            relative,
            joint=j,
        )
