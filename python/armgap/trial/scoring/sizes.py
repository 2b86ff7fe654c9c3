"""Scores of sizes: errors of named causes' sizes, coverage of intervals, bounds of effects called absent."""

from __future__ import annotations

import math
from dataclasses import dataclass

from armgap.trial.answers import AbsentEffect, Answer, NamedCause
from armgap.trial.cases.key import HiddenEffect, Key
from armgap.trial.verdict import equivalent

__all__ = ["BoundScore", "SizeScore", "bound_scores", "size_scores"]

#: Two-sided 95 % quantile of the normal distribution, in standard deviations.
Z_95 = 1.96

#: Parameter that is the size of an effect, by name of the effect.
MAIN: dict[str, str] = {
    "coulomb_asymmetry": "delta",
    "torque_offset": "offset",
    "stribeck": "amplitude",
    "quadratic_drag": "c",
    "load_dependent_friction": "mu",
    "friction_warmup": "amplitude",
    "presliding": "amplitude",
    "joint_elasticity": "stiffness",
    "backlash": "gap",
    "torque_gain": "gain",
    "actuator_lag": "time_constant",
    "actuator_delay": "delay",
    "torque_saturation": "level",
    "torque_ripple": "amplitude",
    "torque_dead_zone": "level",
    "payload": "mass",
    "base_tilt": "angle",
    "joint_spring": "k",
    "rotor_inertia": "inertia",
    "encoder_offset": "offset",
    "contact": "position",
    "external_pulse": "impulse",
    "viscous_asymmetry": "delta",
    "cubic_drag": "c3",
    "gear_efficiency": "loss",
    "cross_friction": "level",
    "hardening_spring": "cubic",
    "rotor_coupling": "inertia",
}
#: Effects whose size is the length of a vector of two parameters, with the parameters' names.
VECTOR = {"position_dependent_friction": ("a", "b"), "encoder_eccentricity": ("a", "b")}
#: Neutral value of an effect's size parameter, for effects whose neutral value is not zero.
NEUTRAL = {"torque_gain": 1.0}


@dataclass(frozen=True)
class SizeScore:
    """Score of the size of one rightly named cause.

    Attributes
    ----------
    effect : str
        Name of the effect.
    error : float
        Difference from the hidden size, as a share of the hidden size.
    covered : bool or None
        Whether value plus and minus 1.96 sigma holds the hidden size; None without sigma.
    """

    effect: str
    error: float
    covered: bool | None


@dataclass(frozen=True)
class BoundScore:
    """Score of the bound on a hidden effect that was called absent: stated 95 % bound, and true size `truth` [SI]."""

    effect: str
    joint: int | None
    bound: float
    truth: float

    @property
    def holds(self) -> bool:
        """Whether the hidden size of the effect is within the stated 95 % bound."""
        return abs(self.truth) <= self.bound


def size_scores(answer: Answer, key: Key) -> list[SizeScore]:
    """Return scores of the sizes of causes that name a hidden effect itself, not its look-alike."""
    found = []
    for cause in answer.causes:
        hidden = [h for h in key.effects if (h.effect, h.joint) == cause.name]
        if hidden and cause.sizes and cause.effect in (MAIN.keys() | VECTOR.keys()):
            found.append(min((_size(cause, h) for h in hidden), key=lambda s: s.error))
    return found


def bound_scores(answer: Answer, key: Key) -> list[BoundScore]:
    """Return scores of the bounds of hidden effects that were called absent, without those for which an equivalent was named."""
    named = [c.name for c in answer.causes]
    found = []
    for h in key.effects:
        if any(equivalent(n, (h.effect, h.joint)) for n in named):
            continue
        limits = [x for x in answer.limits if (x.effect, x.joint) == (h.effect, h.joint)]
        found += [_bound(x, h) for x in limits if x.parameter in h.parameters]
    return found


def _size(cause: NamedCause, hidden: HiddenEffect) -> SizeScore:
    if cause.effect in VECTOR:
        return _vector(cause, hidden, VECTOR[cause.effect])
    key = MAIN[cause.effect]
    truth = _truth(hidden, key)
    stated, sigma = cause.sizes[key].value - NEUTRAL.get(cause.effect, 0.0), cause.sizes[key].sigma
    if key == "amplitude" and cause.effect == "torque_ripple":
        stated, truth = abs(stated), abs(truth)  # the sign of a ripple's amplitude can be moved into its phase
    return SizeScore(cause.effect, abs(stated - truth) / abs(truth), _covers(stated - truth, sigma))


def _truth(hidden: HiddenEffect, key: str) -> float:
    """Return the hidden size as defined by armgap's library, less its neutral value."""
    if hidden.effect == "rotor_coupling":  # the library's parameter is the inertia that the rotor adds off the diagonal
        return hidden.parameters["inertia"] * hidden.parameters["gear"]
    return hidden.parameters[key] - NEUTRAL.get(hidden.effect, 0.0)


def _vector(cause: NamedCause, hidden: HiddenEffect, keys: tuple[str, ...]) -> SizeScore:
    apart = [cause.sizes[k].value - hidden.parameters[k] for k in keys]
    covers = [_covers(d, cause.sizes[k].sigma) for d, k in zip(apart, keys, strict=True)]
    covered = None if None in covers else all(c is True for c in covers)
    truth = math.hypot(*(hidden.parameters[k] for k in keys))
    return SizeScore(cause.effect, math.hypot(*apart) / truth, covered)


def _covers(difference: float, sigma: float | None) -> bool | None:
    return None if sigma is None or sigma <= 0 else abs(difference) <= Z_95 * sigma


def _bound(limit: AbsentEffect, hidden: HiddenEffect) -> BoundScore:
    return BoundScore(hidden.effect, hidden.joint, limit.value, _truth(hidden, limit.parameter))
