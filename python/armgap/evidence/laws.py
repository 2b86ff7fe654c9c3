"""Evidence for a cause: residual torque of the model without the cause over the cause's variable, with the fitted law.

Short windows of the held-out logs are predicted twice under the logged torque, without the cause and with it. The second
derivative of "measured minus predicted without" times the inertia matrix is the residual torque of the model without the
cause. The second derivative of "predicted with minus predicted without" times the inertia matrix is the law, seen through
the same filter. Both are averaged over ranges of the variable that the cause depends on: speed for friction, position for
ripple, and so on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any, NotRequired, TypedDict

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm.arm import Arm
from armgap.evidence.hypothesis import Array, EffectInstance, Hypothesis, delivered, true_positions
from armgap.log.log import Log

__all__ = ["laws"]

#: Largest number of windows that evidence for a cause is taken from, over all logs.
_MAX_EVIDENCE_WINDOWS = 160
#: Smallest half width of the local cubics that give second derivatives, as a number of samples and as a time.
HALF_SAMPLES, HALF_S = 8, 0.016
#: Largest number of ranges of the variable that evidence is averaged over, fewest samples in a range, fewest in total, and most points drawn.
BINS, FEWEST, _MIN_MOVING_SAMPLES, POINTS = 24, 4, 40, 400
#: Speed below which a joint counts as at rest, where dry friction hides any torque, as a part of the 99th percentile of its speed.
_REST_SPEED_RATIO = 0.01
#: Time before and after an event from which its evidence is taken, in durations of the event, and shortest duration that is assumed.
EVENT, EVENT_S = 4.0, 0.1
#: Two-sided 95 % quantile of the normal distribution, in standard deviations.
NORMAL_95 = 1.96

#: Effects that act on the commanded torque.
ON_COMMAND = ("actuator_lag", "actuator_delay", "torque_saturation", "torque_dead_zone", "torque_gain")
#: Effects that act on the encoders' readings.
ON_ENCODER = ("encoder_offset", "encoder_eccentricity")


class LawPoints(TypedDict):
    """Residual torque of samples over the variable of a cause, a few hundred samples at most."""

    x: Annotated[list[float], "Variable of the law."]
    y: Annotated[list[float], "Residual torque of the model without the cause."]


class LawBins(TypedDict):
    """Means of residual torque and law over ranges of a cause's variable."""

    x: Annotated[list[float], "Variable of the law."]
    mean: Annotated[list[float], "Residual torque of the model without the cause."]
    error: Annotated[list[float], "Half width of the 95 % interval of the mean."]
    law: Annotated[list[float], "Torque of the fitted law."]


class Law(TypedDict):
    """Fitted law of a cause and the residual torques that support it; samples and means only if there are enough samples."""

    effect: str
    joint: Annotated[int | None, "1-based joint; null for the whole arm."]
    windows: Annotated[int, "Windows that were predicted."]
    failed: Annotated[int, "Windows that could not be simulated."]
    why: NotRequired[Annotated[str, "Why the first of these could not."]]
    log: NotRequired[Annotated[str, "The log that an external disturbance belongs to."]]
    shown_joint: NotRequired[Annotated[int, "1-based joint whose torque is drawn."]]
    variable: NotRequired[Annotated[str, "Variable that the law depends on."]]
    unit: NotRequired[Annotated[str, "Its unit."]]
    torque_unit: NotRequired[str]
    folded: NotRequired[Annotated[bool, "Whether torques are drawn along the direction of motion."]]
    at_rest: NotRequired[Annotated[float, "Share of samples left out because the joint rests."]]
    bins: NotRequired[LawBins]
    explained: NotRequired[Annotated[float, "Share of the mean square of the binned data that the law explains."]]
    points: NotRequired[LawPoints]


@dataclass(frozen=True)
class EvidenceSamples:
    """Samples of motion, torque and its rate, residual torque without the cause, and law; arrays of shape (n, n_joints) unless noted."""

    t: Array  # (n,), times [s]
    window: Array  # (n,), number of the window that a sample is from
    q: Array
    dq: Array
    ddq: Array
    tau: Array
    rate: Array
    residual: Array
    law: Array


@dataclass(frozen=True)
class Variable:
    """Variable that a cause's torque depends on: name with a placeholder for the joint, unit for a rotary and a linear joint, and value.

    For causes with `folded`, whose torque changes sign with the direction of motion, torques are drawn as positive along the motion.
    """

    name: str
    units: tuple[str, str]
    value: Callable[[EvidenceSamples, int, dict[str, float]], Array]
    folded: bool = False


_SPEED = Variable("dq{}", ("rad/s", "m/s"), lambda x, j, p: x.dq[:, j])
_TORQUE = Variable("tau{}", ("N m", "N"), lambda x, j, p: x.tau[:, j])
_RATE = Variable("rate of change of tau{}", ("N m/s", "N/s"), lambda x, j, p: x.rate[:, j])
_POSITION = Variable("q{}", ("rad", "m"), lambda x, j, p: x.q[:, j])
_ALONG = Variable("q{}", ("rad", "m"), lambda x, j, p: x.q[:, j], folded=True)
_CYCLE = Variable(
    "q{} within one cycle", ("rad", "m"), lambda x, j, p: np.mod(x.q[:, j], 2 * np.pi / max(abs(p["n"]), 1e-9))
)
_LAW_TORQUE = Variable("torque that the law adds on joint {}", ("N m", "N"), lambda x, j, p: x.law[:, j])

VARIABLES = {
    "coulomb_asymmetry": _SPEED,
    "torque_offset": _SPEED,
    "stribeck": _SPEED,
    "quadratic_drag": _SPEED,
    "cubic_drag": _SPEED,
    "viscous_asymmetry": _SPEED,
    "gear_efficiency": _TORQUE,
    "position_dependent_friction": _ALONG,
    "friction_warmup": Variable("t", ("s", "s"), lambda x, j, p: x.t, folded=True),
    "torque_gain": _TORQUE,
    "actuator_lag": _RATE,
    "actuator_delay": _RATE,
    "torque_saturation": _TORQUE,
    "torque_dead_zone": _TORQUE,
    "torque_ripple": _CYCLE,
    "joint_spring": _POSITION,
    "hardening_spring": _POSITION,
    "external_pulse": Variable("t", ("s", "s"), lambda x, j, p: x.t),
    "contact": _POSITION,
    "rotor_inertia": Variable("ddq{}", ("rad/s^2", "m/s^2"), lambda x, j, p: x.ddq[:, j]),
}
"""Variable over which evidence of each effect is drawn; effects not listed are drawn over the torque that their law adds."""


def laws(data: dict[str, Any], arm: Arm, training: Sequence[Log], held: Sequence[Log]) -> list[Law]:
    """Return, for each cause of a diagnosis, its fitted law and the residual torques that support it.

    Parameters
    ----------
    data : dict
        Diagnosis as a JSON object.
    arm : Arm
        Nominal model.
    training, held : sequence of Log
        Training and holdout logs. Evidence is taken from the holdout; for a cause that belongs to one log,
        from that log.

    Returns
    -------
    list of Law
        One per cause.
    """
    model = Hypothesis.of(data, arm)
    return [_law(model, cause, _evidence_logs(cause, training, held)) for cause in model.effects]


def _evidence_logs(cause: EffectInstance, training: Sequence[Log], held: Sequence[Log]) -> list[Log]:
    return list(held) if cause.log is None else [log for log in (*training, *held) if _is_in(log, cause)]


def _is_in(log: Log, effect: EffectInstance) -> bool:
    """Return whether an effect acts in a log, or in the whole log that `log` is a part of."""
    return effect.log is None or log.name in (effect.log, f"{effect.log} (first part)", f"{effect.log} (last part)")


def _law(model: Hypothesis, cause: EffectInstance, logs: Sequence[Log]) -> Law:
    effect, joint, values = cause[:3]
    points, windows, failures = _points(model, cause, logs)
    entry: Law = {"effect": effect, "joint": joint, "windows": windows, "failed": len(failures)}
    if failures:
        entry["why"] = failures[0]
    if cause.log is not None:
        entry["log"] = cause.log
    if points is None:
        return entry
    shown = joint - 1 if joint is not None else _most_moved(points)
    moves = _moves(points.dq[:, shown])
    if np.count_nonzero(moves) < _MIN_MOVING_SAMPLES:
        return entry  # too few samples in motion for means
    variable = VARIABLES.get(effect, _LAW_TORQUE)
    if not np.any(points.law[moves, shown]):
        return entry  # the law adds nothing to these logs
    x = variable.value(points, shown, values)[moves]
    sign = np.sign(points.dq[moves, shown]) if variable.folded else np.ones(len(x))
    y, law = sign * points.residual[moves, shown], sign * points.law[moves, shown]
    rotary = model.arm.rotary
    bins = _bins(x, y, law, points.window[moves])
    pick = np.linspace(0, len(x) - 1, min(POINTS, len(x))).astype(int)
    return {
        **entry,
        "shown_joint": shown + 1,
        "variable": variable.name.format(shown + 1),
        "unit": variable.units[not rotary],
        "torque_unit": "N m" if rotary else "N",
        "folded": variable.folded,
        "at_rest": float(f"{1 - np.mean(moves):.3g}"),
        "bins": bins,
        "explained": _explained(bins),
        "points": {"x": _short(x[pick]), "y": _short(y[pick])},
    }


def _moves(dq: Array) -> NDArray[np.bool_]:
    """Return a mask of the samples in which each joint moves."""
    speed = np.abs(dq)
    return np.asarray(speed > _REST_SPEED_RATIO * np.quantile(speed, 0.99))


def _most_moved(points: EvidenceSamples) -> int:
    """Return the joint whose torque the law changes most, relative to the residual torque that the law does not explain."""
    scale = np.sqrt(np.mean((points.residual - points.law) ** 2, axis=0)) + 1e-300
    return int(np.argmax(np.sqrt(np.mean(points.law**2, axis=0)) / scale))


def _points(
    model: Hypothesis, cause: EffectInstance, logs: Sequence[Log]
) -> tuple[EvidenceSamples | None, int, list[str]]:
    """Return the samples of a cause's torque law from windows over all logs, their number, and why other windows failed."""
    found: list[EvidenceSamples] = []
    failed: list[str] = []
    whole = sum(log.duration for log in logs)
    for log in logs:
        wanted = max(1, round(_MAX_EVIDENCE_WINDOWS * log.duration / whole))
        try:
            comparison = _CauseComparison(model, cause, log)
        except ValueError as error:
            failed += wanted * [str(error)]
            continue
        for first in comparison.starts(wanted):
            try:
                found.append(comparison.window(first))
            except ValueError as error:
                failed.append(str(error))
    if not found:
        return None, 0, failed
    numbered = [replace(p, window=np.full(len(p.t), float(i))) for i, p in enumerate(found)]
    joined = {f.name: np.concatenate([getattr(p, f.name) for p in numbered]) for f in fields(EvidenceSamples)}
    return EvidenceSamples(**joined), len(found), failed


class _CauseComparison:
    """Simulation of one log with and without one cause."""

    def __init__(self, model: Hypothesis, cause: EffectInstance, log: Log) -> None:
        rest = [e for e in model.effects if e is not cause and _is_in(log, e)]
        self.half = max(HALF_SAMPLES, round(HALF_S / log.sample_period))
        self.log = log
        self.without = _ModelledLog(model, rest, log, self.half)
        self.full = _ModelledLog(model, [*rest, cause], log, self.half)
        self.dq = self.full.dq
        self.rate = np.gradient(log.tau, log.t, axis=0)
        self.around = _around(cause, log)

    def starts(self, wanted: int) -> list[int]:
        """Return the first rows of windows spread over the log; rows that evidence is taken from do not overlap."""
        first, last = self.around
        last -= 6 * self.half + 1
        fitting = (last - first) // (4 * self.half + 1) + 1
        return [int(k) for k in np.linspace(first, last, min(wanted, fitting))] if last >= first else []

    def window(self, first: int) -> EvidenceSamples:
        rows = slice(first, first + 6 * self.half + 1)
        log = self.log
        without, full = self.without.predict(rows), self.full.predict(rows)
        inner = np.arange(self.half, 5 * self.half + 1)
        at = first + inner
        inertia = self.without.model.inertia(self.full.q[at])
        curvature = _curvature(log.t[rows], np.hstack([log.q[rows] - without, full - without, log.q[rows]]), inner)
        n = log.n_joints
        residual, law = (np.einsum("kij,kj->ki", inertia, curvature[:, s : s + n]) for s in (0, n))
        return EvidenceSamples(
            t=log.t[at],
            window=np.zeros(len(at)),
            q=log.q[at],
            dq=self.dq[at],
            ddq=curvature[:, 2 * n :],
            tau=log.tau[at],
            rate=self.rate[at],
            residual=residual,
            law=law,
        )


def _around(cause: EffectInstance, log: Log) -> tuple[int, int]:
    """Return the range of rows that evidence is taken from: all, or those around an event."""
    if "time" not in cause.parameters:
        return 0, len(log)
    middle, reach = cause.parameters["time"], EVENT * max(cause.parameters["duration"], EVENT_S)
    first, last = np.searchsorted(log.t, [middle - reach, middle + reach])
    return int(first), int(last)


class _ModelledLog:
    """A log with the signals of one model: torque at the joints, true positions and velocities."""

    def __init__(self, model: Hypothesis, effects: Sequence[EffectInstance], log: Log, half: int) -> None:
        commanded = [e for e in effects if e.effect in ON_COMMAND]
        self.model = model.only([e for e in effects if e.effect not in ON_COMMAND])
        self.t = log.t
        self.tau = delivered(log.t, log.tau, commanded)
        self.q = true_positions(log.q, [e for e in effects if e.effect in ON_ENCODER])
        self.dq = _native.velocity(np.ascontiguousarray(log.t), np.ascontiguousarray(self.q), "local-cubic", half)

    def predict(self, rows: slice) -> Array:
        """Return predicted positions as the encoders show them [rad or m], shape (n_rows, n_joints)."""
        t = self.t[rows]
        return self.model.run(t, self.tau[rows], self.q[rows.start], self.dq[rows.start])[0]


def _curvature(t: Array, x: Array, at: NDArray[np.intp]) -> Array:
    """Return second derivatives of the columns of `x` at rows `at`, from local cubics; shape (n_at, n_columns)."""
    half = int(at[0])
    near = at[:, None] + np.arange(-half, half + 1)
    span = t[-1] - t[0]
    s = (t[near] - t[at][:, None]) / span
    fit = np.linalg.pinv(s[..., None] ** np.arange(4))
    return np.asarray(2.0 * np.einsum("kr,krc->kc", fit[:, 2, :], x[near]) / span**2)


def _bins(x: Array, y: Array, law: Array, window: Array) -> LawBins:
    """Return means of torques over ranges of the variable `x`, with the 95 % half width of each mean.

    The ranges lie halfway between equally wide and equally full ones; sparse ones are left out, but their samples
    are still drawn as points.
    """
    low, high = np.quantile(x, [0.005, 0.995])
    bins = min(BINS, len(x) // FEWEST)
    share = np.linspace(0.0, 1.0, bins + 1)
    edges = (low + (high - low) * share + np.quantile(np.clip(x, low, high), share)) / 2
    owner = np.digitize(x, edges[1:-1])
    parts = [p for b in range(bins) if len(p := np.flatnonzero(owner == b)) >= FEWEST]
    means = [_short(float(np.mean(v[p])) for p in parts) for v in (x, y, law)]
    rest = y - law
    alone = float(np.std(rest))
    error = _short(NORMAL_95 * (_cluster_sigma(rest[p], window[p]) or alone) for p in parts)
    return {"x": means[0], "mean": means[1], "error": error, "law": means[2]}


def _cluster_sigma(rest: Array, window: Array) -> float | None:
    """Return the standard deviation of a mean whose samples are correlated within windows; None for one window.

    Neighbours within a window share the measurement noise, so each window counts once (the sandwich estimate for
    clusters). The law, which varies within a range, is subtracted first.
    """
    _, owner = np.unique(window, return_inverse=True)
    sums = np.bincount(owner, rest - rest.mean())
    groups = len(sums)
    if groups < 2:
        return None
    return math.sqrt(groups / (groups - 1) * float(np.sum(sums**2))) / len(rest)


def _explained(bins: LawBins) -> float:
    """Return the share of the mean square of the binned data that the law explains."""
    mean, law = np.array(bins["mean"]), np.array(bins["law"])
    whole = float(np.sum(mean**2))
    return float(f"{1.0 - float(np.sum((mean - law) ** 2)) / whole:.4g}") if whole > 0 else 0.0


def _short(values: Iterable[float]) -> list[float]:
    return [float(f"{v:.5g}") for v in values]
