"""What a log must satisfy, and what is worth saying about it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from armgap.errors import LogShapeError, TimeError, UnitError
from armgap.log.columns import Arrays, Names

if TYPE_CHECKING:
    from armgap.arm import Arm

__all__ = ["run"]

_FEWEST_SAMPLES = 20
# An arm's joint does not turn further than this in a log [rad]; forty full turns.
_FARTHEST_RAD = 250.0
# Degrees read as radians make a joint this much faster than any arm [rad/s].
_FASTEST_RAD_S = 150.0
# A sample period off by more than this factor from the arm file's is another unit of time.
_PERIOD_FACTOR = 30.0
_LONGEST_PERIOD_S = 0.2
_SHORTEST_PERIOD_S = 2e-5
# A hole longer than this many periods is a gap worth naming.
_GAP_PERIODS = 3.0


def run(arrays: Arrays, place: Path | str, names: Names, arm: Arm | None) -> list[tuple[str, str]]:
    """Raise on what cannot be used; return ``(kind, message)`` of what should be known."""
    _length(arrays, place)
    _order(arrays, place, names)
    _time_unit(arrays, place, names, arm)
    _position_unit(arrays, place, names, arm)
    _motion(arrays, place, names)
    return [*_sampling(arrays), *_constants(arrays, names), *_limits(arrays, names, arm)]


def _length(arrays: Arrays, place: Path | str) -> None:
    if len(arrays.t) < _FEWEST_SAMPLES:
        raise LogShapeError(
            f"holds {len(arrays.t)} samples, at least {_FEWEST_SAMPLES} are needed",
            remedy="give a longer log",
            file=place,
        )


def _order(arrays: Arrays, place: Path | str, names: Names) -> None:
    steps = np.diff(arrays.t)
    bad = np.flatnonzero(steps <= 0)
    if len(bad):
        row = int(bad[0]) + 1
        what = "repeats the time before it" if steps[bad[0]] == 0 else "goes back in time"
        many = f" ({len(bad)} rows do)" if len(bad) > 1 else ""
        raise TimeError(
            f"{what}{many}", remedy="sort the log by time and drop repeats", file=place, column=names.t, row=row + 1
        )


def _time_unit(arrays: Arrays, place: Path | str, names: Names, arm: Arm | None) -> None:
    period = float(np.median(np.diff(arrays.t)))
    expected = arm.sample_period if arm is not None else None
    low, high = _SHORTEST_PERIOD_S, _LONGEST_PERIOD_S
    if expected is not None:
        low, high = expected / _PERIOD_FACTOR, expected * _PERIOD_FACTOR
    if low <= period <= high:
        return
    against = f"the arm file says {expected:g} s" if expected is not None else "no arm is sampled so"
    unit = next((u for u, f in (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)) if low <= period * f <= high), None)
    guess = f"it looks like {unit}; convert it to s" if unit else "give times in s"
    raise UnitError(
        f"the median sample period is {period:g} s, {against}", remedy=guess, file=place, column=names.t
    )


def _position_unit(arrays: Arrays, place: Path | str, names: Names, arm: Arm | None) -> None:
    if arm is not None and not arm.rotary:
        return
    steps = np.diff(arrays.t)
    for j, name in enumerate(names.q):
        q = arrays.q[:, j]
        speed = float(np.quantile(np.abs(np.diff(q) / steps), 0.99))
        travel = float(np.ptp(q))
        far = travel > _FARTHEST_RAD or speed > _FASTEST_RAD_S
        declared = arrays.dq is not None and _ratio(arrays, j) > 20.0
        if far or declared:
            why = f"moves over {travel:.4g} rad at up to {speed:.4g} rad/s"
            why += ", many times its own velocity column" if declared else ""
            raise UnitError(why, remedy="it looks like degrees; convert it to rad", file=place, column=name)


def _ratio(arrays: Arrays, j: int) -> float:
    """How many times faster positions move than the velocity column says."""
    assert arrays.dq is not None
    moved = float(np.mean(np.abs(np.diff(arrays.q[:, j]))))
    said = float(np.mean(np.abs(arrays.dq[:-1, j]) * np.diff(arrays.t)))
    return moved / said if said > 0 else 0.0


def _motion(arrays: Arrays, place: Path | str, names: Names) -> None:
    if np.all(np.ptp(arrays.q, axis=0) == 0):
        raise LogShapeError(
            "no joint moves", remedy="a log without motion says nothing about the arm", file=place, column=names.q[0]
        )
    if np.all(arrays.tau == 0):
        raise LogShapeError(
            "all torques are zero",
            remedy="map the columns of the commanded torque with --columns tau1=NAME",
            file=place,
            column=names.tau[0],
        )


def _sampling(arrays: Arrays) -> list[tuple[str, str]]:
    steps = np.diff(arrays.t)
    period = float(np.median(steps))
    found = []
    jitter = float(np.quantile(np.abs(steps - period), 0.95))
    if jitter > 0.02 * period:
        found.append(("sampling", f"uneven sampling: median {period * 1e3:.3g} ms, 95 % within {jitter * 1e3:.2g} ms"))
    gaps = np.flatnonzero(steps > _GAP_PERIODS * period)
    if len(gaps):
        widest = int(np.argmax(steps))
        found.append(
            (
                "gap",
                f"{len(gaps)} gap{'s' if len(gaps) > 1 else ''} of more than {_GAP_PERIODS:g} sample periods, "
                f"the widest {steps[widest] * 1e3:.3g} ms after row {widest + 1}; the torque is taken to be held",
            )
        )
    return found


def _constants(arrays: Arrays, names: Names) -> list[tuple[str, str]]:
    found = []
    for values, group in ((arrays.q, names.q), (arrays.tau, names.tau)):
        for j, name in enumerate(group):
            if np.ptp(values[:, j]) == 0:
                found.append(("constant", f"`{name}` is constant at {values[0, j]:.6g}"))
    return found


def _limits(arrays: Arrays, names: Names, arm: Arm | None) -> list[tuple[str, str]]:
    if arm is None or arm.torque_limit is None:
        return []
    found = []
    for j, name in enumerate(names.tau):
        over = int(np.sum(np.abs(arrays.tau[:, j]) > arm.torque_limit[j] * 1.001))
        if over:
            found.append(("limit", f"`{name}` exceeds the arm's limit of {arm.torque_limit[j]:g} in {over} samples"))
    return found
