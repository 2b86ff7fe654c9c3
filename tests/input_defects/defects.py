"""Catalogue of all known defects of logs and arm files, in the order of the list of checks."""

from __future__ import annotations

from .conventions import conventions
from .defect import Defect
from .sampling import sampling
from .scales import scales
from .stretches import stretches

#: All defects by name.
DEFECTS: dict[str, Defect] = {d.name: d for d in (*conventions(), *scales(), *sampling(), *stretches())}
#: Defects that armgap repairs, after which the diagnosis goes on as without a defect: names of the variants by kind of defect.
REPAIRED: dict[str, tuple[str, ...]] = {
    "wraps": ("wrapped_positions:q1", "wrapped_positions:q2"),
    "held samples": ("repeated_positions:2", "repeated_positions:3", "repeated_positions:5"),
    "scattered stamps": ("stamp_jitter:0.1", "stamp_jitter:0.2", "stamp_jitter:0.3"),
    "torque factor": ("torque_unit:current", "torque_unit:gear 50"),
    "acausal shift": tuple(f"time_shift:late {k}" for k in range(1, 6)),
}


def chosen(words: list[str]) -> list[Defect]:
    """Return the defects whose names begin with one of the words; all defects if no words are given.

    Raises
    ------
    ValueError
        If no defect has a name that begins with one of the words.
    """
    for word in words:
        if not any(name.startswith(word) for name in DEFECTS):
            raise ValueError(f"no defect begins with {word!r}; known are {', '.join(DEFECTS)}")
    return [d for name, d in DEFECTS.items() if not words or name.startswith(tuple(words))]
