"""Contradictions between logs and arm file: a corrected reading of the columns explains the logs where the columns as logged do not.

The check has two steps. Equation errors with the arm's parameters within bounds cost a millisecond per reading and find candidates (`screen`).
Predictions over short windows, with the parameters re-estimated with the arm file as prior, decide (`confirm`). Both steps compare the
log as it stands with the log without the defect, and neither step has a rule for any single defect.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm.arm import Arm
from armgap.check.drive_limit import Delivered, as_commanded, deliver, delivered
from armgap.check.equation_error import FEWEST_ROWS, EquationError, Fit, Rows, bounds
from armgap.check.readings import (
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
from armgap.log.log import Log

Array = NDArray[np.float64]

__all__ = [
    "AS_GOOD",
    "BETTER",
    "EXPLAINS",
    "READINGS",
    "Found",
    "Refit",
    "Suspect",
    "confirm",
    "screen",
    "start_beside_file",
]

READINGS: tuple[Callable[[Arm, float], Iterable[Reading]], ...] = (
    torque_sign.readings,
    position_sign.readings,
    joint_order.readings,
    relative_angle.readings,
    position_zero.readings,
    gravity_sign.readings,
    gravity_missing.readings,
    position_unit.readings,
)
"""Functions that yield the readings of the input to be tried, for an arm and the largest range of a joint's positions in its logs."""

# A reading of the input is refitted if it lowers the mean log share of unexplained torque by this much. On logs of a simulator the right
# reading wins by 0.17 to 4; on single logs of a real arm a wrong reading has won by up to 0.6, which predictions then refute.
_MIN_REFIT_GAIN = 0.1
# Largest number of readings of the input that are refitted.
_MOST_SUSPECTS = 3
# A reading of the input is right if its prediction error is below this part of the prediction error with the log as it stands. Unmodelled effects
# seldom change the RMS of wrong readings by less than a factor of two.
BETTER = 0.7
# Least decrease, with a right reading of the input, of the logarithms of prediction error and equation error together. Of 161 right readings on 14
# cases, where an arm may have the parameters that the log as it stands suggests, the least are 1.3 (with a drive that saturates), 1.9 and 2.1;
# wrong readings of pieces of two runs of a real arm reach 0.73 and 0.86.
_SAYS = 1.0
# Largest ratio of a reading's prediction error to that of the log as it stands, where the log as it stands needs parameters outside the
# bounds, and for a factor on all torques that the arm file's parameters may be off by instead.
AS_GOOD = 1.3
# Largest prediction error of a reading that explains a log, as a part of the motion. Unmodelled effects leave up to a tenth.
EXPLAINS = 0.3
# A reading also explains a log if predictions miss by less than the motion and less than this share of every joint's torque is unexplained: where a
# drive saturates or has a dead zone for whole windows, predictions of right readings miss by 0.35 and 0.58 of the motion and 0.016 and 0.063 of the
# torque is unexplained (two cases). Wrong readings leave 0.07 to 1.2, so predictions have to be better than with the log as it stands too. A real arm
# that balances moves so little that predictions miss by twice the motion; with its joints exchanged the equation leaves 0.068.
_ACCOUNTS_FOR = 0.1
# Largest share of a torque that a right reading leaves unexplained. Without it a joint that friction holds, whose torque no reading explains (0.74
# left), was read as turned by 90 degrees, since the other joint's predictions liked that in place of a tilted base.
_LEAVES = 0.5
# Prediction errors below this part of the motion count as none.
_NEGLIGIBLE = 1e-3
# Ratio of prediction errors up to which another reading, with an equation error equal to within `_MIN_REFIT_GAIN`, is named with the best reading.
_ALIKE_ERROR_RATIO = 1.05
# Standard deviations of the arm file between its values and those of the equation of motion from which a diagnosis starts from both: as many as are
# reported as implausible. Inertial values three times too large, with a standard deviation of 5 %, are 13 off: a fit from the arm file stays there.
_FAR = 5.0
# Standard deviations beyond the bounds from which parameters count as impossible.
_SURE = 3.0


@dataclass(frozen=True)
class Refit:
    """An arm without effects, fitted to training logs and judged on the holdout.

    `error` is the RMS prediction error and `motion` the RMS displacement within a window, per joint [rad or m].
    """

    theta: NDArray[np.float64]
    sigma: NDArray[np.float64]
    error: NDArray[np.float64]
    motion: NDArray[np.float64]

    @classmethod
    def of(cls, arm: Arm, training: Sequence[Log], holdout: Sequence[Log], horizon: float) -> Refit:
        """Fit the arm's parameters to training logs, with arm file as prior and equation-error fit as second start, and judge them on the holdout."""
        start = _start(training, arm)
        found = _native.refit(
            arm.to_native(),
            start.tolist(),
            [log.to_native() for log in training],
            [log.to_native() for log in holdout],
            horizon,
        )
        theta, sigma, error, motion = (np.asarray(found[key]) for key in ("theta", "sigma", "refit", "motion"))
        return cls(theta, sigma, error, motion)

    @classmethod
    def within_limits(cls, arm: Arm, training: Sequence[Log], holdout: Sequence[Log], horizon: float) -> Refit:
        """Fit and judge as `of`, with torques within the limits of the drives where the logs need such limits (`drive_limit.delivered`).

        The limits are those of all logs together: a drive may saturate on the holdout alone.
        """
        levels = delivered([*training, *holdout], arm).levels
        return cls.of(arm, deliver(training, levels), deliver(holdout, levels), horizon)

    def possible(self, arm: Arm) -> bool:
        """Whether the parameters are possible for an arm whose file is right about signs and orders of magnitude."""
        low, high = bounds(arm)
        slack = _SURE * np.where(np.isfinite(self.sigma), self.sigma, 0.0)
        b = arm.n_inertial
        return bool(np.all(self.theta[:b] >= (low - slack)[:b]) and np.all(self.theta[:b] <= (high + slack)[:b]))

    def against(self, other: Refit, *, rescaled: bool = False) -> float:
        """Return the prediction error as a part of that of `other`: geometric mean over the joints.

        With `rescaled`, for positions in different units, each error is taken relative to the RMS displacement of its own motion. Errors of other
        readings are not scaled: a joint that hardly moves in the log as it stands may move in another reading without a better prediction.
        """
        if rescaled:
            return self.relative / other.relative
        least = np.maximum(_NEGLIGIBLE * np.maximum(self.motion, other.motion), np.finfo(float).tiny)
        errors = np.maximum(self.error, least) / np.maximum(other.error, least)
        return float(np.exp(np.mean(np.log(errors))))

    def bounded_by_motion(self) -> Refit:
        """Return the refit with errors of at most the RMS displacement within a window: the error of predicting no motion."""
        return replace(self, error=np.minimum(self.error, self.motion))

    @property
    def relative(self) -> float:
        """RMS error as a part of the RMS displacement within a window, the geometric mean over the joints."""
        return self.relative_on(np.ones(len(self.error), dtype=bool))

    def relative_on(self, joints: NDArray[np.bool_]) -> float:
        """Return the RMS error as a part of the RMS displacement within a window, the geometric mean over some of the joints, of a mask."""
        moved = np.maximum(self.motion, np.finfo(float).tiny)
        return float(np.exp(np.mean(np.log(np.maximum(self.error / moved, _NEGLIGIBLE))[joints])))


def _start(logs: Sequence[Log], arm: Arm) -> Array:
    """Return the parameters of the bounded fit to the equation of motion, from which a fit of predictions starts besides the arm file's."""
    errors = EquationError([Rows.of(log, arm) for log in logs], arm)
    return errors.fit(*bounds(arm)).theta if len(errors) else arm.theta


def start_beside_file(logs: Sequence[Log], arm: Arm) -> list[float] | None:
    """Return parameters from which a diagnosis starts besides the arm file's; None where the equation of motion agrees with the arm file.

    Parameters
    ----------
    logs : sequence of Log
        Training logs.
    arm : Arm
        Nominal model of the arm, of a planar kind.

    Returns
    -------
    list of float, optional
        Parameters within the bounds [SI], some of them more than `_FAR` standard deviations of the arm file from its values; those that the arm file
        gives as zero are zero. None with fewer than `FEWEST_ROWS` rows too.
    """
    found = delivered(logs, arm)
    if len(found.errors) < FEWEST_ROWS:
        return None
    start = np.where(arm.theta == 0, 0.0, found.fit.theta)
    far = np.abs(start - arm.theta) > _FAR * arm.sigma
    return start.tolist() if far.any() else None


@dataclass(frozen=True)
class Found:
    """Reading of the input that predictions confirm where the log as it stands is contradicted.

    Attributes
    ----------
    reading : Reading
        Defect of the input, and the corrections that undo it.
    alike : tuple of Reading
        Other readings that explain the logs equally well.
    unexplained : tuple of (float, float)
        Largest share of a joint's torque unexplained by the equation of motion: with the log as it stands, with the corrected log. Of a drive that
        saturates, as a share of the torque that it delivers.
    error : tuple of (ndarray, ndarray)
        RMS prediction error per joint [rad or m]: with the log as it stands, with the corrected log.
    """

    reading: Reading
    alike: tuple[Reading, ...]
    unexplained: tuple[float, float]
    error: tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True)
class Suspect:
    """Candidate reading of the input: its fit, the decrease `gain` of the fit's cost, and `closeness` and `unexplained` of the delivered torques."""

    reading: Reading
    fit: Fit
    gain: float
    closeness: float
    unexplained: Array


def screen(base: EquationError, logs: Sequence[Log], arm: Arm) -> tuple[Delivered, list[Suspect]]:
    """Return the fit to the logs as they stand (`base`), and readings of the input with a smaller equation error, the smallest first.

    Where no reading explains the torques with drives that deliver their commands, each is fitted together with the limits of the drives.
    """
    travel = max(float(np.ptp(log.q, axis=0).max()) for log in logs)
    tried = [reading for readings in READINGS for reading in readings(arm, travel)]
    stands = as_commanded(base, *bounds(arm))
    fits = [_fit(reading, base, logs, arm) for reading in tried]
    if all(fit.limits_tried.any() for fit in (stands, *fits)):
        stands = delivered(logs, arm, rows=base.rows)
        fits = [_fit(reading, base, logs, arm, fit.errors.rows) for reading, fit in zip(tried, fits, strict=True)]
    gains = [stands.fit.cost - fit.fit.cost for fit in fits]
    suspects = [
        Suspect(reading, fit.fit, gain, fit.closeness, fit.unexplained)
        for reading, fit, gain in zip(tried, fits, gains, strict=True)
        if gain > _MIN_REFIT_GAIN
    ]
    return stands, sorted(suspects, key=lambda s: -s.gain)


def _fit(
    reading: Reading, base: EquationError, logs: Sequence[Log], arm: Arm, rows: Sequence[Rows] | None = None
) -> Delivered:
    """Return the fit to logs and arm file that are corrected for the one defect that a reading supposes, such as a reversed sign.

    `base` is the equation error of the logs as they stand. With the `rows` of the corrected logs drives may deliver less than they are commanded.
    """
    low, high = bounds(arm)
    if reading.corrections.gravity is not None:
        weights = arm.gravity_parameters
        if reading.corrections.gravity == "reversed":
            low[weights], high[weights] = -high[weights], -low[weights]
        else:
            low[weights] = high[weights] = 0.0
    read = [reading.corrections.on_log(log) for log in logs]
    if rows is not None:
        return delivered(read, arm, low, high, stands=base, rows=rows)
    if reading.corrections.gravity is not None:
        return as_commanded(base, low, high)
    rows = [there.read_as(log, arm) for there, log in zip(base.rows, read, strict=True)]
    return as_commanded(EquationError(rows, arm, base.scale), low, high)


def confirm(
    stands: Fit,
    suspects: Sequence[Suspect],
    training: Sequence[Log],
    holdout: Sequence[Log],
    arm: Arm,
    horizon: float,
) -> Found | None:
    """Return the candidate reading that predictions confirm; None if no reading is confirmed.

    Of several confirmed readings the one with the largest gain in predictions and torques together is returned: predictions alone hardly
    tell readings apart where a hidden effect dominates their error.
    """
    if not suspects:
        return None
    as_is = Refit.within_limits(arm, training, holdout, horizon)
    possible = as_is.possible(arm)
    # If the arm hardly moves, predictions of the log as it stands may miss by many times the motion; that confirms no other reading.
    no_worse_than_rest = as_is.bounded_by_motion()
    tried = []
    for suspect in suspects[:_MOST_SUSPECTS]:
        corrections = suspect.reading.corrections
        read = [[corrections.on_log(log) for log in group] for group in (training, holdout)]
        refit = Refit.within_limits(corrections.on_arm(arm), read[0], read[1], horizon)
        explains = refit.relative < EXPLAINS or (refit.relative < 1.0 and suspect.unexplained.max() < _ACCOUNTS_FOR)
        if refit.possible(corrections.on_arm(arm)) and explains and suspect.unexplained.max() < _LEAVES:
            ratio = refit.against(no_worse_than_rest, rescaled=bool(corrections.unit))
            says = suspect.gain - math.log(ratio)
            if (ratio <= BETTER and says >= _SAYS) if possible else ratio <= AS_GOOD:
                tried.append((ratio, suspect, refit))
    if not tried:
        return None
    tried.sort(key=lambda entry: math.log(entry[0]) - entry[1].gain)
    ratio, best, refit = tried[0]
    alike = tuple(
        s.reading
        for part, s, _ in tried[1:]
        if part <= _ALIKE_ERROR_RATIO * ratio and best.gain - s.gain <= _MIN_REFIT_GAIN
    )
    shares = (float(stands.share.max()), float(best.fit.share.max()))
    return Found(best.reading, alike, shares, (as_is.error, refit.error))
