"""Names of units: the SI unit of each group of columns, and the unit that a column had in its file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from armgap.log.conversion.columns import Names, group_of
from armgap.log.conversion.units import COUNTED, DEGREE, FACTORS, Scales, slides, suits

if TYPE_CHECKING:
    from armgap.arm.arm import Arm

__all__ = ["in_file", "si"]


def si(rotary: bool | None) -> dict[str, str]:
    """Return the SI unit of each group of columns; rotary and linear units if the kind of the joints is unknown."""
    turns = {"t": "s", "q": "rad", "dq": "rad/s", "tau": "N m"}
    linear = {"t": "s", "q": "m", "dq": "m/s", "tau": "N"}
    if rotary is None:
        return {group: unit if unit == linear[group] else f"{unit} or {linear[group]}" for group, unit in turns.items()}
    return turns if rotary else linear


def in_file(
    names: Names, scales: Scales, ticks: Mapping[str, float], arm: Arm | None, *, degrees: tuple[bool, bool]
) -> dict[str, str]:
    """Return the unit that each column had in the file, by standard name.

    Parameters
    ----------
    names, scales
        Names of the columns in use, and their declared or stated factors to SI.
    ticks : mapping
        Seconds per unit of the time columns.
    arm : Arm, optional
        Arm of the log, for the kinds of its joints.
    degrees : tuple of bool
        Whether positions and velocities were recognised as degrees.
    """
    found: dict[str, str] = {}
    turned = np.array([1.0 if slides(arm, j) else DEGREE for j in range(len(scales.q))])
    q, dq = (turned if recognised else 1.0 for recognised in degrees)
    groups = {
        "q": scales.q * q,
        "tau": scales.tau,
        "dq": np.empty(0) if scales.dq is None else scales.dq * dq,
        "q_ref": scales.q_ref * (q if len(scales.q_ref) else 1.0),
        "dq_ref": np.empty(0) if scales.dq_ref is None else scales.dq_ref * dq,
        "tau_meas": np.empty(0) if scales.tau_meas is None else scales.tau_meas,
        "q_link": np.empty(0) if scales.q_link is None else scales.q_link * q,
    }
    for key, column in names.pairs:
        group = key.rstrip("0123456789")
        j = 0 if key in ticks else int(key[len(group) :]) - 1
        factor = ticks[key] if key in ticks else float(groups[group][j])
        found[key] = _named(group_of(key), factor, names.units.get(column), arm, j)
    return found


def _named(group: str, factor: float, spelt: str | None, arm: Arm | None, j: int) -> str:
    """Return the unit of a column with a given factor to SI: as the file spells it, or the units possible for the joint."""
    fits = [unit for unit, f in FACTORS[group].items() if math.isclose(f, factor) and suits(group, unit, arm, j)]
    fits = fits or [COUNTED.get(group, "")]
    return spelt if spelt in fits else " or ".join(fits)
