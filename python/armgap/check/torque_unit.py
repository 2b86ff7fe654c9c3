"""`torque_unit`: a torque column in another unit: a motor's current, a percentage, the motor's side of a gear.

One factor per column scales it to the torques that the arm file expects. A common factor on all torques is equivalent to scaled
parameters, so only a factor of another order of magnitude is a unit; a smaller one is left to the re-estimated parameters and reported.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.arm.load import last_length, payload_change
from armgap.check.check import Check, Severity
from armgap.check.drive_limit import (
    LIMITED,
    PARAMETER_BOUND_FACTOR,
    TAKEN,
    TRIED,
    at_best_level,
    at_level,
    at_rates,
    limited,
)
from armgap.check.elastic import beside_elasticity
from armgap.check.equation_error import EquationError, Fit, bounds
from armgap.log.log import Log
from armgap.several_joints import by_joint

__all__ = ["Factors", "find", "refined", "said"]

# Range of factors on a torque that are a gain of the drive (an effect), or wrong parameters: from the inverse to this factor.
_GAIN = 2.0
# Common factor on all columns that the arm file's parameters may be off by, up or down.
_SCALED = 4.0
# Largest factor on a torque that is repaired; larger factors are no plausible unit.
_MAX_REPAIRED_FACTOR = 2e3
# Columns share a factor if their factors differ by less than this ratio.
_COMMON_FACTOR_RATIO = 1.5
# Iterations in which factors and parameters are estimated in turn.
_FACTOR_ITERATIONS = 4
# Reduction of the mean log share of unexplained torque that a factor on torques needs; with a reduction below the second number predictions have
# to agree: friction without bound takes much of a torque in another unit.
_GAIN_IN_COST = 0.2
_CLEAR_GAIN = 0.5
# Share of unexplained torque above which a joint determines no factor: noise fed back by a controller, or a stop, makes most of its torque.
_MAX_UNEXPLAINED_SHARE = 0.3
# Standard deviations of the arm file beyond which friction is not that of the arm file.
_SURE = 3.0
# Distances of a payload from the last axis that are tried: the largest, in lengths of the last link, and their number.
_FURTHEST_LOAD = 2.0
_LOAD_DISTANCES = 17
# Share of unexplained torque below which a factor is exact: remaining errors are those of the arm file's parameters.
_EXACT_FACTOR_SHARE = 1e-3


@dataclass(frozen=True)
class Factors:
    """Factors on torque columns, with the fit of the scaled torques and the checks to report.

    Attributes
    ----------
    corrections : Corrections
        Corrections with the factors.
    closeness : float
        Closeness of the fit with the factors (`Fit.closeness`).
    checks : tuple of Check
        Checks to report.
    doubtful : bool
        Whether predictions have to confirm the factors, as the equation of motion alone does not decide.
    """

    corrections: Corrections
    closeness: float
    checks: tuple[Check, ...]
    doubtful: bool = False


def find(base: EquationError, logs: Sequence[Log], arm: Arm) -> Factors | None:
    """Return the factors that scale torque columns of the logs (`base`) to the arm file, or None; saturation of a drive is no factor."""
    low, high = bounds(arm, PARAMETER_BOUND_FACTOR)
    read = _read(base, logs, arm)
    stands, base, factors = base, read.errors, read.factors
    known = read.share < _MAX_UNEXPLAINED_SHARE
    odd = [j for j, c in enumerate(factors) if known[j] and not _within(c, _GAIN)]
    if not odd or np.any(factors[known] <= 0):
        return None
    shared = len(odd) == int(known.sum()) and float(factors[known].max() / factors[known].min()) < _COMMON_FACTOR_RATIO
    if not shared and not known.all():
        return None
    applied = np.where(np.isin(np.arange(len(factors)), odd), factors, 1.0)
    if shared:
        odd = list(range(len(factors)))
        # A drive's limit is known to some percent, and the factor of a joint with a limited drive no better.
        says = known & ~read.changed if np.any(known & ~read.changed) else known
        applied = np.full(len(factors), _common(factors[says], read.share[says]))
    fit = base.with_factors(low, high, applied)
    gain = base.with_factors(low, high, np.ones_like(applied)).cost - fit.cost
    scaled = shared and _within(applied[0], _SCALED)
    if gain < (0.0 if scaled else _GAIN_IN_COST) or (scaled and _friction_stands(base, arm, applied)):
        return None
    loaded = min(_loaded(base, arm, low, high), key=lambda loaded: loaded.closeness)
    logged, other = _friction_distance(loaded, arm, applied)
    if loaded.closeness <= fit.closeness and np.sum(logged**2) <= np.sum(other**2):
        return None
    if min(limited(stands, logs, j)[1].closeness for j in odd) < fit.closeness:
        return None
    corrections, checks = _said(applied, odd, shared)
    doubtful = float(fit.share.max()) > TRIED or gain < _CLEAR_GAIN
    return Factors(corrections, fit.closeness, tuple(checks), doubtful)


def _friction_stands(base: EquationError, arm: Arm, factors: NDArray[np.float64]) -> bool:
    """Return whether friction agrees with the arm file in the torques as logged and disagrees in the scaled torques.

    A payload scales inertias and weights only, another unit of the torques scales friction too.
    """
    logged, scaled = _friction_distance(base.fit(*bounds(arm)), arm, factors)
    return bool(logged.max() <= _SURE and np.sum(scaled**2) - np.sum(logged**2) > _SURE**2)


def _friction_distance(
    as_logged: Fit, arm: Arm, factors: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the distances of the friction coefficients of a fit from the arm file's [standard deviations], as they are and times the factors."""
    b = arm.n_inertial
    friction = as_logged.theta[b:]
    sigma = np.maximum(arm.sigma[b:], np.finfo(float).tiny)
    logged, scaled = (np.abs((x - arm.theta[b:]) / sigma) for x in (friction, np.tile(factors, 2) * friction))
    return logged, scaled


def _loaded(base: EquationError, arm: Arm, low: NDArray[np.float64], high: NDArray[np.float64]) -> list[Fit]:
    """Return the fits to the torques as logged of the arm with a payload of any mass, one for each of some distances along the last link."""
    distances = np.linspace(0.0, _FURTHEST_LOAD * last_length(arm), _LOAD_DISTANCES)
    return [base.with_load(low, high, payload_change(arm, 1.0, float(distance))) for distance in distances]


def _common(factors: NDArray[np.float64], share: NDArray[np.float64]) -> float:
    """Return the common factor of all columns: mean weighted by unexplained share, to which the variance of a joint's factor is proportional."""
    weight = (1.0 - share) / np.maximum(share, _EXACT_FACTOR_SHARE)
    return math.exp(float(np.average(np.log(factors), weights=weight)))


@dataclass(frozen=True)
class _Reading:
    """Equation error, factor and unexplained share of each torque, and mask of the joints with a limit of the drive or an elastic torque."""

    errors: EquationError
    factors: NDArray[np.float64]
    share: NDArray[np.float64]
    changed: NDArray[np.bool_]

    @classmethod
    def of(cls, errors: EquationError, low: NDArray[np.float64], high: NDArray[np.float64], changed: Any) -> _Reading:
        """Estimate the factors from an equation error, with parameters between `low` and `high`."""
        factors = _factors(errors, low, high)
        return cls(errors, factors, errors.with_factors(low, high, factors).share, np.asarray(changed, dtype=bool))

    def explains(self, joint: int, before: _Reading) -> bool:
        """Whether the limit or elastic torque of a joint explains its torque: it leaves far less unexplained than the reading `before`."""
        enough = self.share[joint] < min(LIMITED, TAKEN * before.share[joint])
        return bool(enough and np.all(self.factors > 0))


def _read(base: EquationError, logs: Sequence[Log], arm: Arm) -> _Reading:
    """Return the factors of the torques, with limits of drives and elastic torques tried where factors alone leave much torque unexplained.

    A column in another unit may be the command of a drive that is limited, or of a joint with a spring or a stop: such a joint's factor is
    identifiable only together with the limit, or with the elastic torque.
    """
    low, high = bounds(arm, PARAMETER_BOUND_FACTOR)

    def model(errors: EquationError) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        factors = _factors(errors, low, high)
        return errors.with_factors(low, high, factors).theta, factors

    now, at = _Reading.of(base, low, high, np.zeros(arm.n_joints)), base
    if all(_within(c, _GAIN) for c in now.factors):
        return now
    for joint in range(arm.n_joints):
        # A joint that was not driven has no factor.
        if now.share[joint] < TRIED or now.factors[joint] <= 0:
            continue
        changed = now.changed | (np.arange(arm.n_joints) == joint)
        delivered, best = _limited(at, logs, joint, low, high, changed)
        if best.explains(joint, now):
            logs, now, at = delivered, best, best.errors
            continue
        beside = _Reading.of(beside_elasticity(now.errors, logs, model, [joint]), low, high, changed)
        now = beside if beside.explains(joint, now) else now
    return now


def _limited(
    base: EquationError,
    logs: Sequence[Log],
    joint: int,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    changed: NDArray[np.bool_],
) -> tuple[list[Log], _Reading]:
    """Return the logs with one joint's torques limited in size or in rate so that factors leave least of them unexplained, and the factors."""

    def tried(limit: tuple[list[Log], EquationError]) -> tuple[list[Log], _Reading]:
        return limit[0], _Reading.of(limit[1], low, high, changed)

    def share(found: tuple[list[Log], _Reading]) -> float:
        return float(found[1].share[joint])

    sized = at_best_level(lambda level: tried(at_level(base, logs, joint, level)), logs, joint, share)
    return min((sized, *map(tried, at_rates(base, logs, joint))), key=share)


def _within(factor: float, bound: float) -> bool:
    return bool(1 / bound <= factor <= bound)


def _factors(base: EquationError, low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the factor of every torque column: shape of the torques by parameters within bounds, size by the arm file."""
    factors = base.expected()
    for _ in range(_FACTOR_ITERATIONS):
        if np.any(factors <= 0):
            break
        theta = base.with_factors(low, high, factors).theta
        factors = factors * base.size_of(theta)
    return factors


def _said(factors: NDArray[np.float64], odd: Sequence[int], shared: bool) -> tuple[Corrections, list[Check]]:
    listed = {f"tau{j + 1}": float(f"{factors[j]:.4g}") for j in odd}
    corrections = Corrections(factor={"tau": next(iter(listed.values()))} if shared and len(odd) > 1 else listed)
    largest = max(max(c, 1 / c) for c in listed.values())
    severity: Severity = "repaired"
    if shared and largest < _SCALED:
        severity = "warning"
    elif largest > _MAX_REPAIRED_FACTOR:
        severity = "error"
    return corrections, said(corrections.factor, severity, shared=shared)


def said(factors: Mapping[str, float], severity: Severity = "repaired", *, shared: bool = False) -> list[Check]:
    """Return one check per column with a factor; a factor shared by all columns is reported as a possible factor of all parameters too."""
    checks = []
    for column, c in factors.items():
        remedies = [f"--factor {column}={c:.4g}"]
        if shared:
            remedies.append(f"all values of theta and friction in the arm file divided by {c:.4g}")
        message = f"`{column}` times {c:.4g} is the torque that the arm file expects: a current, a percentage, or the motor's side of a gear?"
        if severity == "warning" and shared:
            message += " Or the arm file's values are off by that much: they are trusted no further than that"
        joint = int(column[3:]) if column != "tau" else None
        checks.append(Check("torque_unit", severity, message, tuple(remedies), joint))
    return checks


def refined(factors: Mapping[str, float], causes: Sequence[Mapping[str, Any]], n_joints: int) -> dict[str, float]:
    """Return repaired factors on torques times the gains that a diagnosis named; empty if it named no gain.

    A column of unknown unit has no gain of its own: a fitted gain is the error of its factor. A gain of another joint counts as the inverse
    gain of this one, as the scale of all parameters is only trusted to a few percent.
    """
    gains = {c["joint"]: c["parameters"]["gain"]["value"] for c in by_joint(causes) if c["effect"] == "torque_gain"}
    given = {j: factors.get(f"tau{j}", factors.get("tau")) for j in range(1, n_joints + 1)}
    repaired = {j: c for j, c in given.items() if c is not None}
    if not gains or not repaired:
        return {}
    elsewhere = math.prod(gain for j, gain in gains.items() if j not in repaired)
    return {f"tau{j}": float(f"{c * gains.get(j, 1.0) / elsewhere:.4g}") for j, c in repaired.items()}
