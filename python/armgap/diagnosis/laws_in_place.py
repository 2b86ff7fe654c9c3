"""Laws that no effect of the library has, in place of the pushes, lags and delays of a diagnosis.

A drive that changes its torque at a limited rate, delivers less at speed, or has another limit in either direction does at certain times what a push
does, again and again, and so does friction that rises in places. Three tests tell them from pushes, with one or two values
against three for every push:

* *equation of motion*: behind a law of the drive hardly any torque is left unexplained. It finds laws that act most of the time, of which the pushes
  are the largest events only, and those that pass for a lag.
* *impulses*: the torque that such a law takes from the command within the pushes has their impulses, acts when they act, and is small elsewhere.
* *direction*: friction acts against the motion and with one torque, and pushes in either direction and with any.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.check.drive_limit import LIMITED, TAKEN
from armgap.check.equation_error import FEWEST_ROWS, EquationError, Mask, Rows, bounds
from armgap.diagnosis.drive_laws import WORDS, DriveLaw, all_laws, frequent_laws, speed
from armgap.diagnosis.equivalents import beside
from armgap.evidence.hypothesis import EffectInstance, delivered
from armgap.log.log import Log
from armgap.log.stretches import STRETCH

__all__ = ["LawInPlace", "doubt", "laws_in_place", "say_withheld", "withheld"]

Array = NDArray[np.float64]

#: Share of the pushes' squared impulses, those that the law gives elsewhere added, up to which a law of the drive explains the pushes. On simulated
#: arms of another hand it was 0.001 to 0.36 for 14 of 18 such drives, and 0.67 or more for 47 pushes in 27 groups, 37 of them drawn after the test
#: was made (docs/decisions/065-asked-once-more.md).
LEFT_OF_IMPULSES = 0.4
#: Share of the squared torque that a joint lacks during its pushes up to which a law of the drive explains the pushes. On simulated arms of another
#: hand it was at most 0.03 for 8 drives of limited rate, and 0.16 to 0.54 for limits that had the impulses of 11 groups of pushes under a controller.
LEFT_OF_TORQUE = 0.1
#: Largest part of that torque that counts as noise, as is usual outside of the pushes.
_LARGEST_NOISE = 0.9
#: Probability below which a cause is not named (as in the compiled core).
NAMEABLE = 0.3
#: Probability of a push beside a law of the drive that explains it, as a part of its probability without it, for every push on the joint: pushes come
#: at any time.
_AS_LIKELY = 0.5
#: Factor on the chance that as many pushes act against the motion: three pushes are not doubted for that, and four not withheld.
_SEVERAL = 8.0
#: Median deviation of the pushes' mean torques, relative to their median, up to which they have one torque. In rough ranges of six simulated bearings
#: of another hand it was 0.01 or 0.02; of four and more pushes on four arms, which all happened to act against the motion, 0.07 to 0.15.
_SAME_TORQUE = 0.05
#: Part of the mean speed within a push that its mean velocity must have for the push to act with or against the motion.
_IN_ONE_DIRECTION = 0.5
#: Time constants of the filters for which rows of the equation of motion remember a push.
_FILTER_MEMORY = 4.0
#: Shortest half width of the stretch around a push in which a law's impulse is taken [s].
_REACH_S = 0.03
#: Effects of the library that limit the torque of a drive.
_LIMITS_NAMED = ("torque_saturation", "torque_dead_zone")
#: Causes that a limited drive resembles besides pushes.
_LATE = ("actuator_lag", "actuator_delay")


@dataclass(frozen=True)
class LawInPlace:
    """A law on one joint that explains what a diagnosis calls pushes, a lag or a delay.

    Attributes
    ----------
    name : str
        Name of the law in results.
    joint : int
        The joint, from 1.
    why : str
        What the law does instead, in words.
    factor : float
        Probability of what the law explains, as a part of its probability without the law, 0 to 1.
    throughout : bool
        Whether the equation of motion has told the law, so that it stands for a lag or delay too.
    """

    name: str
    joint: int
    why: str
    factor: float
    throughout: bool = False

    def explains(self, cause: dict[str, Any]) -> bool:
        """Whether a cause of a diagnosis is one that the law explains."""
        joints = cause.get("joints") or [cause["joint"]]
        return self.joint in joints and ("log" in cause or (self.throughout and cause["effect"] in _LATE))


def laws_in_place(data: dict[str, Any], logs: Sequence[Log], arm: Arm) -> list[LawInPlace]:
    """Return the laws that explain pushes, lags and delays of a diagnosis of a planar arm, one per joint at most.

    Parameters
    ----------
    data : dict
        Diagnosis as a JSON object.
    logs : sequence of Log
        All its logs.
    arm : Arm
        Nominal model.
    """
    if arm.chain is not None or not all(log.has_torques for log in logs):
        return []
    names = {log.name for log in logs}
    found = []
    for joint in range(1, arm.n_joints + 1):
        causes = [_of_whole_log(c, names) for c in data["causes"] if joint in (c.get("joints") or [c["joint"]])]
        pushes = [c for c in causes if c.get("log") in names]
        late = any(c["effect"] in _LATE for c in causes)
        law = _by_equation(causes, logs, arm, joint) if pushes or late else None
        if law is None and pushes:
            # What a law takes, it takes behind the limits that are named.
            behind = [_behind(log, causes, joint, _LIMITS_NAMED) for log in logs]
            law = _by_impulses(pushes, causes, behind, arm, joint) or _by_direction(pushes, logs, arm, joint)
        if law is not None:
            found.append(law)
    return found


def _of_whole_log(cause: dict[str, Any], names: Collection[str]) -> dict[str, Any]:
    """Return a cause with the name of a whole log in place of that of its stretch (``name (0.0 to 2.5 s)``), whose times are those of the log."""
    name = cause.get("log")
    return cause if name is None or name in names else cause | {"log": STRETCH.sub("", name)}


def doubt(data: dict[str, Any], laws: Sequence[LawInPlace]) -> None:
    """Add laws to the equivalents of the causes that they explain, and lower these causes' probabilities."""
    for law in laws:
        for cause in data["causes"]:
            if law.explains(cause):
                cause["probability"] *= law.factor
                cause["equivalents"].append(beside(law.name, law.joint, law.why, separates=True))


def withheld(data: dict[str, Any], laws: Sequence[LawInPlace]) -> list[tuple[str, int | None, str]]:
    """Return the causes that are not to be named beside the laws: effect, joint (from 1) and reason, each once.

    Pushes on a joint are one cause here, as probable as the most probable of them.
    """
    found: dict[tuple[str, int | None], tuple[float, str]] = {}
    for law in laws:
        if law.name in WORDS:
            # Without the pushes a lag or delay would take up what such a drive does.
            found |= {(effect, law.joint): (0.0, law.why) for effect in _LATE if not _named(data, effect, law.joint)}
        for cause in data["causes"]:
            if law.explains(cause):
                key, probability = (cause["effect"], cause["joint"]), cause["probability"] * law.factor
                found[key] = max(found.get(key, (0.0, "")), (probability, law.why))
    apart = [(*key, why) for key, (probability, why) in found.items() if probability < NAMEABLE]
    return apart if any(_named(data, effect, joint) for effect, joint, _ in apart if joint is not None) else []


def say_withheld(data: dict[str, Any], apart: Sequence[tuple[str, int | None, str]]) -> None:
    """Add what is in the place of withheld causes to the notes; without a named cause such a law is what no effect explains."""
    found = {(c["effect"], c["joint"]) for c in data["candidates"]}
    said = {(joint, why) for effect, joint, why in apart if (effect, joint) in found}
    data["notes"] = [
        *data["notes"],
        *(f"no push, lag or delay of joint {joint} is named: {why}" for joint, why in sorted(said)),
    ]
    if said and not data["causes"] and data["verdict"] in ("none", "parameters"):
        data["verdict"] = "unexplained"


def _named(data: dict[str, Any], effect: str, joint: int) -> bool:
    """Whether a diagnosis names an effect, or pushes, on a joint."""
    return any(cause["effect"] == effect and cause["joint"] == joint for cause in data["causes"])


def _values(push: dict[str, Any]) -> tuple[float, float, float]:
    """Return time [s], duration [s] and impulse [N m s or N s] of a push."""
    time, duration, impulse = (float(push["parameters"][key]["value"]) for key in ("time", "duration", "impulse"))
    return time, duration, impulse


def _unit(arm: Arm, joint: int) -> str:
    return "N m" if arm.rotary_joints[joint - 1] else "N"


def _by_equation(causes: Sequence[dict[str, Any]], logs: Sequence[Log], arm: Arm, joint: int) -> LawInPlace | None:
    """Return the law of the drive behind which the equation of motion leaves hardly any of a joint's unexplained torque, and less than the causes do.

    The causes on the joint leave what is unexplained outside of the pushes, with the torque that lags and delays deliver. None without such a law.
    """
    j = joint - 1
    rows = [Rows.of(log, arm) for log in logs]
    moving = [r.moving(log) for r, log in zip(rows, logs, strict=True)]
    base = EquationError([r.within(mask) for r, mask in zip(rows, moving, strict=True)], arm)
    if len(base) < FEWEST_ROWS:
        return None
    low, high = bounds(arm)

    def unexplained(errors: EquationError) -> float:
        return float(errors.fit(low, high).share[j] * errors.scale[j])

    def with_torques(torques: Sequence[Array], masks: Sequence[Mask]) -> list[Rows]:
        changed = zip(rows, masks, logs, torques, strict=True)
        return [r.with_torque(log, j, x).within(mask) for r, mask, log, x in changed]

    def behind(law: DriveLaw) -> float:
        torques = [log.tau[:, j] + x for log, x in zip(logs, law.added, strict=True)]
        return unexplained(base.with_rows(with_torques(torques, moving), j))

    whole = max(unexplained(base), 1e-30)
    outside = [mask & _outside(log, r, causes)[:, None] for mask, log, r in zip(moving, logs, rows, strict=True)]
    delivers = [_behind(log, causes, joint, _LATE).tau[:, j] for log in logs]
    # Mean squares over all rows, of which those within pushes count as explained.
    left_by_causes = unexplained(EquationError(with_torques(delivers, outside), arm))
    left, law = min(((behind(law), law) for law in frequent_laws(logs, j)), key=lambda found: found[0])
    if left >= min(LIMITED * whole, TAKEN * left_by_causes):
        return None
    words = law.in_words(_unit(arm, joint))
    said = f"{words}: behind it {left / whole:.1%} of the joint's unexplained torque is left, and it comes back with the motion"
    return LawInPlace(law.name, joint, said, left / whole, throughout=True)


def _outside(log: Log, rows: Rows, causes: Sequence[dict[str, Any]]) -> Mask:
    """Return a mask of the rows of a log that remember none of its pushes."""
    t = log.t[rows.samples]
    outside = np.ones(len(t), dtype=bool)
    for cause in causes:
        if cause.get("log") == log.name:
            time, duration, _ = _values(cause)
            outside &= (t < time - 0.5 * duration) | (t > time + 0.5 * duration + _FILTER_MEMORY / rows.cutoff)
    return outside


def _behind(log: Log, causes: Sequence[dict[str, Any]], joint: int, effects: Sequence[str]) -> Log:
    """Return a log with the torque of one joint that the drive delivers with those of the named `effects` that act on it."""
    named = [
        EffectInstance(c["effect"], joint, {name: p["value"] for name, p in c["parameters"].items()})
        for c in causes
        if c["effect"] in effects
    ]
    return replace(log, tau=delivered(log.t, log.tau, named)) if named else log


def _by_impulses(
    pushes: Sequence[dict[str, Any]], causes: Sequence[dict[str, Any]], logs: Sequence[Log], arm: Arm, joint: int
) -> LawInPlace | None:
    """Return the law of the drive that gives the impulses of the pushes on one joint, when they act, and little elsewhere; None if there is none.

    Under feedback a controller answers a push with the opposite impulse: a limit that cuts off this answer has the impulse of the push, but later.
    """
    j = joint - 1
    index = {log.name: i for i, log in enumerate(logs)}
    impulses = np.array([_values(push)[2] for push in pushes])
    during: list[tuple[int, NDArray[np.bool_]]] = []
    free = [np.ones(len(log), dtype=bool) for log in logs]
    reach = []
    for push in pushes:
        i = index[push["log"]]
        time, duration, _ = _values(push)
        reach.append(max(duration, _REACH_S))
        mask = np.abs(logs[i].t - time) <= reach[-1]
        during.append((i, mask))
        free[i] &= ~mask
    width = 2.0 * float(np.median(reach))
    whole = float(np.sum(impulses**2))

    def left(added: Sequence[Array]) -> float:
        given = np.array([np.sum(added[i][mask]) * logs[i].sample_period for i, mask in during])
        elsewhere = 0.0
        for log, x, mask in zip(logs, added, free, strict=True):
            count = max(round(width / log.sample_period), 1)
            sums = np.add.reduceat(np.where(mask, x, 0.0) * log.sample_period, np.arange(0, len(x), count))
            elsewhere += float(np.sum(sums**2))
        return (float(np.sum((impulses - given) ** 2)) + elsewhere) / whole

    of_impulses = [law for law in all_laws(logs, j) if left(law.added) < LEFT_OF_IMPULSES]
    left_of_torque = _left_of_torque(pushes, causes, logs, arm, joint)
    share, law = min(
        ((left_of_torque(law), law) for law in of_impulses), key=lambda found: found[0], default=(1.0, None)
    )
    if law is None or share >= LEFT_OF_TORQUE:
        return None
    words = law.in_words(_unit(arm, joint))
    said = f"{words} at the times of the pushes and hardly anything elsewhere, and comes back with the motion"
    return LawInPlace(law.name, joint, said, _AS_LIKELY ** len(pushes))


def _left_of_torque(
    pushes: Sequence[dict[str, Any]], causes: Sequence[dict[str, Any]], logs: Sequence[Log], arm: Arm, joint: int
) -> Callable[[DriveLaw], float]:
    """Return the share that a law leaves of the squared torque which one joint lacks while its pushes act.

    The torque is that of the equation of motion with parameters fitted outside of the pushes. What is usual there counts as noise, and what the law
    adds there counts as left. Zero for any law where no row is near the pushes.
    """
    j = joint - 1
    rows = [Rows.of(log, arm) for log in logs]
    moving = [r.moving(log) for r, log in zip(rows, logs, strict=True)]
    outside = [_outside(log, r, causes) for log, r in zip(logs, rows, strict=True)]
    near = [~_outside(log, r, pushes) for log, r in zip(logs, rows, strict=True)]
    clear = [mask[:, j] & free for mask, free in zip(moving, outside, strict=True)]
    base = EquationError(
        [r.within(mask & free[:, None]) for r, mask, free in zip(rows, moving, outside, strict=True)], arm
    )
    if len(base) < FEWEST_ROWS or not any(mask.any() for mask in near):
        return lambda _: 0.0
    theta = base.fit(*bounds(arm)).theta

    def squares(changed: Sequence[Rows]) -> tuple[float, float]:
        """Return the squares of the residual torque near the pushes and clear of them."""
        residual = [r.y[:, j] - r.psi[:, j, :] @ theta for r in changed]
        of = [sum(float(np.sum(x[m] ** 2)) for x, m in zip(residual, masks, strict=True)) for masks in (near, clear)]
        return of[0], of[1]

    here, there = squares(rows)
    usual = there * sum(m.sum() for m in near) / max(sum(m.sum() for m in clear), 1)
    noise = min(usual, _LARGEST_NOISE * here)

    def left(law: DriveLaw) -> float:
        torques = [log.tau[:, j] + x for log, x in zip(logs, law.added, strict=True)]
        during, elsewhere = squares([r.with_torque(log, j, x) for r, log, x in zip(rows, logs, torques, strict=True)])
        return float((max(during - noise, 0.0) + max(elsewhere - there, 0.0)) / max(here - noise, 1e-30))

    return left


def _by_direction(pushes: Sequence[dict[str, Any]], logs: Sequence[Log], arm: Arm, joint: int) -> LawInPlace | None:
    """Return friction that rises in places, if more pushes on a joint than chance explains act against its motion with one torque; else None."""
    by_name = {log.name: log for log in logs}
    against, torques = [], []
    for push in pushes:
        log = by_name[push["log"]]
        time, duration, impulse = _values(push)
        velocity = speed(log, joint - 1)[np.abs(log.t - time) <= 0.5 * duration]
        if len(velocity) and abs(velocity.mean()) > _IN_ONE_DIRECTION * np.abs(velocity).mean():
            against.append(impulse * velocity.mean() < 0.0)
            torques.append(abs(impulse) / duration)
    count, opposed = len(against), sum(against)
    # Probability that as many of the pushes or more act against the motion.
    chance = _SEVERAL * sum(comb(count, k) for k in range(opposed, count + 1)) / 2.0**count
    middle = float(np.median(torques)) if torques else 0.0
    if chance >= 1.0 or np.median(np.abs(np.array(torques) - middle)) > _SAME_TORQUE * middle:
        return None
    torque = f"{middle:.3g} {_unit(arm, joint)}"
    said = f"{opposed} of {count} pushes on the joint act against its motion, with {torque} each, as friction does that rises in places"
    return LawInPlace("uneven_friction", joint, said, chance)
