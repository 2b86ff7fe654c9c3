"""Stage of a diagnosis that checks its input: finds defects of logs and arm file, repairs logs, and chooses the reading of the columns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check import dead_stretch, drive_limit, time_shift, torque_is_position, torque_unit
from armgap.check.check import Check
from armgap.check.contradiction import AS_GOOD, BETTER, EXPLAINS, Found, Refit, Suspect, confirm, screen
from armgap.check.elastic import beside_elasticity
from armgap.check.equation_error import FEWEST_ROWS, EquationError, Fit, Rows, bounds, position_noise
from armgap.log.log import Log
from armgap.progress import report_progress

__all__ = ["Examined", "examine", "unexplained_columns"]

Array = NDArray[np.float64]

# Difference of the mean log shares of unexplained torque of two readings below which predictions decide between them. A reading that explains less
# than springs and contacts do, by this much, is rejected; not the reverse, for wrongly read gravity is equivalent to a spring in many logs.
_CLOSE_COST_DIFFERENCE = 1.0
# Thresholds above which torque and position columns do not belong together. First numbers: unexplained share of what moves a joint (its torque, or
# the largest term of its equation of motion), and prediction error as a part of the motion; second numbers: unexplained share of a driven joint's
# torque, and prediction error of the best model with the library's effects. Effects of the library leave less than a tenth of a torque on simulated
# logs, but a stiff hardening spring 0.38, and less than a quarter on logs of a real arm; a torque of which a third is noise was predicted to 0.001.
# Torques in reversed time order leave 0.3 to 1.1 and have prediction errors of 0.42 to 2.2 of the motion (18 development cases), of 0.28 at most
# where an effect is hidden.
_UNRELATED = (0.5, 0.25)
_UNPREDICTED = (0.3, 0.4)
# Displacement within a window, in standard deviations of a measured position, from which a joint counts as moving where predictions are judged: one
# at rest shows a few of noise and rounding, one that moves thousands.
_MOVED_NOISES = 10.0
# Shifts of the torques [samples] that are tried first: torques and positions that predict well with one of them belong to the same motion.
_SHIFTS = (-8, -5, -2, 2, 5, 8)


@dataclass(frozen=True)
class Examined:
    """Checked input of a diagnosis: logs and arm with corrections applied, and the defects that were found.

    Attributes
    ----------
    training, holdout : list of Log
        Logs after repairs and after the remedies of errors.
    arm : Arm
        Arm after the remedies of errors.
    checks : tuple of Check
        Defects that were found, errors first.
    corrections : Corrections
        Corrections that were applied.
    """

    training: list[Log]
    holdout: list[Log]
    arm: Arm
    checks: tuple[Check, ...]
    corrections: Corrections

    @property
    def contradictory(self) -> bool:
        """Whether logs and arm file contradict each other beyond doubt."""
        return any(check.severity == "error" for check in self.checks)


def examine(
    training: Sequence[Log],
    holdout: Sequence[Log],
    arm: Arm,
    *,
    horizon: float = 0.25,
    repair: bool = True,
    strangers: bool = True,
) -> Examined:
    """Check logs and arm file for known defects of input, by the fit of the arm to the logs with and without each defect.

    Parameters
    ----------
    training, holdout : sequence of Log
        Logs of one arm.
    arm : Arm
        Nominal model of the arm.
    horizon : float, default 0.25
        Prediction horizon [s].
    repair : bool, default True
        Whether unambiguous defects are repaired: a torque column's factor, torques that come too late in the file. Otherwise they are
        reported as warnings.
    strangers : bool, default True
        Whether torques that no reading of the columns explains are an error at once. A diagnosis asks for that once it has tried its effects
        (`unexplained_columns`): an elastic joint with its encoder at the motor may leave two thirds of the next joint's torque unexplained.

    Returns
    -------
    Examined
    """
    report_progress("checking the input", 0.0)
    now = Examined(list(training), list(holdout), arm, (), Corrections())
    if unusable := torque_is_position.find([*training, *holdout], arm):
        return replace(now, checks=tuple(unusable))
    read = partial(_reading, strangers=strangers)
    for step in (read, _shift, _dead):
        now = step(now, horizon, repair)
        if now.contradictory:
            break
    order = ("error", "repaired", "warning")
    return replace(now, checks=tuple(sorted(now.checks, key=lambda check: order.index(check.severity))))


def _reading(now: Examined, horizon: float, repair: bool, *, strangers: bool) -> Examined:
    """Find another reading of the columns: a factor on torques, or a reading of `contradiction.READINGS`."""
    logs = [*now.training, *now.holdout]
    base = EquationError([Rows.of(log, now.arm) for log in logs], now.arm)
    if len(base) < FEWEST_ROWS:
        return now
    stands, suspects = screen(base, logs, now.arm)
    factors = torque_unit.find(base, logs, now.arm)
    if factors is not None and _prefers(factors, suspects, now, horizon):
        applied = factors.corrections if repair and factors.checks[0].severity == "repaired" else Corrections()
        said = [c if c.severity != "repaired" or repair else replace(c, severity="warning") for c in factors.checks]
        return _applied(replace(now, arm=_doubted(now.arm, factors)), applied, said)
    odd = stands.fit.share.max() >= _UNRELATED[0]
    elastic = _beside_elasticity(stands.errors, logs, now.arm) if suspects or (odd and strangers) else stands.fit
    suspects = [s for s in suspects if s.fit.cost < elastic.cost + _CLOSE_COST_DIFFERENCE]
    found = confirm(stands.fit, suspects, now.training, now.holdout, now.arm, horizon)
    if found is None:
        return _applied(now, Corrections(), _strangers(elastic.share, now, horizon, 0) if strangers else [])
    return _applied(now, found.reading.corrections, [_said(found, now.arm, horizon)])


def unexplained_columns(
    training: Sequence[Log], holdout: Sequence[Log], arm: Arm, horizon: float, relative: float
) -> list[Check]:
    """Return a check that torques and positions do not belong together, for a diagnosis whose best model still fails to predict the motion.

    Parameters
    ----------
    training, holdout : sequence of Log
        Logs as diagnosed.
    arm : Arm
        Nominal model of the arm, of a planar kind.
    horizon : float
        Prediction horizon [s].
    relative : float
        RMS error after the diagnosis over the RMS displacement within the horizon, at the joint with the largest ratio.

    Returns
    -------
    list of Check
        One check of severity `error`, or no check.
    """
    if relative < min(_UNPREDICTED):
        return []
    logs = [*training, *holdout]
    base = EquationError([Rows.of(log, arm) for log in logs], arm)
    if len(base) < FEWEST_ROWS:
        return []
    now = Examined(list(training), list(holdout), arm, (), Corrections())
    elastic = _beside_elasticity(base, logs, arm)
    of_what_moves = _strangers(elastic.share, now, horizon, 0)
    if of_what_moves or relative < _UNPREDICTED[1]:
        return of_what_moves
    share = np.where(base.square >= drive_limit.DRIVEN * base.scale, base.of_torques(elastic).share, 0.0)
    return _strangers(share, now, horizon, 1)


def _strangers(share: Array, now: Examined, horizon: float, pair: int) -> list[Check]:
    """Return a check that torques and positions do not belong together, by pair `pair` of the thresholds `_UNRELATED`.

    The check is returned where parameters with the arm file's signs leave a part of a torque unexplained (`share` per joint), even together with
    springs and contacts or, while the joint moves, with a drive that saturates far below its command, and do not predict the motion even with
    shifted torques. The part of a torque that noise of the positions leaves unexplained is not counted. A joint that is at rest wherever predictions
    are judged is held by friction, under any torque up to its break-away torque: it contradicts nothing.
    """
    if share.max() < _UNRELATED[pair]:
        return []
    logs = [*now.training, *now.holdout]
    stands = _predicted(Corrections(), now, horizon)
    judged = stands.motion > _MOVED_NOISES * _resolution(logs, now.arm)
    share = np.where(judged, share, 0.0)
    worst = int(np.argmax(share))
    if share[worst] < _UNRELATED[pair] or stands.relative_on(judged) < _UNPREDICTED[pair]:
        return []
    base = EquationError([Rows.of(log, now.arm) for log in logs], now.arm)
    masks = [rows.moving(log) for log, rows in zip(logs, base.rows, strict=True)]
    limited, fit = drive_limit.limited(base, logs, worst, masks)
    noise = base.noise_square(logs) * np.mean(np.concatenate(masks), axis=0)
    left = fit.share - noise / np.maximum(limited.square, np.finfo(float).tiny)
    if left[judged].max() < drive_limit.LIMITED:
        return []
    period = float(np.median(np.diff(logs[0].t)))
    shifted = (_predicted(Corrections(shift={"tau": k * period}), now, horizon) for k in _SHIFTS)
    if any(read.relative_on(judged) < _UNPREDICTED[pair] for read in shifted):
        return []
    columns = ",".join(f"{kind}{j}=NAME" for kind in ("q", "tau") for j in range(1, now.arm.n_joints + 1))
    message = (
        f"no arm with the signs and orders of magnitude of the arm file explains the torques: of joint {worst + 1}'s "
        f"{100 * min(float(share[worst]), 1.0):.0f} % stay unexplained, and so under every other sign, order, zero and unit that "
        "was tried; are these columns of this arm's joints?"
    )
    return [Check("joint_order", "error", message, (f"--columns {columns}",), worst + 1)]


def _resolution(logs: Sequence[Log], arm: Arm) -> Array:
    """Return the standard deviation of each joint's measured positions [rad or m]: of their noise, or of the rounding to encoder counts if larger."""
    noise = np.median([position_noise(log) for log in logs], axis=0)
    step = np.zeros_like(noise) if arm.encoder_step is None else arm.encoder_step
    return np.asarray(np.maximum(noise, step / math.sqrt(12.0)), dtype=np.float64)


def _beside_elasticity(base: EquationError, logs: Sequence[Log], arm: Arm) -> Fit:
    """Fit the arm together with elastic torques on every joint."""

    def model(errors: EquationError) -> tuple[Array, Array]:
        return errors.fit(*bounds(arm)).theta, np.ones(arm.n_joints)

    return beside_elasticity(base, logs, model).fit(*bounds(arm))


def _doubted(arm: Arm, factors: torque_unit.Factors) -> Arm:
    """Return the arm with standard deviations wide enough for a factor on all its parameters, if the torques suggest such a factor."""
    if factors.checks[0].severity != "warning":
        return arm
    [factor] = set(factors.corrections.factor.values())
    return replace(arm, sigma=np.maximum(arm.sigma, np.abs(arm.theta) * abs(1.0 - 1.0 / factor)))


def _prefers(factors: torque_unit.Factors, suspects: Sequence[Suspect], now: Examined, horizon: float) -> bool:
    """Return whether factors on torques explain the logs better than any other reading; predictions decide between similar ones."""
    rivals = [s for s in suspects if s.closeness < factors.closeness + _CLOSE_COST_DIFFERENCE]
    if not rivals and not factors.doubtful:
        return True
    with_factors = _predicted(factors.corrections, now, horizon)
    limit = AS_GOOD if factors.checks[0].severity == "warning" else BETTER
    if factors.doubtful and not _confirmed(with_factors, now, horizon, limit):
        return False
    readings = [s.reading.corrections for s in rivals[:2]]
    return all(with_factors.against(_predicted(r, now, horizon), rescaled=bool(r.unit)) <= 1.0 for r in readings)


def _confirmed(read: Refit, now: Examined, horizon: float, limit: float) -> bool:
    """Return whether predictions of the corrected logs are right, with errors below `limit` times those of the logs as they stand."""
    return read.relative < EXPLAINS and read.against(_predicted(Corrections(), now, horizon)) < limit


def _predicted(corrections: Corrections, now: Examined, horizon: float) -> Refit:
    read = [[corrections.on_log(log) for log in group] for group in (now.training, now.holdout)]
    return Refit.within_limits(corrections.on_arm(now.arm), read[0], read[1], horizon)


def _said(found: Found, arm: Arm, horizon: float) -> Check:
    before, after = (", ".join(f"{1e3 * x:.3g}" for x in error) for error in found.error)
    unit = "mrad" if arm.rotary else "mm"
    message = (
        f"logs and arm file agree as if {found.reading.what}: the torque that the equation of motion leaves unexplained falls from "
        f"{100 * found.unexplained[0]:.3g} to {100 * found.unexplained[1]:.2g} %, prediction errors over {horizon:g} s from {before} to "
        f"{after} {unit}"
    )
    remedies = [*found.reading.remedies]
    for other in found.alike:
        remedies += [remedy for remedy in other.remedies if remedy not in remedies]
    return Check(found.reading.check, "error", message, tuple(remedies), found.reading.joint)


def _shift(now: Examined, horizon: float, repair: bool) -> Examined:
    samples = time_shift.acausal([*now.training, *now.holdout], now.arm)
    if samples is None:
        return now
    corrections = time_shift.confirmed(samples, now.training, now.holdout, now.arm, horizon)
    if corrections is None:
        return now
    late = -corrections.shift["tau"]
    message = (
        f"torques stand {1e3 * late:.3g} ms too late in the file: joints answer to them before they are commanded; "
        f"{'their times were shifted back' if repair else 'shifted back they explain the motion better'}"
    )
    check = Check("time_shift", "repaired" if repair else "warning", message, corrections.options())
    return _applied(now, corrections if repair else Corrections(), [check])


def _dead(now: Examined, horizon: float, repair: bool) -> Examined:
    checks = dead_stretch.find([*now.training, *now.holdout], now.arm)
    spans = tuple(dict.fromkeys(remedy.removeprefix("--skip ") for c in checks for remedy in c.remedies))
    return _applied(now, Corrections(skip=spans), checks)


def _applied(now: Examined, corrections: Corrections, checks: Sequence[Check]) -> Examined:
    if not checks:
        return now
    if not corrections:
        return replace(now, checks=(*now.checks, *checks))
    return Examined(
        [corrections.on_log(log) for log in now.training],
        [corrections.on_log(log) for log in now.holdout],
        corrections.on_arm(now.arm),
        (*now.checks, *checks),
        now.corrections.merged(corrections),
    )
