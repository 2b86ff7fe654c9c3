"""Defects of time and resolution: shifted, held, filtered, rounded and wrapped samples, and irregular time stamps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from scipy import signal

from .case import Array, Inputs, Table, Truth
from .defect import ANY, ROTARY, TWO_LINK, Defect
from .expected import Expected

Result = tuple[Inputs, Expected]

#: Cut-off of the low-pass filters, and sample rate of a field bus that is slower than the log [Hz].
CUT_OFF, BUS = 8.0, 42.0
#: Step to which torques are rounded [N m], and the step as a share of the column's range where the range decides.
TORQUE_STEP, SHARE = 0.5, 0.04
#: Probability that a defect is in all logs, in the training logs only, in the holdout only.
WHERE = {"both": 0.5, "training": 0.25, "holdout": 0.25}
#: Effects that act in the time of a shift, and those whose motion is faster than a filter or a held sample lets through.
SHIFTS = ("actuator_delay", "actuator_lag")
FAST = (*SHIFTS, "joint_elasticity", "backlash", "external_pulse", "presliding", "torque_ripple", "contact")


def sampling() -> Iterator[Defect]:
    """Yield the defects of time and resolution."""
    for rows in range(1, 6):
        yield Defect(f"time_shift:late {rows}", partial(late, rows=rows), ANY, ("q", "rows"), SHIFTS)
        yield Defect(f"time_shift:early {rows}", partial(early, rows=rows), ANY, ("tau", "rows"), SHIFTS)
    for rows in (2, 3, 5):
        yield Defect(f"repeated_positions:{rows}", partial(held, rows=rows), ANY, ("q",))
    for name, change in (("causal", causal), ("zero phase", zero_phase), ("interpolated", interpolated)):
        yield Defect(f"filtered_positions:{name}", partial(filtered, change=change), ANY, ("q",), FAST)
    yield Defect(
        "quantized_torque:0.5 N m", partial(rounded, step=TORQUE_STEP), ROTARY, ("tau",), ("torque_dead_zone",)
    )
    yield Defect("quantized_torque:share of range", rounded, ANY, ("tau",), ("torque_dead_zone",))
    yield Defect("wrapped_positions:q1", partial(wrapped, joint=1), ROTARY, ("q",))
    yield Defect("wrapped_positions:q2", partial(wrapped, joint=2), TWO_LINK, ("q",))
    for share in (0.1, 0.2, 0.3):
        yield Defect(f"stamp_jitter:{share}", partial(scattered, share=share), ANY, ("t",))


def late(inputs: Inputs, truth: Truth, _: np.random.Generator, *, rows: int) -> Result:
    """Put the torque of `rows` samples earlier into every row, so that the arm appears to move before it is driven."""

    def change(x: Table) -> Table:
        return x.rows(slice(rows, None)).changed(tau=x.tau[:-rows])

    remedy = f"--shift tau={-rows * truth.period:.6g}"
    return inputs.each(change), Expected(("time_shift",), ("repaired",), (remedy,))


def early(inputs: Inputs, truth: Truth, _: np.random.Generator, *, rows: int) -> Result:
    """Put the torque of `rows` samples later into every row, which looks like a delay on every joint.

    A shift of up to one sample is a nuisance, which need not be reported.
    """

    def change(x: Table) -> Table:
        return x.rows(slice(None, -rows)).changed(tau=x.tau[rows:])

    remedy = f"--shift tau={rows * truth.period:.6g}"
    silent = ("none", "parameters", "effect") if rows == 1 else ()
    expected = Expected(("time_shift",), ("warning",), (remedy,), verdicts=silent, allowed=("actuator_delay",))
    return inputs.each(change), expected


def held(inputs: Inputs, truth: Truth, rng: np.random.Generator, *, rows: int) -> Result:
    """Update positions only once in so many rows, and hold them in between."""

    def change(x: Table) -> Table:
        return x.changed(q=x.q[rows * (np.arange(len(x.t)) // rows)])

    return inputs.each(change, _where(rng)), Expected(("repeated_positions",), ("repaired",))


def filtered(
    inputs: Inputs, truth: Truth, rng: np.random.Generator, *, change: Callable[[Array, Array], Array]
) -> Result:
    """Filter positions by `change`, so that they are smoother than the encoder's steps allow."""
    expected = Expected(("filtered_positions",), ("warning", "error"))
    return inputs.each(lambda x: x.changed(q=change(x.t, x.q)), _where(rng)), expected


def causal(t: Array, q: Array) -> Array:
    """Return positions after a first-order low-pass with cut-off :data:`CUT_OFF`, at rest at the first sample."""
    b, a = signal.butter(1, CUT_OFF, fs=_rate(t))
    return np.asarray(signal.lfilter(b, a, q, axis=0, zi=signal.lfilter_zi(b, a)[:, None] * q[:1])[0])


def zero_phase(t: Array, q: Array) -> Array:
    """Return positions after a second-order low-pass with cut-off :data:`CUT_OFF`, applied forward and backward."""
    return np.asarray(signal.filtfilt(*signal.butter(2, CUT_OFF, fs=_rate(t)), q, axis=0))


def interpolated(t: Array, q: Array) -> Array:
    """Return positions sampled at the rate :data:`BUS` and interpolated linearly."""
    coarse = np.arange(t[0], t[-1] + 1 / BUS, 1 / BUS)
    read = np.searchsorted(t, coarse + 1e-9, side="right").clip(1, len(t)) - 1
    return np.column_stack([np.interp(t, t[read], column[read]) for column in q.T])


def rounded(inputs: Inputs, truth: Truth, rng: np.random.Generator, *, step: float | None = None) -> Result:
    """Round logged torques to multiples of `step` [N m], or of a share of each column's range; the arm received the unrounded torques."""
    span = np.max([np.ptp(x.tau, axis=0) for x in inputs.logs.values()], axis=0)
    steps = SHARE * span if step is None else np.full(truth.n_joints, step)
    changed = inputs.each(lambda x: x.changed(tau=np.round(x.tau / steps) * steps), _where(rng))
    return changed, Expected(("quantized_torque",), ("warning",))


def wrapped(inputs: Inputs, truth: Truth, rng: np.random.Generator, *, joint: int) -> Result:
    """Wrap a joint's positions by a whole turn in the middle of its travel, as an absolute encoder with its zero there does."""
    name, turn = f"q{joint}", 2 * math.pi
    where = _where(rng)
    logs = inputs.holdout if where == "holdout" else inputs.training
    cut = float(np.median(np.concatenate([x.column(name) for x in logs.values()])))
    changed = inputs.each(lambda x: x.with_column(name, cut + (x.column(name) - cut) % turn), where)
    return changed, Expected(("wrapped_positions",), ("repaired",))


def scattered(inputs: Inputs, truth: Truth, rng: np.random.Generator, *, share: float) -> Result:
    """Add noise to the time stamps, with a standard deviation of a share of the period; the stamps still increase."""

    def change(x: Table) -> Table:
        t = np.sort(x.t + share * truth.period * rng.standard_normal(len(x.t)))
        return x.changed(t=t - t[0])

    return inputs.each(change, _where(rng)), Expected(("stamp_jitter",), ("repaired",))


def _where(rng: np.random.Generator) -> str:
    return str(rng.choice(list(WHERE), p=list(WHERE.values())))


def _rate(t: Array) -> float:
    return 1 / float(np.median(np.diff(t)))
