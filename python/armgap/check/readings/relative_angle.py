"""`relative_angle`: a joint's angle is relative to the world where the model's is relative to the preceding link, or the reverse."""

from __future__ import annotations

from collections.abc import Iterator

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.readings.reading import Reading, reading

__all__ = ["readings"]


def readings(arm: Arm, _travel: float) -> Iterator[Reading]:
    """Yield readings with positions relative to the world, and relative to the preceding link.

    They are yielded for every rotary joint whose axis is parallel to that of the rotary joint before it, and for all of these joints together.
    """
    planar = tuple(range(2, arm.n_joints + 1)) if arm.rotary else ()
    joints = planar if arm.chain is None else arm.chain.parallel_joints
    for chosen in (*((j,) for j in joints), *([joints] if len(joints) > 1 else [])):
        columns = tuple(f"q{j}" for j in chosen)
        names = " and ".join(f"`{column}`" for column in columns)
        count = "counts" if len(chosen) == 1 else "count"
        before = f"link {chosen[0] - 1}" if len(chosen) == 1 else "the link before"
        joint = chosen[0] if len(chosen) == 1 else None
        yield reading(
            "relative_angle",
            f"{names} {count} from the world, not from {before}",
            Corrections(absolute=columns),
            joint=joint,
        )
        yield reading(
            "relative_angle",
            f"{names} {count} from {before} where the arm file means the world",
            Corrections(relative=columns),
            joint=joint,
        )
