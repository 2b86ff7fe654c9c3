"""Defects of time and resolution: shifted, held, filtered, rounded, wrapped, and stamps that scatter."""

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

#: Cut-off of the filters [Hz], and the rate of a bus that is slower than the log [Hz].
CUT_OFF, BUS = 8.0, 42.0
#: Step of a coarse torque [N m], and its share of the column's range where that is used.
TORQUE_STEP, SHARE = 0.5, 0.04
#: How often such a defect is in all logs, in those learnt from only, in those judged on only.
WHERE = {"both": 0.5, "training": 0.25, "holdout": 0.25}
#: Effects that act in the time of a shift, and those whose motion is faster than a filter or a held sample lets through.
SHIFTS = ("actuator_delay", "actuator_lag")
FAST = (*SHIFTS, "joint_elasticity", "backlash", "external_pulse", "presliding", "torque_ripple", "contact")


def sampling() -> Iterator[Defect]:
    """All of them."""
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
    """The torque of ``rows`` samples ago in every row: the arm moves before it is driven."""

    def change(x: Table) -> Table:
        return x.rows(slice(rows, None)).changed(tau=x.tau[:-rows])

    remedy = f"--shift tau={-rows * truth.period:.6g}"
    return inputs.each(change), Expected(("time_shift",), ("repaired",), (remedy,))


def early(inputs: Inputs, truth: Truth, _: np.random.Generator, *, rows: int) -> Result:
    """The torque of ``rows`` samples later in every row: like a delay on every joint.

    Up to one sample is a nuisance, which need not be said.
    """

    def change(x: Table) -> Table:
        return x.rows(slice(None, -rows)).changed(tau=x.tau[rows:])

    remedy = f"--shift tau={rows * truth.period:.6g}"
    silent = ("none", "parameters", "effect") if rows == 1 else ()
    expected = Expected(("time_shift",), ("warning",), (remedy,), verdicts=silent, allowed=("actuator_delay",))
    return inputs.each(change), expected


def held(inputs: Inputs, truth: Truth, rng: np.random.Generator, *, rows: int) -> Result:
    """Positions that come once in so many rows and are held."""

    def change(x: Table) -> Table:
        return x.changed(q=x.q[rows * (np.arange(len(x.t)) // rows)])

    return inputs.each(change, _where(rng)), Expected(("repeated_positions",), ("repaired",))


def filtered(
    inputs: Inputs, truth: Truth, rng: np.random.Generator, *, change: Callable[[Array, Array], Array]
) -> Result:
    """Positions smoother than their encoder."""
    expected = Expected(("filtered_positions",), ("warning", "error"))
    return inputs.each(lambda x: x.changed(q=change(x.t, x.q)), _where(rng)), expected


def causal(t: Array, q: Array) -> Array:
    """First-order low-pass at :data:`CUT_OFF`, from rest at the first sample."""
    b, a = signal.butter(1, CUT_OFF, fs=_rate(t))
    return np.asarray(signal.lfilter(b, a, q, axis=0, zi=signal.lfilter_zi(b, a)[:, None] * q[:1])[0])


def zero_phase(t: Array, q: Array) -> Array:
    """Second-order low-pass at :data:`CUT_OFF`, forward and backward."""
    return np.asarray(signal.filtfilt(*signal.butter(2, CUT_OFF, fs=_rate(t)), q, axis=0))


def interpolated(t: Array, q: Array) -> Array:
    """Read at :data:`BUS`, with straight lines between."""
    coarse = np.arange(t[0], t[-1] + 1 / BUS, 1 / BUS)
    read = np.searchsorted(t, coarse + 1e-9, side="right").clip(1, len(t)) - 1
    return np.column_stack([np.interp(t, t[read], column[read]) for column in q.T])


def rounded(inputs: Inputs, truth: Truth, rng: np.random.Generator, *, step: float | None = None) -> Result:
    """Torques in steps: of `step`, or of a share of each column's range. The arm felt the torque without them."""
    span = np.max([np.ptp(x.tau, axis=0) for x in inputs.logs.values()], axis=0)
    steps = SHARE * span if step is None else np.full(truth.n_joints, step)
    changed = inputs.each(lambda x: x.changed(tau=np.round(x.tau / steps) * steps), _where(rng))
    return changed, Expected(("quantized_torque",), ("warning",))


def wrapped(inputs: Inputs, truth: Truth, rng: np.random.Generator, *, joint: int) -> Result:
    """A turn's wrap amid the joint's travel: an absolute encoder whose zero lies there."""
    name, turn = f"q{joint}", 2 * math.pi
    where = _where(rng)
    logs = inputs.holdout if where == "holdout" else inputs.training
    cut = float(np.median(np.concatenate([x.column(name) for x in logs.values()])))
    changed = inputs.each(lambda x: x.with_column(name, cut + (x.column(name) - cut) % turn), where)
    return changed, Expected(("wrapped_positions",), ("repaired",))


def scattered(inputs: Inputs, truth: Truth, rng: np.random.Generator, *, share: float) -> Result:
    """Stamps that scatter by a share of the period (one standard deviation) around even samples, in increasing order."""

    def change(x: Table) -> Table:
        t = np.sort(x.t + share * truth.period * rng.standard_normal(len(x.t)))
        return x.changed(t=t - t[0])

    return inputs.each(change, _where(rng)), Expected(("stamp_jitter",), ("repaired",))


def _where(rng: np.random.Generator) -> str:
    return str(rng.choice(list(WHERE), p=list(WHERE.values())))


def _rate(t: Array) -> float:
    return 1 / float(np.median(np.diff(t)))
