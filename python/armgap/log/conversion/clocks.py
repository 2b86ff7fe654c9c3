"""Conversion of times to seconds, and of torques with their own time stamps to the times of the positions.

A torque with its own time stamps is held from its time until the next (zero-order hold), as a drive does. Positions
stay as they were measured; nothing is interpolated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armgap.errors import TimeError, UnitError
from armgap.log.conversion.columns import Arrays, Names, Raw
from armgap.log.conversion.units import FACTORS, Scales
from armgap.log.findings import Finding, counted

if TYPE_CHECKING:
    from armgap.arm.arm import Arm

__all__ = ["in_seconds", "ticks"]

Times = NDArray[np.float64] | NDArray[np.int64]

# Ratio of a sample period to the arm file's beyond which times are in another unit.
_PERIOD_FACTOR = 30.0
# Relative difference from the arm file's period up to which a unit of time is recognised.
_PERIOD_MATCH = 0.2
_LONGEST_PERIOD_S = 0.2
_SHORTEST_PERIOD_S = 2e-5
# Range of time stamps since 1970 [s], the years 2001 to 2096, by which a unit of time is recognised from the magnitude alone.
_EPOCH_S = (1e9, 4e9)
# Ratio of the spans of torques and positions beyond which their times are in different units: units differ by 1000.
_SPAN_FACTOR = 10.0
# Longest time for which a torque is held, in its own sample periods.
_HELD_PERIODS = 3.0
# Largest number of times per finding that are kept for charts.
_DRAWN = 200


@dataclass(frozen=True)
class _Clock:
    """Times of one clock of a recording, in seconds from a common start."""

    t: NDArray[np.float64]
    name: str


def in_seconds(
    raw: Raw, scales: Scales, names: Names, arm: Arm | None, place: Path | str
) -> tuple[Arrays, list[Finding]]:
    """Return the columns with times in seconds and torques at the positions' times.

    Times start near zero; an unknown unit is recognised where only one is possible.

    Raises
    ------
    UnitError
        If times cannot be in seconds and no other unit is certain.
    TimeError
        If the torques' times run backwards or share no span with the positions'.
    """
    findings: list[Finding] = []
    factor = raw.tick_s or scales.t or _unit(raw.t, names.t, arm, place, findings)
    if raw.t_tau is None or names.t_tau is None:
        t = _seconds(raw.t, raw.t[0], factor)
        return Arrays(t, raw.q, raw.tau, raw.dq, raw.q_ref, raw.dq_ref, raw.tau_meas, raw.q_link), findings
    tau_factor = raw.tau_tick_s or scales.t_tau or _tau_unit(raw.t_tau, raw.t, factor, names.t_tau, findings)
    start, tau_start = raw.t[0], raw.t_tau[0]
    # Both clocks have the same zero; from here on, times of both count from the time of the first position.
    offset = _difference(tau_start, start, tau_factor, factor)
    t_q = _Clock(_seconds(raw.t, start, factor), names.t)
    t_tau = _Clock(_seconds(raw.t_tau, tau_start, tau_factor) + offset, names.t_tau)
    return _hold(raw, t_q, t_tau, place, findings), findings


def ticks(raw: Raw, scales: Scales, names: Names, arm: Arm | None, place: Path | str) -> dict[str, float]:
    """Return the seconds per unit of the time columns ``t`` and, for torques with their own times, ``t_tau``, by standard name."""
    factor = raw.tick_s or scales.t or _unit(raw.t, names.t, arm, place, [])
    if raw.t_tau is None or names.t_tau is None:
        return {"t": factor}
    tau_factor = raw.tau_tick_s or scales.t_tau or _tau_unit(raw.t_tau, raw.t, factor, names.t_tau, [])
    return {"t": factor, "t_tau": tau_factor}


def _seconds(times: Times, start: np.int64 | np.float64, factor: float) -> NDArray[np.float64]:
    """Return times in seconds from `start`; whole numbers, which may be stamps of many digits, are subtracted exactly."""
    if times.dtype.kind == "i":
        times = times - np.int64(start)
    seconds = np.array(times, dtype=np.float64)
    seconds *= factor
    return seconds


def _difference(a: np.int64 | np.float64, b: np.int64 | np.float64, a_factor: float, b_factor: float) -> float:
    """Return the offset [s] between the zeros of two clocks, for times counted as by `_seconds`."""
    a_zero, b_zero = (int(x) if isinstance(x, np.integer) else 0 for x in (a, b))
    if a_factor == b_factor:
        return (a_zero - b_zero) * a_factor
    return a_zero * a_factor - b_zero * b_factor


def _period(times: Times) -> float:
    return float(np.median(np.diff(times))) if len(times) > 1 else 0.0


def _unit(times: Times, name: str, arm: Arm | None, place: Path | str, findings: list[Finding]) -> float:
    """Return the seconds per unit of times without a stated unit."""
    period = _period(times)
    low, high, against = _SHORTEST_PERIOD_S, _LONGEST_PERIOD_S, "no arm is sampled so"
    if arm is not None:
        low, high = arm.sample_period / _PERIOD_FACTOR, arm.sample_period * _PERIOD_FACTOR
        against = f"the arm file says {arm.sample_period:g} s"
    if low <= period <= high or period <= 0:
        return 1.0
    likely = [u for u, factor in FACTORS["t"].items() if u != "s" and low <= period * factor <= high]
    sure = [u for u in likely if _is_epoch(times, u) or _matches(period, u, arm)]
    if len(sure) == 1:
        findings.append(Finding("units", f"times are in {sure[0]}: {_reason(times, sure[0], period, arm)}; converted"))
        return FACTORS["t"][sure[0]]
    # Without an arm several units may be possible; the error names the unit with the sample period nearest to a millisecond.
    likely.sort(key=lambda u: abs(math.log(period * FACTORS["t"][u] / 1e-3)))
    remedy = f"it looks like {likely[0]}: add --units t={likely[0]}" if likely else "give times in s"
    raise UnitError(f"the median sample period is {period:g} s, {against}", remedy=remedy, file=place, column=name)


def _tau_unit(times: Times, positions: Times, factor: float, name: str, findings: list[Finding]) -> float:
    """Return the seconds per unit of the torques' times: that of the positions' times unless the stamps, or the spans of both, contradict it."""
    for unit, seconds in FACTORS["t"].items():
        if _is_epoch(times, unit) and seconds != factor and not _is_epoch(times, _named(factor)):
            findings.append(Finding("units", f"the torques' times `{name}` are stamps in {unit}; converted"))
            return seconds
    lasts, torques_last = (float(x[-1] - x[0]) for x in (positions, times))
    alike = [
        unit
        for unit, seconds in FACTORS["t"].items()
        if lasts * factor / _SPAN_FACTOR < torques_last * seconds < _SPAN_FACTOR * lasts * factor
    ]
    if len(alike) != 1 or FACTORS["t"][alike[0]] == factor:
        return factor
    findings.append(
        Finding(
            "units",
            f"the torques' times `{name}` are in {alike[0]}: they then last as long as the positions; converted",
        )
    )
    return FACTORS["t"][alike[0]]


def _named(factor: float) -> str:
    """Return the name of a unit of time from its length [s]."""
    return next((unit for unit, seconds in FACTORS["t"].items() if seconds == factor), "s")


def _is_epoch(times: Times, unit: str) -> bool:
    low, high = (limit / FACTORS["t"][unit] for limit in _EPOCH_S)
    return bool(low <= times[0] <= high and low <= times[-1] <= high)


def _matches(period: float, unit: str, arm: Arm | None) -> bool:
    return arm is not None and abs(period * FACTORS["t"][unit] / arm.sample_period - 1) < _PERIOD_MATCH


def _reason(times: Times, unit: str, period: float, arm: Arm | None) -> str:
    if _is_epoch(times, unit):
        return "they are stamps since 1970"
    assert arm is not None
    return f"the median period of {period:g} is then the arm file's {arm.sample_period:g} s"


def _hold(raw: Raw, t: _Clock, t_tau: _Clock, place: Path | str, findings: list[Finding]) -> Arrays:
    """Hold torques until their next time, leave out positions without a torque, and report both."""
    steps = np.diff(t_tau.t)
    bad = np.flatnonzero(steps <= 0)
    if len(bad):
        raise TimeError(
            "the torques' times repeat or run backwards",
            remedy="sort the torques by time and drop repeats",
            file=place,
            column=t_tau.name,
            row=int(bad[0]) + 2,
        )
    period = float(np.median(steps)) if len(steps) else 0.0
    held = np.searchsorted(t_tau.t, t.t, side="right") - 1
    keep = (held >= 0) & (t.t <= t_tau.t[-1] + _HELD_PERIODS * period)
    if not keep.any():
        ahead = "after" if t_tau.t[0] > t.t[-1] else "before"
        raise TimeError(
            f"the torques' times share no span with the positions': they run {ahead} them, "
            f"from {t_tau.t[0] - t.t[0]:.6g} s to {t_tau.t[-1] - t.t[0]:.6g} s after the first position",
            remedy="record both with the same clock",
            file=place,
            column=t_tau.name,
        )
    _report(t, t_tau, held, keep, period, findings)
    dq, tau_meas, q_link = (None if x is None else x[keep] for x in (raw.dq, raw.tau_meas, raw.q_link))
    return Arrays(t.t[keep], raw.q[keep], raw.tau[held[keep]], dq, tau_meas=tau_meas, q_link=q_link)


def _report(
    t: _Clock, t_tau: _Clock, held: NDArray[np.intp], keep: NDArray[np.bool_], period: float, findings: list[Finding]
) -> None:
    same = len(t.t) == len(t_tau.t) and bool(np.array_equal(t.t, t_tau.t))
    if same:
        return
    age = t.t[keep] - t_tau.t[held[keep]]
    unseen = int(held[keep][-1] - held[keep][0] + 1) - len(np.unique(held[keep]))
    message = (
        f"torques have a clock of their own (`{t_tau.name}`, every {period * 1e3:.4g} ms; positions every "
        f"{_period(t.t) * 1e3:.4g} ms), starting {(t_tau.t[0] - t.t[0]) * 1e3:.4g} ms after the positions; held until the next, "
        f"they are {float(np.mean(age)) * 1e3:.3g} ms old on average, {float(np.max(age)) * 1e3:.3g} ms at most"
    )
    if unseen:
        message += f"; {unseen} torques lie between two positions and act on none"
    findings.append(Finding("clock", message))
    start = t.t[keep][0]
    early, late = held < 0, ~keep & (held >= 0)
    for rows, where in ((early, "before the first torque"), (late, "after the last torque")):
        if rows.any():
            when = tuple((t.t[rows][:_DRAWN] - start).tolist())
            findings.append(Finding("cleaned", f"left out {where}: {counted(int(rows.sum()), 'row')}", when))
