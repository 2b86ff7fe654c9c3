"""Units: conversion of what the user declares, and a look at magnitudes for what nobody declared."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armgap.errors import OptionError, UnitError
from armgap.log.columns import Arrays, Names

if TYPE_CHECKING:
    from armgap.arm import Arm

__all__ = ["FACTORS", "check", "convert"]

_DEGREE = math.pi / 180

FACTORS: dict[str, dict[str, float]] = {
    "t": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "q": {"rad": 1.0, "deg": _DEGREE, "m": 1.0, "mm": 1e-3},
    "dq": {"rad/s": 1.0, "deg/s": _DEGREE, "m/s": 1.0, "mm/s": 1e-3},
    "tau": {"Nm": 1.0, "mNm": 1e-3, "N": 1.0, "kN": 1e3},
}
"""Units that can be declared for a group of columns, as factors to SI."""

# A sample period off by more than this factor from the arm file's is another unit of time.
_PERIOD_FACTOR = 30.0
_LONGEST_PERIOD_S = 0.2
_SHORTEST_PERIOD_S = 2e-5
# Six turns back and forth, and a joint speed beyond that of any arm: degrees taken for radians look like this.
_FARTHEST_RAD = 12 * math.pi
_FASTEST_RAD_S = 60.0
_FARTHEST_M = 40.0
# Speeds are taken over at least this time, so that the steps of a coarse encoder do not count as motion.
_SPEED_SPAN_S = 0.02
# Positions and velocities in different units disagree by 57.3 (degrees) or 1000 (mm), give or take noise.
_DEGREE_RATIO = (40.0, 80.0)
_MILLI_RATIO = (700.0, 1400.0)
# An arm's commanded torque does not exceed its limit by this factor, except in another unit.
_TORQUE_FACTOR = 20.0


def convert(arrays: Arrays, units: Mapping[str, str], arm: Arm | None) -> Arrays:
    """Convert declared units to SI.

    Parameters
    ----------
    arrays : Arrays
        Columns as they stand in the file.
    units : mapping
        Unit per group of columns, ``{"t": "ms", "q": "deg"}``; groups that are not named are in SI units.
    arm : Arm, optional
        Tells whether positions are angles.

    Raises
    ------
    OptionError
        If a group or its unit is unknown, or does not suit the arm.
    """
    scale = {group: _factor(group, unit, arm) for group, unit in units.items()}

    def scaled(group: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
        return values * scale.get(group, 1.0)

    dq = None if arrays.dq is None else scaled("dq", arrays.dq)
    return replace(arrays, t=scaled("t", arrays.t), q=scaled("q", arrays.q), tau=scaled("tau", arrays.tau), dq=dq)


def _factor(group: str, unit: str, arm: Arm | None) -> float:
    if group not in FACTORS:
        raise OptionError(f"`{group}` is not a group of columns", remedy=f"declare units of {', '.join(FACTORS)}")
    if unit not in FACTORS[group]:
        known = ", ".join(FACTORS[group])
        raise OptionError(f"`{unit}` is not a unit of {group}", remedy=f"known: {known}")
    angular = unit.startswith(("rad", "deg")) or unit.endswith("Nm")
    if arm is not None and group != "t" and angular != arm.rotary:
        motion = "turns" if arm.rotary else "slides"
        raise OptionError(f"{group} in {unit} does not suit an arm that {motion}", remedy="declare another unit")
    return FACTORS[group][unit]


def check(arrays: Arrays, place: Path | str, names: Names, arm: Arm | None, declared: Mapping[str, str]) -> None:
    """Raise `UnitError` where an undeclared group of columns has the magnitude of another unit."""
    if "t" not in declared:
        _time(arrays, place, names, arm)
    if "dq" not in declared:
        _velocity(arrays, place, names, arm)
    if "q" not in declared:
        _position(arrays, place, names, arm)
    if "tau" not in declared:
        _torque(arrays, place, names, arm)


def _time(arrays: Arrays, place: Path | str, names: Names, arm: Arm | None) -> None:
    period = float(np.median(np.diff(arrays.t)))
    low, high, against = _SHORTEST_PERIOD_S, _LONGEST_PERIOD_S, "no arm is sampled so"
    if arm is not None:
        low, high = arm.sample_period / _PERIOD_FACTOR, arm.sample_period * _PERIOD_FACTOR
        against = f"the arm file says {arm.sample_period:g} s"
    if low <= period <= high:
        return
    # Without an arm several units may be possible; the one nearest to a millisecond is named.
    likely = [u for u, factor in FACTORS["t"].items() if u != "s" and low <= period * factor <= high]
    likely.sort(key=lambda u: abs(math.log(period * FACTORS["t"][u] / 1e-3)))
    remedy = f"it looks like {likely[0]}: add --units t={likely[0]}" if likely else "give times in s"
    raise UnitError(f"the median sample period is {period:g} s, {against}", remedy=remedy, file=place, column=names.t)


def _velocity(arrays: Arrays, place: Path | str, names: Names, arm: Arm | None) -> None:
    if arrays.dq is None or names.dq is None:
        return
    low, high = _MILLI_RATIO if _slides(arm) else _DEGREE_RATIO
    unit, group = ("mm", "mm/s") if _slides(arm) else ("deg", "deg/s")
    for j, name in enumerate(names.dq):
        ratio = _speed_ratio(arrays, j)
        if low <= ratio <= high:
            raise UnitError(
                f"positions move {ratio:.3g} times faster than `{name}` says",
                remedy=f"positions look like {unit}: add --units q={unit}",
                file=place,
                column=names.q[j],
            )
        if ratio > 0 and low <= 1 / ratio <= high:
            raise UnitError(
                f"is {1 / ratio:.3g} times faster than `{names.q[j]}` moves",
                remedy=f"velocities look like {group}: add --units dq={group}",
                file=place,
                column=name,
            )


def _speed_ratio(arrays: Arrays, j: int) -> float:
    """Return the slope of the differenced position over the velocity column; 0 where there is none."""
    assert arrays.dq is not None
    moved = np.diff(arrays.q[:, j])
    said = 0.5 * (arrays.dq[1:, j] + arrays.dq[:-1, j]) * np.diff(arrays.t)
    power = float(said @ said)
    return float(moved @ said) / power if power > 0 else 0.0


def _position(arrays: Arrays, place: Path | str, names: Names, arm: Arm | None) -> None:
    farthest, fastest, unit = _FARTHEST_RAD, _FASTEST_RAD_S, "deg"
    if _slides(arm):
        farthest, fastest, unit = _FARTHEST_M, math.inf, "mm"
    for j, name in enumerate(names.q):
        travel, speed = float(np.ptp(arrays.q[:, j])), _peak_speed(arrays, j)
        counts = not _slides(arm) and _counts_degrees(arrays, arm, j)
        if travel > farthest or speed > fastest or counts:
            si = "m" if _slides(arm) else "rad"
            why = f"moves over {travel:.4g} {si} at up to {speed:.4g} {si}/s"
            why += ", in steps of one encoder count in degrees" if counts else ""
            raise UnitError(
                why,
                remedy=f"it looks like {unit}: add --units q={unit}, or q={si} if it is right",
                file=place,
                column=name,
            )


def _peak_speed(arrays: Arrays, j: int) -> float:
    """Return the speed that is exceeded for 1 % of the log."""
    stride = max(1, round(_SPEED_SPAN_S / float(np.median(np.diff(arrays.t)))))
    t, q = arrays.t[::stride], arrays.q[::stride, j]
    return float(np.quantile(np.abs(np.diff(q) / np.diff(t)), 0.99)) if len(t) > 1 else 0.0


def _counts_degrees(arrays: Arrays, arm: Arm | None, j: int) -> bool:
    """Whether positions change in whole encoder counts when they are read as degrees, and not otherwise."""
    if arm is None or arm.encoder_step is None:
        return False
    moved = np.diff(arrays.q[:, j])
    moved = moved[moved != 0]
    if len(moved) < 20:
        return False
    in_degrees = moved * _DEGREE / arm.encoder_step[j]
    whole = np.abs(in_degrees - np.round(in_degrees)) < 0.01
    return bool(np.mean(whole & (np.round(in_degrees) != 0)) > 0.95)


def _torque(arrays: Arrays, place: Path | str, names: Names, arm: Arm | None) -> None:
    if arm is None or arm.torque_limit is None:
        return
    for j, name in enumerate(names.tau):
        peak, limit = float(np.max(np.abs(arrays.tau[:, j]))), float(arm.torque_limit[j])
        if peak > _TORQUE_FACTOR * limit:
            si = "Nm" if arm.rotary else "N"
            raise UnitError(
                f"reaches {peak:.4g}, {peak / limit:.3g} times the arm's torque limit of {limit:g}",
                remedy=f"give the torque at the joint in {si}; add --units tau={si} if it is right",
                file=place,
                column=name,
            )


def _slides(arm: Arm | None) -> bool:
    return arm is not None and not arm.rotary
