"""Requirements on a log, whose violation is an error, and findings worth reporting."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armgap.errors import LogShapeError, TimeError
from armgap.log.conversion.columns import OPTIONAL, Arrays, Names, left_out
from armgap.log.findings import Finding, counted
from armgap.log.recording import Recording

if TYPE_CHECKING:
    from armgap.arm.arm import Arm

__all__ = ["motion", "notice", "order", "unused", "without_repeats"]

#: Smallest number of samples of a log.
_FEWEST_SAMPLES = 20
# Length of a hole in the samples, in sample periods, from which it is reported as a gap.
_GAP_PERIODS = 3.0
# Relative deviation of the sample period from the arm file's from which it is reported.
_PERIOD_MARGIN = 0.1
# Deviation of sample times from an even grid, in periods, from which it is reported.
_JITTER = 0.02
# Largest number of times per finding that are kept for charts.
_DRAWN = 200


def order(arrays: Arrays, place: Path | str, names: Names) -> None:
    """Raise unless a log has enough samples and its times increase."""
    if len(arrays.t) < _FEWEST_SAMPLES:
        raise LogShapeError(
            f"holds {len(arrays.t)} samples, at least {_FEWEST_SAMPLES} are needed",
            remedy="give a longer log",
            file=place,
            column=names.t,
            row=len(arrays.t),
        )
    steps = np.diff(arrays.t)
    bad = np.flatnonzero(steps <= 0)
    bad = bad[~_repeat(arrays, bad)]
    if len(bad):
        row = int(bad[0]) + 2
        before, after = arrays.t[row - 2], arrays.t[row - 1]
        what = f"repeats the time {after:.10g}" if after == before else f"goes back from {before:.10g} to {after:.10g}"
        many = f" ({len(bad)} rows do so)" if len(bad) > 1 else ""
        raise TimeError(
            f"{what}{many}",
            remedy="sort the log by time and drop repeats",
            file=place,
            column=names.t,
            row=row,
        )


def without_repeats(arrays: Arrays) -> tuple[Arrays, list[Finding]]:
    """Leave out rows that repeat the time and all values of the row before, and return a finding with their number."""
    again = np.flatnonzero(np.diff(arrays.t) == 0) + 1
    if not len(again):
        return arrays, []
    keep = np.ones(len(arrays.t), dtype=bool)
    keep[again] = False
    said = f"left out: {counted(len(again), 'row')} like the row before in every value, the first of them row {again[0] + 1}"
    when = tuple((arrays.t[again[:_DRAWN]] - arrays.t[0]).tolist())
    return arrays.rows(keep), [Finding("cleaned", said, when)]


def _repeat(arrays: Arrays, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return a mask: whether the row after each of `rows` has equal values in all columns."""
    same: NDArray[np.bool_] = arrays.t[rows + 1] == arrays.t[rows]
    for values in (
        arrays.q, arrays.tau, arrays.dq, arrays.tau_meas, arrays.q_link, arrays.q_ref, arrays.dq_ref,
    ):  # fmt: skip
        if values is not None:
            same &= np.all(values[rows + 1] == values[rows], axis=1)
    return same


def motion(arrays: Arrays, place: Path | str, names: Names) -> None:
    """Raise unless some joint moves and, where torques are logged, some torque acts."""
    if np.all(arrays.q == arrays.q[0]):
        raise LogShapeError(
            "no joint moves",
            remedy="a log without motion says nothing about the arm",
            file=place,
            column=names.q[0],
        )
    if names.tau and np.all(arrays.tau == 0):
        raise LogShapeError(
            "all torques are zero",
            remedy="map the columns of the commanded torque with --columns tau1=NAME",
            file=place,
            column=names.tau[0],
        )


def notice(arrays: Arrays, names: Names, arm: Arm | None) -> list[Finding]:
    """Return findings about sampling, limits and constant columns that do not prevent a diagnosis."""
    plain = [*_constants(arrays, names), *_limits(arrays, names, arm)]
    return [
        *(Finding(kind, message) for kind, message in _sampling(arrays, arm)),
        *_gaps(arrays),
        *(Finding(kind, message) for kind, message in plain),
    ]


def unused(recording: Recording, names: Names) -> list[Finding]:
    """Return findings about columns of velocities, measured torques and link-side positions that are left out."""
    said = []
    for prefix in ("dq", "tau_meas", "q_link"):
        if columns := left_out(recording, names, prefix):
            why = f"{OPTIONAL[prefix]} of other joints are missing, or on another clock"
            said.append(Finding("columns", f"`{'`, `'.join(columns)}` not used: {why}"))
    return said


def _sampling(arrays: Arrays, arm: Arm | None) -> list[tuple[str, str]]:
    steps = np.diff(arrays.t)
    period = float(np.median(steps))
    found = []
    jitter = float(np.max(np.abs(steps - period)))
    off = int(np.sum(np.abs(steps - period) > _JITTER * period))
    if off:
        found.append(
            (
                "sampling",
                f"uneven sampling: median {period * 1e3:.4g} ms, {off} of {len(steps)} periods differ by more than "
                f"{100 * _JITTER:.0f} %, at most by {jitter * 1e3:.3g} ms",
            )
        )
    if arm is not None and abs(period / arm.sample_period - 1) > _PERIOD_MARGIN:
        found.append(
            (
                "period",
                f"sampled every {period * 1e3:.4g} ms, the arm file says {arm.sample_period * 1e3:.4g} ms",
            )
        )
    return found


def _gaps(arrays: Arrays) -> list[Finding]:
    steps = np.diff(arrays.t)
    period = float(np.median(steps))
    gaps = np.flatnonzero(steps > _GAP_PERIODS * period)
    if not len(gaps):
        return []
    widest = int(np.argmax(steps))
    said = (
        f"{len(gaps)} gap{'s' if len(gaps) > 1 else ''} of more than {_GAP_PERIODS:g} sample periods, the "
        f"widest {steps[widest] * 1e3:.3g} ms after row {widest + 1}; the torque is taken to be held there"
    )
    return [Finding("gap", said, tuple((arrays.t[gaps[:_DRAWN]] - arrays.t[0]).tolist()))]


def _constants(arrays: Arrays, names: Names) -> list[tuple[str, str]]:
    found = []
    for values, group in ((arrays.q, names.q), (arrays.tau, names.tau)):
        for j, name in enumerate(group):
            if np.all(values[:, j] == values[0, j]):
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
