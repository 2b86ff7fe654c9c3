"""Contradictions between logs and arm file of a serial arm: corrected columns explain the torques where the columns as logged do not.

A right reading of the columns lowers both the torque that the equation of motion (`weak_form`) leaves unexplained and the distance from the arm file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.check import Check
from armgap.check.readings import (
    gravity_direction,
    gravity_missing,
    gravity_sign,
    joint_order,
    position_sign,
    position_unit,
    position_zero,
    relative_angle,
    torque_sign,
)
from armgap.check.readings.reading import Reading
from armgap.check.serial.weak_form import Fit, Rows, fit, rows_of
from armgap.log.log import Log

__all__ = ["contradictions"]

Array = NDArray[np.float64]

# Share of a joint's mean square torque that stays unexplained, from which other readings of the columns are tried. Re-estimated parameters hide a
# part of a wrong reading: an angle that counts from the world left 0.27 to 0.34 on a simulated arm. What decides is `_is_right`; this saves time.
_SUSPICIOUS_SHARE = 0.1
# Squared distance of the parameters from the arm file, per joint, from which other readings of the columns are tried. A joint has six or seven
# identifiable parameters, so that a right arm file has a distance of about this size.
_SUSPICIOUS_DISTANCE = 8.0
# Reduction of the squared distance from the arm file, to less than a third, from which a reading is right too: six standard deviations of one value.
_RESTORED = 36.0
# A reading of the columns is right where the cost falls by as much as if the unexplained part of one joint's torque fell to a third, and less than
# `_EXPLAINS` of every joint's mean square torque stays unexplained, or half of the share with the log as it stands.
_MIN_COST_DECREASE = 1.0
_EXPLAINS = 0.15
# Standard deviations of an unknown load on the last link: its mass in masses of the whole arm, as cobots carry a third to a half of what they weigh,
# and its distance from the last joint [m].
_LOAD_MASS, _LOAD_DISTANCE = 0.5, 0.3
# Increase of the cost up to which a torque's factor is set to 1: friction alone determines no factor.
_UNDECIDED = 10.0
# Ratio of the factor by small torques to that by all, up or down, from which a factor is no unit: a limit of the drive takes large torques alone.
_NOT_CONSTANT = 1.5
# Torques that are small: up to this part of a joint's large torque, which is a quantile of all.
_SMALL_PART, _LARGE_QUANTILE = 0.5, 0.95
# Difference of two readings' costs, as a part of their gain, below which the readings are alike.
_ALIKE_COST_PART = 0.02

# Factor on the standard deviations of the links' inertial parameters with which the search for the torques' factors starts: as trusted values.
_TRUSTED = 0.01
# Range of factors on a torque that are gains, not other units.
_NO_UNIT = (0.5, 2.0)
# Factors that are tried on a torque, with both signs: three decades either way; refined between neighbours.
_COARSE = np.concatenate([np.geomspace(1e-3, 1e3, 61), -np.geomspace(1e-3, 1e3, 61)])
_FINE = np.geomspace(0.8, 1.25, 11)

_READINGS: tuple[Callable[[Arm, float], Iterable[Reading]], ...] = (
    torque_sign.readings,
    position_sign.readings,
    joint_order.readings,
    position_zero.readings,
    relative_angle.readings,
    gravity_sign.readings,
    gravity_direction.readings,
    gravity_missing.readings,
    position_unit.readings,
)


def contradictions(logs: Sequence[Log], arm: Arm, *, repair: bool = True) -> tuple[Corrections, list[Check]]:
    """Find corrections of the columns with which logs and arm file agree where they contradict each other as they stand.

    Parameters
    ----------
    logs : sequence of Log
        Logs of the arm.
    arm : Arm
        Nominal model, of kind ``"serial"``.
    repair : bool, default True
        Whether torques in another unit are brought to N m (N); otherwise they are only reported.

    Returns
    -------
    Corrections
        Corrections of the columns; empty without a contradiction.
    list of Check
        One contradiction, or one check per joint whose torques are in another unit.
    """
    commanded = not all(log.has_torques for log in logs)
    if commanded and (arm.controller is None or arm.controller.ki is not None):
        # The value of the controller's integral part at the start of a log is in no column.
        return Corrections(), []
    stands = fit(logs, arm)
    if stands is None or not _is_suspicious(stands, arm):
        return Corrections(), []
    # A load on the last link is no contradiction: another reading has to explain more than it does.
    loaded = fit(logs, _with_load(arm))
    if loaded is not None and loaded.cost < stands.cost:
        stands = loaded
    tried = [
        (reading, fit([reading.corrections.on_log(log) for log in logs], reading.corrections.on_arm(arm)))
        for reading in _offered(logs, arm)
    ]
    found = [(reading, other) for reading, other in tried if other is not None]
    if found:
        best, least = min(found, key=lambda pair: pair[1].cost)
        if _is_right(stands, least):
            remedies = _alike(best, least.cost + _ALIKE_COST_PART * (stands.cost - least.cost), logs, arm)
            return best.corrections, [_contradiction(stands, best, least, found, remedies)]
    # Torques that are computed by a controller have the unit of its gains, and those that a load explains have that of the arm file.
    scaled = None if commanded or not _is_suspicious(stands, arm) else _factors(logs, arm)
    if scaled is None or not _is_right(stands, scaled[1]):
        return Corrections(), []
    return _rescaled(stands, *scaled, repair=repair)


def _is_suspicious(stands: Fit, arm: Arm) -> bool:
    """Whether so much torque stays unexplained, or the parameters lie so far from the arm file, that other readings of the columns are tried."""
    return bool(stands.share.max() >= _SUSPICIOUS_SHARE or stands.distance >= _SUSPICIOUS_DISTANCE * arm.n_joints)


def _with_load(arm: Arm) -> Arm:
    """Return the arm with large standard deviations of the last link's ten inertial parameters, as for an unknown load."""
    mass = _LOAD_MASS * float(arm.theta[: 10 * arm.n_joints : 10].sum())
    load = mass * np.array([1.0, *[_LOAD_DISTANCE] * 3, *[_LOAD_DISTANCE**2] * 6])
    sigma = arm.sigma.copy()
    last = slice(10 * (arm.n_joints - 1), 10 * arm.n_joints)
    sigma[last] = np.hypot(sigma[last], load)
    return replace(arm, sigma=sigma)


def _is_right(stands: Fit, other: Fit) -> bool:
    explains = other.share.max() < max(_EXPLAINS, 0.5 * stands.share.max())
    restores = stands.distance - other.distance > _RESTORED and other.distance < stands.distance / 3
    return bool(explains and (restores or stands.cost - other.cost > _MIN_COST_DECREASE * stands.count))


def _contradiction(
    stands: Fit, best: Reading, least: Fit, found: Sequence[tuple[Reading, Fit]], remedies: list[str]
) -> Check:
    for other, result in found:
        if other is not best and result.cost - least.cost < _ALIKE_COST_PART * (stands.cost - least.cost):
            remedies += [remedy for remedy in other.remedies if remedy not in remedies]
    worst = int(np.argmax(stands.share - least.share))
    message = (
        f"logs and arm file agree as if {best.what}: of joint {worst + 1}'s torque {_percent(stands.share[worst])} stays unexplained as the "
        f"columns stand (RMS) and {_percent(least.share[worst])} read like that"
    )
    return Check(best.check, "error", message, tuple(remedies), best.joint)


def _rescaled(stands: Fit, factors: Array, found: Fit, *, repair: bool) -> tuple[Corrections, list[Check]]:
    """Return factors and checks of torques in another unit; a factor between one half and two is a gain, not a unit."""
    low, high = _NO_UNIT
    checks = []
    factor = {}
    for j, value in enumerate(factors):
        share = f"{_percent(found.share[j])} of them stay unexplained (RMS; {_percent(stands.share[j])} as they stand)"
        if not low < abs(value) < high:
            other = "in another unit" if value > 0 else "in another unit and counted the other way"
            message = f"torques of joint {j + 1} are as if {other}: times {value:.3g} they agree with the arm file's masses, and {share}"
            remedy = f"--factor tau{j + 1}={value:.3g}"
            checks.append(Check("torque_unit", "repaired" if repair else "warning", message, (remedy,), j + 1))
            factor[f"tau{j + 1}"] = float(f"{value:.3g}")
        elif value < 0:
            message = f"torques of joint {j + 1} count the other way: {share}"
            checks.append(Check("torque_sign", "error", message, (f"--flip tau{j + 1}",), j + 1))
    flip = tuple(f"tau{check.joint}" for check in checks if check.check == "torque_sign")
    return Corrections(factor=factor if repair else {}, flip=flip), checks


def _alike(best: Reading, most: float, logs: Sequence[Log], arm: Arm) -> list[str]:
    """Return those remedies of the best reading that explain the logs equally well: the first, and others with a cost below `most`.

    On planar arms the equation of motion is odd in positions and torques together, so that a sign can be corrected on either;
    on serial arms this holds only where the chain is its own mirror image.
    """
    remedies = [best.remedies[0]]
    for remedy in best.remedies[1:]:
        corrections = _of_options(remedy)
        result = (
            None if corrections is None else fit([corrections.on_log(log) for log in logs], corrections.on_arm(arm))
        )
        if result is None or result.cost < most:
            remedies.append(remedy)
    return remedies


def _of_options(remedy: str) -> Corrections | None:
    """Return the corrections that a remedy such as ``--flip q1,tau2`` stands for; None for a remedy that is no command-line option."""
    words = remedy.split()
    if len(words) % 2 or any(word not in ("--flip", "--zero", "--swap") for word in words[::2]):
        return None
    given: dict[str, list[str]] = {}
    for option, word in zip(words[::2], words[1::2], strict=True):
        given.setdefault(option.removeprefix("--"), []).append(word)
    return Corrections.parse(**given)


def _percent(share: float) -> str:
    percent = 100 * float(np.sqrt(share))
    return f"{percent:.0f} %" if percent >= 10 else f"{percent:.2g} %"


def _offered(logs: Sequence[Log], arm: Arm) -> Iterator[Reading]:
    travel = max(float(np.ptp(log.q, axis=0).max()) for log in logs)
    for readings in _READINGS:
        yield from readings(arm, travel)


def _factors(logs: Sequence[Log], arm: Arm) -> tuple[Array, Fit] | None:
    """Return the factor per torque for the best agreement of logs and arm file, and its fit; None for short logs.

    Alternating grid searches start from the torques as they stand, and from the factors that agree best with the arm file's links: where most torques
    are too small, the first start takes them for those of a light arm.
    """
    rows = Rows.of(logs, arm)
    if rows is None:
        return None
    links = slice(0, 10 * arm.n_joints)
    sigma = arm.sigma.copy()
    sigma[links] *= _TRUSTED
    stands = np.ones(arm.n_joints)
    start, _ = _descended(rows, replace(arm, sigma=sigma), stands, (_COARSE, _FINE))
    factors, best = min(
        (_descended(rows, arm, stands, (_COARSE, _COARSE, _FINE)), _descended(rows, arm, start, (_COARSE, _FINE))),
        key=lambda found: found[1].cost,
    )
    for j in range(arm.n_joints):
        plain = _with_factor(rows, arm, factors, j, float(np.sign(factors[j])))
        if plain[1].cost < best.cost + _UNDECIDED or not _is_constant(logs, arm, factors, j):
            factors, best = plain
    return factors, best


def _is_constant(logs: Sequence[Log], arm: Arm, factors: Array, j: int) -> bool:
    """Whether joint `j`'s (from 0) small torques do not contradict its factor, as they do where the drive limits large ones."""
    found = [rows for _, rows in rows_of(logs, arm)]
    small = _SMALL_PART * float(np.quantile(np.concatenate([np.abs(rows.y[:, j]) for rows in found]), _LARGE_QUANTILE))
    used = [np.ones(rows.y.shape, dtype=bool) for rows in found]
    for mask, rows in zip(used, found, strict=True):
        mask[:, j] = np.abs(rows.y[:, j]) <= small
    half = Rows.of_rows(found, used)
    if half is None:
        return True
    all_of_them = half.fit(arm, factors).cost
    tried, best = _descended_on(half, arm, factors, j)
    ratio = tried[j] / factors[j]
    return bool(1.0 / _NOT_CONSTANT < ratio < _NOT_CONSTANT or all_of_them - best.cost < _UNDECIDED)


def _descended(rows: Rows, arm: Arm, factors: Array, grids: Iterable[Array]) -> tuple[Array, Fit]:
    """Return the factors of least cost by alternating grid searches from `factors`, and their fit."""
    best = rows.fit(arm, factors)
    for grid in grids:
        for j in range(arm.n_joints):
            tried = (_with_factor(rows, arm, factors, j, factor) for factor in factors[j] * grid)
            factors, best = min(((factors, best), *tried), key=lambda found: found[1].cost)
    return factors, best


def _descended_on(rows: Rows, arm: Arm, factors: Array, j: int) -> tuple[Array, Fit]:
    """Return the factors of least cost with that of joint `j` (from 0) changed alone, and their fit."""
    tried = (_with_factor(rows, arm, factors, j, factor) for factor in factors[j] * _COARSE[_COARSE > 0.0])
    return min(tried, key=lambda found: found[1].cost)


def _with_factor(rows: Rows, arm: Arm, factors: Array, j: int, factor: float) -> tuple[Array, Fit]:
    """Return the factors with that of joint `j` (from 0) replaced, and their fit."""
    tried = factors.copy()
    tried[j] = factor
    return tried, rows.fit(arm, tried)
