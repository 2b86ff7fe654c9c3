"""Units of columns: conversion of declared units, and plausibility of magnitudes where no unit is declared."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armgap.errors import OptionError, UnitError
from armgap.log.conversion.columns import Arrays, Names, group_of, unknown_unit
from armgap.log.conversion.turns import TURN, unwrapped
from armgap.log.findings import Finding

if TYPE_CHECKING:
    from armgap.arm.arm import Arm

__all__ = [
    "COUNTED",
    "DEGREE",
    "FACTORS",
    "Scales",
    "check",
    "has_factor",
    "recognised",
    "scaled",
    "slides",
    "stated",
    "suits",
]

DEGREE = math.pi / 180

FACTORS: dict[str, dict[str, float]] = {
    "t": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "q": {"rad": 1.0, "mrad": 1e-3, "deg": DEGREE, "turns": 2 * math.pi, "m": 1.0, "mm": 1e-3},
    "dq": {"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": DEGREE, "rpm": math.pi / 30, "m/s": 1.0, "mm/s": 1e-3},
    "tau": {"Nm": 1.0, "mNm": 1e-3, "Ncm": 1e-2, "kgfcm": 0.0980665, "N": 1.0, "kN": 1e3},
}
"""Factors to SI of the units that can be declared, by group of columns and unit; for those in `COUNTED` the arm file has the factor."""

COUNTED = {"q": "counts", "dq": "counts/s"}
"""Units of an encoder's own by group of columns; one count is `Arm.encoder_step` [rad or m]."""

WORDS = {"t": "times", "q": "positions", "dq": "velocities", "tau": "torques"}

# Range of a joint's positions (six turns back and forth), and joint speed, above those of any arm: degrees taken for radians reach them.
_FARTHEST_RAD = 12 * math.pi
_FASTEST_RAD_S = 60.0
_FARTHEST_M = 40.0
# Shortest time over which speeds are taken [s], so that steps of a coarse encoder do not count as motion.
_SPEED_SPAN_S = 0.02
# Ratio of a differenced position to the velocity column that shows different units: 57.3 (degrees) or 1000 (mm), with a margin for noise.
_DEGREE_RATIO = (40.0, 80.0)
# Units of lengths, their velocities, and forces; all others that have one are of angles.
_LINEAR = frozenset({"m", "mm", "m/s", "mm/s", "N", "kN"})
# Number of changes of a position from which it is told whether all are whole encoder counts.
_FEWEST_CHANGES = 20
# Largest number of samples that determine the sample period, and whether positions change in whole encoder counts.
_MAX_INSPECTED_SAMPLES = 100_000
# Ratios of a differenced position to the velocity column that show degrees beyond doubt, and millimetres.
_SURE_RATIO = (52.0, 63.0)
_MILLI_RATIO = (700.0, 1400.0)
# Ratio of a commanded torque to the arm's limit above which the torque is in another unit.
_TORQUE_TO_LIMIT_RATIO = 20.0
# Share of rows with an implausible magnitude up to which the rows count as defective, not as in another unit.
_WILD_SHARE = 0.002


@dataclass(frozen=True)
class Scales:
    """Factors to SI units by group of columns, and the groups with a stated unit.

    Attributes
    ----------
    t, t_tau : float, optional
        Seconds per unit of times; None where unknown.
    q, tau, dq, q_ref, dq_ref, tau_meas, q_link : ndarray, shape (n_joints,)
        Factor of each column; references, measured torques and positions on the link's side are in the units of positions, velocities and torques
        unless the file says otherwise.
    settled : frozenset of str
        Groups whose unit is stated by the user or by the file.
    """

    t: float | None
    t_tau: float | None
    q: NDArray[np.float64]
    tau: NDArray[np.float64]
    dq: NDArray[np.float64] | None
    q_ref: NDArray[np.float64]
    dq_ref: NDArray[np.float64] | None
    tau_meas: NDArray[np.float64] | None
    q_link: NDArray[np.float64] | None
    settled: frozenset[str]
    findings: tuple[Finding, ...]


def stated(names: Names, declared: Mapping[str, str], arm: Arm | None, place: Path | str) -> Scales:
    """Return the factors to SI that the user declares (`declared`, by group or by column such as `q3`), or that the file states, by column.

    Raises
    ------
    OptionError
        If a declared group or its unit is unknown, or does not suit the arm.
    UnitError
        If the file states a unit that is not known, or does not suit the column; or if columns in encoder counts are declared or stated, and the arm
        file does not say how many make a turn.
    """
    for group, unit in declared.items():
        _check_declared(group, unit, arm)
    _check_second_encoders(names, declared, place)
    groups = {"t": (names.t,), "q": names.q, "tau": names.tau, "dq": names.dq or ()}
    for key, column in names.pairs:
        is_declared = group_of(key) in declared or key in declared
        if column in names.foreign_units and not is_declared and not has_factor(key, arm):
            raise unknown_unit(column, names.foreign_units[column], key, place, mapped=True)
    findings: list[Finding] = []
    settled = {_group_declared(key) for key in declared}

    def factor(group: str, columns: tuple[str, ...], j: int) -> tuple[float, str | None]:
        """Return the factor to SI of the column of joint `j` (from 0), and the unit if the file states it."""
        unit = declared.get(f"{group}{j + 1}", declared.get(group))
        counted = unit is not None and unit == COUNTED.get(group)
        if unit is not None and not (counted and columns is names.q_link):
            # In an arm with rotary and linear joints a unit of angles does not change lengths.
            possible = suits(group, unit, arm, j)
            return (_factor(group, unit, arm, place, columns[j], j) if possible else 1.0), None
        by_file = names.units.get(columns[j])
        return _by_file(group, columns[j], by_file, arm, place, j), by_file

    def of(group: str, columns: tuple[str, ...]) -> NDArray[np.float64]:
        found = [factor(group, columns, j) for j in range(len(columns))]
        factors = [number for number, _ in found]
        units = {unit for _, unit in found if unit is not None}
        if columns and columns is groups[group] and all(column in names.units for column in columns):
            settled.add(group)
        if any(number != 1.0 and unit is not None for number, unit in found):
            findings.append(
                Finding("units", f"{WORDS[group]} are in {', '.join(sorted(units))}, as the file says; converted")
            )
        return np.array(factors, dtype=np.float64)

    q, tau, dq, t = (of(group, groups[group]) for group in ("q", "tau", "dq", "t"))
    q_ref, dq_ref = of("q", names.q_ref), of("dq", names.dq_ref or ())
    tau_meas, q_link = of("tau", names.tau_meas or ()), of("q", names.q_link or ())
    t_tau = names.units.get(names.t_tau or "")
    return Scales(
        t=float(t[0]) if "t" in settled else None,
        t_tau=FACTORS["t"].get(declared.get("t", t_tau or "")),
        q=q,
        tau=tau,
        dq=dq if names.dq is not None else None,
        q_ref=q_ref,
        dq_ref=dq_ref if names.dq_ref is not None else None,
        tau_meas=tau_meas if names.tau_meas is not None else None,
        q_link=q_link if names.q_link is not None else None,
        settled=frozenset(settled),
        findings=tuple(findings),
    )


def scaled(arrays: Arrays, scales: Scales) -> Arrays:
    """Return all columns except times converted to SI units."""

    def by(values: NDArray[np.float64], factors: NDArray[np.float64]) -> NDArray[np.float64]:
        return values if np.all(factors == 1.0) else values * factors

    def if_there(values: NDArray[np.float64] | None, factors: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
        return None if values is None or factors is None else by(values, factors)

    return replace(
        arrays,
        q=by(arrays.q, scales.q),
        tau=by(arrays.tau, scales.tau),
        dq=if_there(arrays.dq, scales.dq),
        q_ref=if_there(arrays.q_ref, scales.q_ref),
        dq_ref=if_there(arrays.dq_ref, scales.dq_ref),
        tau_meas=if_there(arrays.tau_meas, scales.tau_meas),
        q_link=if_there(arrays.q_link, scales.q_link),
    )


def _by_file(group: str, column: str, unit: str | None, arm: Arm | None, place: Path | str, j: int) -> float:
    if unit is None:
        return 1.0
    if unit not in _known(group) or not suits(group, unit, arm, j):
        raise UnitError(
            f"is in {unit}, which is no unit of {WORDS[group]}" + (f" of a {arm.kind}" if arm is not None else ""),
            remedy=f"correct the file, or declare the unit with --units {group}=…",
            file=place,
            column=column,
        )
    return _factor(group, unit, arm, place, column, j)


def _known(group: str) -> list[str]:
    """Return the units of a group of columns."""
    return [*FACTORS[group], *([COUNTED[group]] if group in COUNTED else [])]


def _factor(group: str, unit: str, arm: Arm | None, place: Path | str, column: str, j: int) -> float:
    """Return the factor to SI of a known unit of a column of joint `j` (from 0)."""
    if unit != COUNTED.get(group):
        return FACTORS[group][unit]
    if arm is None or arm.encoder_step is None:
        problem = f"is in {unit}, and {_per_turn(arm, j)[0]}"
        raise UnitError(problem, remedy=_per_turn(arm, j)[1], file=place, column=column)
    return float(arm.encoder_step[j])


def _per_turn(arm: Arm | None, j: int) -> tuple[str, str]:
    """Return that the counts per turn of joint `j` (from 0) are not known, and what to do, in words."""
    turn = "metre" if slides(arm, j) else "turn of the joint (of the motor's encoder: times the gear ratio)"
    if arm is None:
        return (
            "no arm says how many make a turn",
            f"give an arm file with [encoder] counts_per_rev, the counts per {turn}",
        )
    name = str(arm.path or arm.name)
    return (
        f"{name} does not say how many make a turn",
        f"add [encoder] counts_per_rev to the arm file, the counts per {turn}",
    )


def _check_second_encoders(names: Names, declared: Mapping[str, str], place: Path | str) -> None:
    """Raise for positions on the link's side in counts: the arm file has the counts of one encoder per joint."""
    by_user = declared.get("q")
    for key, column in zip(names.q, names.q_link or (), strict=False):
        by_file = names.units.get(column) if by_user in (None, COUNTED["q"]) else None
        if (by_file or by_user) == COUNTED["q"]:
            raise UnitError(
                f"may not be in counts: counts_per_rev of the arm file is that of the encoder of `{key}`",
                remedy=f"convert it in the file, and state its unit in its name: `{column.split(' ')[0]} [rad]`",
                file=place,
                column=column,
            )


def _group_declared(key: str) -> str:
    """Return the group of columns of which a unit is declared: ``q`` for ``q`` and for ``q3``."""
    return key.rstrip("0123456789")


def _check_declared(key: str, unit: str, arm: Arm | None) -> None:
    group, joint = _group_declared(key), key[len(_group_declared(key)) :]
    if group not in FACTORS or (joint and group == "t"):
        raise OptionError(
            f"`{key}` is not a group of columns, nor a column",
            remedy=f"declare units of {', '.join(FACTORS)}, or of one column such as q3",
        )
    if joint and arm is not None and not 1 <= int(joint) <= arm.n_joints:
        raise OptionError(
            f"`{key}` is no column of an arm with {arm.n_joints} joints", remedy="declare units of its columns"
        )
    if unit not in _known(group):
        raise OptionError(f"`{unit}` is not a unit of {group}", remedy=f"known: {', '.join(_known(group))}")
    judged = [int(joint) - 1] if joint else range(arm.n_joints if arm is not None else 0)
    if arm is not None and not any(suits(group, unit, arm, j) for j in judged):
        motion = "turns" if arm.rotary else "slides"
        raise OptionError(f"{group} in {unit} does not suit an arm that {motion}", remedy="declare another unit")


def has_factor(key: str, arm: Arm | None) -> bool:
    """Whether the arm's corrections have a factor that makes torques of a column."""
    factors = {} if arm is None or arm.corrections is None else arm.corrections.factor
    return key in factors or key.rstrip("0123456789") in factors


def suits(group: str, unit: str, arm: Arm | None, j: int) -> bool:
    """Whether a unit is possible for a column of joint `j` (from 0)."""
    either = group == "t" or unit == COUNTED.get(group)
    return arm is None or either or j >= arm.n_joints or (unit not in _LINEAR) == arm.rotary_joints[j]


def recognised(arrays: Arrays, names: Names, arm: Arm | None, settled: frozenset[str]) -> tuple[Arrays, list[Finding]]:
    """Convert positions that are recognised as degrees, by whole encoder counts or by a velocity column in radians.

    Nothing is converted if another joint contradicts it, or if the unit is stated; positions that are only large are left to `check`.
    """
    findings: list[Finding] = []
    turned = np.array([1.0 if slides(arm, j) else DEGREE for j in range(arrays.q.shape[1])])
    if "q" not in settled and not np.all(turned == 1.0) and (why := _degrees(arrays, names, arm)):
        q_ref, q_link = (None if x is None else x * turned for x in (arrays.q_ref, arrays.q_link))
        arrays = replace(arrays, q=arrays.q * turned, q_ref=q_ref, q_link=q_link)
        findings.append(Finding("units", f"positions are in degrees: {why}; converted"))
    if "dq" not in settled and arrays.dq is not None and names.dq is not None and not np.all(turned == 1.0):
        ratios = [0.0 if slides(arm, j) else _speed_ratio(arrays, arm, j) for j in range(arrays.q.shape[1])]
        slow = [r for r in ratios if r > 0]
        if slow and all(_SURE_RATIO[0] < 1 / r < _SURE_RATIO[1] for r in slow):
            dq_ref = None if arrays.dq_ref is None else arrays.dq_ref * turned
            arrays = replace(arrays, dq=arrays.dq * turned, dq_ref=dq_ref)
            said = f"`{names.dq[ratios.index(slow[0])]}` is {1 / slow[0]:.3g} times faster than the positions move"
            findings.append(Finding("units", f"velocities are in deg/s: {said}; converted"))
    return arrays, findings


def _degrees(arrays: Arrays, names: Names, arm: Arm | None) -> str:
    """Return the reason why positions must be in degrees; empty if no joint gives a reason, or a joint contradicts degrees."""
    reasons = []
    for j, name in enumerate(names.q):
        if slides(arm, j):
            continue
        ratio = _speed_ratio(arrays, arm, j) if arrays.dq is not None else 0.0
        if ratio > 0 and not _SURE_RATIO[0] < ratio < _SURE_RATIO[1]:
            return ""
        if _moves_in_counts(arrays, arm, j, 1.0):
            return ""
        if _moves_in_counts(arrays, arm, j, DEGREE) and not _in_whole_numbers(arrays.q[:, j]):
            reasons.append(f"`{name}` moves in whole encoder counts only if read so")
        elif ratio > 0 and names.dq is not None:
            reasons.append(f"`{name}` moves {ratio:.3g} times faster than `{names.dq[j]}` says")
    return reasons[0] if reasons else ""


def check(arrays: Arrays, place: Path | str, names: Names, arm: Arm | None, declared: frozenset[str]) -> None:
    """Raise `UnitError` where an unstated group of columns has the magnitude of another unit."""
    if "q" not in declared:
        _counts(arrays, place, names, arm)
    if "dq" not in declared:
        _velocity(arrays, place, names, arm)
    if "q" not in declared:
        _position(arrays, place, names, arm)
    if "tau" not in declared:
        _torque(arrays, place, names, arm)
    _reference(arrays, place, names, arm)


def _counts(arrays: Arrays, place: Path | str, names: Names, arm: Arm | None) -> None:
    """Raise if a position only takes whole numbers, as no motion in rad or m does: counts of an encoder, or rounded degrees or millimetres."""
    for j, name in enumerate(names.q):
        if not _in_whole_numbers(arrays.q[:, j]):
            continue
        low, high = arrays.q[:, j].min(), arrays.q[:, j].max()
        other = "--units q=mm if they are millimetres" if slides(arm, j) else "--units q=deg if they are degrees"
        remedy = f"it looks like counts: add --units q=counts, or {other}"
        if arm is None or arm.encoder_step is None:
            remedy = f"for counts {_per_turn(arm, j)[1]}, and add --units q=counts; or add {other}"
        problem = f"moves in whole numbers, from {low:.0f} to {high:.0f}, as an encoder counts"
        raise UnitError(problem, remedy=remedy, file=place, column=name)


def _in_whole_numbers(q: NDArray[np.float64]) -> bool:
    """Whether a position moves, and takes whole numbers only."""
    q = q[:_MAX_INSPECTED_SAMPLES]
    return int(np.count_nonzero(np.diff(q))) >= _FEWEST_CHANGES and bool(np.all(q == np.rint(q)))


def _velocity(arrays: Arrays, place: Path | str, names: Names, arm: Arm | None) -> None:
    if arrays.dq is None or names.dq is None:
        return
    for j, name in enumerate(names.dq):
        low, high = _MILLI_RATIO if slides(arm, j) else _DEGREE_RATIO
        unit, group = ("mm", "mm/s") if slides(arm, j) else ("deg", "deg/s")
        ratio = _speed_ratio(arrays, arm, j)
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


def _reference(arrays: Arrays, place: Path | str, names: Names, arm: Arm | None) -> None:
    """Raise if a reference covers a range that the positions cover only in another unit."""
    if arrays.q_ref is None:
        return
    for j, name in enumerate(names.q_ref):
        low, high = _MILLI_RATIO if slides(arm, j) else _DEGREE_RATIO
        wanted, moved = float(np.std(arrays.q_ref[:, j])), float(np.std(arrays.q[:, j]))
        ratio = wanted / moved if moved > 0 else 0.0
        if low <= ratio <= high or (ratio > 0 and low <= 1 / ratio <= high):
            more = f"{ratio:.3g} times farther than" if ratio > 1 else f"{1 / ratio:.3g} times less far than"
            raise UnitError(
                f"moves {more} `{names.q[j]}`, which follows it",
                remedy="bring references and positions to one unit in the file",
                file=place,
                column=name,
            )


def _speed_ratio(arrays: Arrays, arm: Arm | None, j: int) -> float:
    """Return the slope of the differenced position of joint `j` over its integrated velocity column; 0 if the velocity column is zero."""
    assert arrays.dq is not None
    moved = np.diff(_without_turns(arrays, arm, j))
    said = 0.5 * (arrays.dq[1:, j] + arrays.dq[:-1, j]) * np.diff(arrays.t)
    power = float(said @ said)
    return float(moved @ said) / power if power > 0 else 0.0


def _position(arrays: Arrays, place: Path | str, names: Names, arm: Arm | None) -> None:
    for j, name in enumerate(names.q):
        farthest, fastest, unit = _FARTHEST_RAD, _FASTEST_RAD_S, "deg"
        if slides(arm, j):
            farthest, fastest, unit = _FARTHEST_M, math.inf, "mm"
        travel, speed = _travel(arrays.q[:, j]), _peak_speed(arrays, arm, j)
        counts = not slides(arm, j) and _moves_in_counts(arrays, arm, j, DEGREE)
        if travel > farthest or speed > fastest or counts:
            si = "m" if slides(arm, j) else "rad"
            why = f"moves over {travel:.4g} {si} at up to {speed:.4g} {si}/s"
            why += ", in steps of one encoder count in degrees" if counts else ""
            raise UnitError(
                why,
                remedy=f"it looks like {unit}: add --units q={unit}, q{j + 1}={unit} if the other joints are in {si}, or q={si} if it is right",
                file=place,
                column=name,
            )


def _peak_speed(arrays: Arrays, arm: Arm | None, j: int) -> float:
    """Return the speed of joint `j` that is exceeded for 1 % of the log."""
    stride = max(1, round(_SPEED_SPAN_S / float(np.median(np.diff(arrays.t[:_MAX_INSPECTED_SAMPLES])))))
    t, q = arrays.t[::stride], _without_turns(arrays, arm, j)[::stride]
    return float(np.quantile(np.abs(np.diff(q) / np.diff(t)), 0.99)) if len(t) > 1 else 0.0


def _travel(q: NDArray[np.float64]) -> float:
    """Return the range of positions, without a few outliers."""
    wild = int(_WILD_SHARE * len(q))
    ends = np.partition(q, (wild, len(q) - 1 - wild))
    return float(ends[len(q) - 1 - wild] - ends[wild])


def _without_turns(arrays: Arrays, arm: Arm | None, j: int) -> NDArray[np.float64]:
    """Return positions of joint `j` without jumps of a wrapped encoder, by turns in radians or in degrees; lengths do not wrap."""
    q = arrays.q[:, j]
    return q if slides(arm, j) else unwrapped(unwrapped(q, TURN), 360.0)


def _moves_in_counts(arrays: Arrays, arm: Arm | None, j: int, factor: float) -> bool:
    """Whether positions of joint `j` times `factor` change in whole encoder counts."""
    if arm is None or arm.encoder_step is None:
        return False
    moved = np.diff(arrays.q[:_MAX_INSPECTED_SAMPLES, j])
    moved = moved[moved != 0]
    if len(moved) < _FEWEST_CHANGES:
        return False
    counts = moved * factor / arm.encoder_step[j]
    whole = np.abs(counts - np.round(counts)) < 0.01
    return bool(np.mean(whole & (np.round(counts) != 0)) > 0.95)


def _torque(arrays: Arrays, place: Path | str, names: Names, arm: Arm | None) -> None:
    if arm is None or arm.torque_limit is None:
        return
    for j, name in enumerate(names.tau):
        wild = int(_WILD_SHARE * len(arrays.tau))
        peak = float(np.partition(np.abs(arrays.tau[:, j]), -1 - wild)[-1 - wild])
        limit = float(arm.torque_limit[j])
        if peak > _TORQUE_TO_LIMIT_RATIO * limit:
            si = "Nm" if arm.rotary_joints[j] else "N"
            raise UnitError(
                f"reaches {peak:.4g}, {peak / limit:.3g} times the arm's torque limit of {limit:g}",
                remedy=f"give the torque at the joint in {si}; add --units tau={si} if it is right",
                file=place,
                column=name,
            )


def slides(arm: Arm | None, j: int) -> bool:
    """Whether joint `j` (from 0) is known to be linear."""
    return arm is not None and j < arm.n_joints and not arm.rotary_joints[j]
