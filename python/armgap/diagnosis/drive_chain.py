"""The gap along the chain command -> drive -> transmission -> mechanics -> sensor, from logs that hold further signals along the chain.

Measured signals replace inputs and outputs of the model: the measured torque `tau_meas` of a joint replaces the commanded torque, which
removes the drive from the prediction, and the position `q_link` of a second encoder replaces that of the first, which removes the
transmission. The arm's parameters are re-estimated each time. With S the signals in use and E_j(S) the RMS error that is left at joint j,

    whole gap             E2 = sum_j E_j()^2, nothing replaced
    drive, transmission   decrease of sum_j E_j(S)^2 by the replacement of the joint's signal, over E2; signals are replaced one by one, or those of
                          one kind on all joints together where that decreases it further, the largest decrease first, as long as it is at
                          least `LEAST_SHARE` of E2
    sensor                min(floor_j, E_j(S))^2 / E2 at the end, with the error `floor_j` that the sensors' own noise makes, and what the
                          second encoder takes from the gap where the difference of both is an error of an encoder
    mechanics             (E_j(S)^2 - floor_j^2) / E2 at the end, where that is above zero

so that all shares lie between 0 and 1 and add up to 1. E_j is the error of predictions over the horizon on the holdout; of serial arms, the root of
the part of a joint's mean square torque that the equation of motion leaves, in all logs, without a floor.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, NotRequired, TypedDict

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.check.contradiction import Refit
from armgap.check.serial import weak_form
from armgap.diagnosis.drive import Drive
from armgap.diagnosis.encoders import error_of_encoder
from armgap.literals import ChainStage
from armgap.log.log import Log
from armgap.progress import report_progress

__all__ = ["LEAST_SHARE", "ChainEntry", "drive_chain"]

Array = NDArray[np.float64]

LEAST_SHARE = 0.05
"""Share of the gap from which a stage is listed, and a measured signal used; on 12 sets of simulated logs ideal drives have up to 0.04 by chance."""

# Weight of the sample at the end of an interval in the measured torque over the interval: held, linear, or measured before the new command.
_HELD, _STRAIGHT, _ENDED = 0.0, 0.5, 1.0
# Delay of a drive, in sample periods, below which it counts as none: samples do not show at which time between them a measured torque changes.
_AT_ONCE = 0.6
# Difference of the positions of the two encoders, as a part of the motion, below which the second encoder shows nothing of a transmission.
_MIN_ENCODER_DIFFERENCE = 1e-9


class ChainValue(TypedDict):
    """A parameter of an identified drive: value, standard deviation and unit."""

    value: float
    sigma: Annotated[float, "Standard deviation."]
    unit: str


class ChainEntry(TypedDict):
    """Share of the gap that arises in one stage of the drive chain at one joint."""

    stage: ChainStage
    joint: int
    share: Annotated[
        float,
        "Share of the squared gap with re-estimated parameters; those of all stages and joints add up to 1 at most.",
    ]
    detail: Annotated[str, "What it rests on, in words."]
    parameters: NotRequired[Annotated[dict[str, ChainValue], "Of a drive: delay, gain, offset, viscous and inertia."]]


@dataclass(frozen=True)
class _Signal:
    """A measured signal that can replace a signal of the model: at the end of the drive or of the transmission of a joint (from 0).

    A measured torque is known at its samples only. Over an interval it may be the torque at the start, as a held command, the mean of
    both ends, or the torque at the end, as a current measured before the new command: `after` is the weight of the end, 0, 0.5 or 1. The
    choices differ by up to a sample period, which is more than the delay of many drives.
    """

    stage: ChainStage
    joint: int
    after: float = 0.5

    def into(self, log: Log) -> Log:
        """Return the log with this measured signal in place of the model's signal."""
        if self.stage == "transmission":
            assert log.q_link is not None
            q = log.q.copy()
            # The zeros of two encoders are seldom equal: their mean difference is no deflection.
            q[:, self.joint] = log.q_link[:, self.joint] - np.mean(log.q_link[:, self.joint] - q[:, self.joint])
            return replace(log, q=q)
        assert log.tau_meas is not None
        tau, moment = log.tau.copy(), np.zeros_like(log.tau) if log.moment is None else log.moment.copy()
        sample = log.tau_meas[:, self.joint]
        later = np.append(sample[1:], sample[-1])
        interval = np.append(np.diff(log.t), log.sample_period)
        tau[:, self.joint] = (1.0 - self.after) * sample + self.after * later
        moment[:, self.joint] = (later - sample) * interval**2 / 12.0 if self.after == _STRAIGHT else 0.0
        return replace(log, tau=tau, moment=moment)


@dataclass(frozen=True)
class _Case:
    """Arm and logs of a drive-chain analysis, with the remaining gap for sets of measured signals."""

    arm: Arm
    training: Sequence[Log]
    holdout: Sequence[Log]
    horizon: float

    def left(self, signals: Sequence[_Signal]) -> Array:
        """Return the squared errors E_j(S)^2 with the measured signals S in use, shape (n_joints,)."""
        training, holdout = ([_with(log, signals) for log in logs] for logs in (self.training, self.holdout))
        if self.arm.chain is None:
            error = Refit.of(self.arm, training, holdout, self.horizon).error
            return np.nan_to_num(error**2, nan=np.inf, posinf=np.inf)
        found = weak_form.fit([*training, *holdout], self.arm)
        return np.zeros(self.arm.n_joints) if found is None else np.nan_to_num(np.maximum(found.share, 0.0))

    def signals(self) -> Iterator[_Signal]:
        """Yield the measured signals that all logs hold besides command and position; none if a log holds references in place of torques."""
        logs = [*self.training, *self.holdout]
        if not all(log.has_torques for log in logs):
            return
        for j in range(self.arm.n_joints):
            if all(log.tau_meas is not None for log in logs) and any(
                not np.array_equal(log.tau[:, j], log.tau_meas[:, j]) for log in logs if log.tau_meas is not None
            ):
                yield from (_Signal("drive", j, after) for after in (_HELD, _STRAIGHT, _ENDED))
            if all(log.q_link is not None for log in logs) and any(
                np.ptp(log.q_link[:, j] - log.q[:, j]) > _MIN_ENCODER_DIFFERENCE * np.ptp(log.q[:, j])
                for log in logs
                if log.q_link is not None
            ):
                yield _Signal("transmission", j)


def _with(log: Log, signals: Sequence[_Signal]) -> Log:
    for signal in signals:
        log = signal.into(log)
    return log


def drive_chain(
    arm: Arm, training: Sequence[Log], holdout: Sequence[Log], *, horizon: float, floor: Sequence[float]
) -> list[ChainEntry]:
    """Return the share of the gap that arises at each stage of the chain from command to measured position.

    Parameters
    ----------
    arm : Arm
        Nominal model.
    training, holdout : sequence of Log
        Logs of the arm.
    horizon : float
        Prediction horizon [s].
    floor : sequence of float, shape (n_joints,)
        RMS errors of a perfect model on the holdout [rad or m]; not used for serial arms.

    Returns
    -------
    list of ChainEntry
        Stages with at least `LEAST_SHARE` of the gap, and every drive that could be identified, the largest share first; empty where the logs hold
        neither measured torques nor positions on the link's side for every joint, or predictions diverge.
    """
    case = _Case(arm, training, holdout, horizon)
    signals = list(case.signals())
    if not signals:
        return []
    driven = dict.fromkeys(s.joint for s in signals if s.stage == "drive")
    drives = {joint: Drive.identify(training, joint) for joint in driven}
    gains, left, whole = _replaced(case, signals)
    if not np.isfinite(whole):
        return []  # diverging predictions give no measure of the gap
    noise = np.minimum(np.zeros(arm.n_joints) if arm.chain is not None else np.square(floor), left)
    shares: dict[tuple[ChainStage, int], float] = {
        **{(s.stage, s.joint): 0.0 for s in signals},
        **{(s.stage, s.joint): gain for s, gain in gains.items()},
        **{("mechanics", j): float(left[j] - noise[j]) / whole for j in range(arm.n_joints)},
        **{("sensor", j): float(noise[j]) / whole for j in range(arm.n_joints)},
    }
    used = {(s.stage, s.joint) for s in gains}
    errors = _of_encoders(shares, used, [*training, *holdout])
    entries = [
        _entry(case, stage, joint, share, (stage, joint) in used, drives.get(joint) if stage == "drive" else None)
        for (stage, joint), share in shares.items()
    ]
    for entry in entries:
        if entry["stage"] == "sensor" and (error := errors.get(entry["joint"] - 1)):
            entry["detail"] = (
                f"{error}; with the position of the second one in place of the first predictions miss by that much less"
            )
    return sorted(
        (e for e in entries if e["share"] >= LEAST_SHARE or "parameters" in e), key=lambda e: e["share"], reverse=True
    )


def _of_encoders(
    shares: dict[tuple[ChainStage, int], float], used: set[tuple[ChainStage, int]], logs: Sequence[Log]
) -> dict[int, str]:
    """Give the sensor of a joint what the second encoder takes from the gap, where an encoder is in error; return these errors in words, by joint."""
    found = {}
    for stage, joint in used:
        if stage == "transmission" and (error := error_of_encoder(logs, joint)):
            found[joint] = error
            shares["sensor", joint] += shares["transmission", joint]
            shares["transmission", joint] = 0.0
    return found


def _replaced(case: _Case, signals: Sequence[_Signal]) -> tuple[dict[_Signal, float], Array, float]:
    """Return the reduction of the gap by each measured signal in use, the remaining squared errors, and the whole gap."""
    left = case.left(())
    whole = max(float(left.sum()), float(np.finfo(float).tiny))
    gains: dict[_Signal, float] = {}
    rest = list(signals)
    while rest:
        report_progress("comparing the stages of the chain", 1.0 - len(rest) / len(signals))
        used = tuple(gains)
        one = _best(case, used, [(signal,) for signal in rest])
        found = _best(case, used, list(_together(rest)), one, LEAST_SHARE * whole)
        if left.sum() - found[1].sum() < LEAST_SHARE * whole:
            break
        gains |= _by_joint(found[0], left, found[1], whole)
        left = found[1]
        rest = [s for s in rest if all((s.stage, s.joint) != (u.stage, u.joint) for u in found[0])]
    return gains, left, whole


def _together(signals: Sequence[_Signal]) -> Iterator[tuple[_Signal, ...]]:
    """Yield the signals of one kind on all joints that still have one: a delay that all drives share is none beside the other drives' commands."""
    for stage, after in dict.fromkeys((s.stage, s.after) for s in signals):
        alike = tuple(s for s in signals if (s.stage, s.after) == (stage, after))
        if len(alike) > 1:
            yield alike


_Found = tuple[tuple[_Signal, ...], Array]


def _best(
    case: _Case,
    used: tuple[_Signal, ...],
    sets: Sequence[tuple[_Signal, ...]],
    known: _Found | None = None,
    margin: float = 0.0,
) -> _Found:
    """Return the signals of `sets` that leave least beside those in use, and what is left; `known` unless they leave less by `margin`."""
    tried = [(signals, case.left((*used, *signals))) for signals in sets]
    best = min(tried, key=lambda found: float(found[1].sum()), default=known)
    assert best is not None
    return known if known is not None and best[1].sum() > known[1].sum() - margin else best


def _by_joint(signals: Sequence[_Signal], before: Array, after: Array, whole: float) -> dict[_Signal, float]:
    """Return the part of the whole gap that signals remove together, by signal: in proportion to what is removed at their joints."""
    gain = float(before.sum() - after.sum()) / whole
    removed = np.array([max(before[s.joint] - after[s.joint], 0.0) for s in signals])
    parts = removed / removed.sum() if removed.sum() > 0.0 else np.full(len(signals), 1.0 / len(signals))
    return {signal: gain * float(part) for signal, part in zip(signals, parts, strict=True)}


def _entry(case: _Case, stage: ChainStage, joint: int, share: float, used: bool, drive: Drive | None) -> ChainEntry:
    entry: ChainEntry = {
        "stage": stage,
        "joint": joint + 1,
        "share": share,
        "detail": _detail(case, stage, joint, used),
    }
    if drive is None:
        return entry
    rotary = case.arm.rotary_joints[joint]
    return {
        **entry,
        "detail": f"{_follows(drive, case, rotary)}; {entry['detail']}",
        "parameters": drive.parameters(rotary=rotary),
    }


def _detail(case: _Case, stage: ChainStage, joint: int, used: bool) -> str:
    """Return in words the basis on which a stage's share of the gap was computed."""
    what = "predictions" if case.arm.chain is None else "the arm's torques"
    match stage:
        case "drive" if used:
            return f"with the measured torque of joint {joint + 1} in place of the commanded one {what} miss by that much less"
        case "drive":
            return f"with the measured torque of joint {joint + 1} in place of the commanded one {what} miss by no less that counts"
        case "transmission":
            return f"with the position of joint {joint + 1} on the link's side in place of the first {what} miss by that much less"
        case "mechanics":
            return f"what {what} still miss at joint {joint + 1} with the measured signals in use"
        case "sensor":
            return f"what noise of the sensors alone makes {what} miss at joint {joint + 1}"


def _follows(drive: Drive, case: _Case, rotary: bool) -> str:
    """Return a drive in words, with its parameters and its accuracy on the holdout."""
    delay, gain, _, _, inertia = drive.values
    apart, left = drive.left(case.holdout)
    worth = 1.0 - (left / apart) ** 2 if apart > 0 else 0.0
    unit = "kg m^2" if rotary else "kg"
    late = (
        f"{1e3 * delay:.3g} ms late"
        if delay >= 0
        else f"{-1e3 * delay:.3g} ms early, which is a matter of the file or of a filter"
    )
    if abs(delay) < _AT_ONCE * case.training[0].sample_period:
        late = "within the period of a sample"
    return (
        f"the measured torque follows the commanded one {late}, with a gain of {gain:.3g} and a part of {-inertia:.2g} {unit} times acceleration; "
        f"on the holdout that explains {100 * max(worth, 0.0):.0f} % of the squared difference between the two"
    )
