"""Contradictions between logs and arm file: another reading explains the logs where the one they have does not.

Two steps. The equation error of the arm within bounds costs a millisecond per reading and finds what may be (`screen`). Predictions over
short windows, with the parameters estimated again in the trust that the arm file states, decide (`confirm`). Both compare the log as
it stands with the log as it would be without the defect; neither knows anything about a single defect.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm.arm import Arm
from armgap.check.equation_error import EquationError, Fit, Rows, bounds
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

__all__ = ["AS_GOOD", "BETTER", "EXPLAINS", "READINGS", "Found", "Refit", "Suspect", "confirm", "screen"]

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
"""Every check that offers other readings of the input."""

# A reading is looked at more closely if it lowers the mean log share of unexplained torque by this much. On logs of a simulator the right
# reading wins by 0.17 to 4; on single logs of a real arm a wrong one has won by up to 0.6, which predictions then refute.
_SUSPICIOUS = 0.1
# Readings that are looked at more closely, at most.
_MOST_SUSPECTS = 3
# A reading is right if predictions miss by less than this part of what they miss with the log as it stands. Unmodelled effects seldom
# change the RMS of wrong readings by less than a factor of two.
BETTER = 0.7
# And if the logarithms of this ratio and of the equation error fall by so much together. Of 161 right readings on 14 cases, where an arm may have
# what the log as it stands asks for, the least say 1.3 (beside a drive that saturates), 1.9 and 2.1; wrong ones, on pieces of two runs of a real
# arm, 0.73 and 0.86.
_SAYS = 1.0
# With parameters that no arm has the log as it stands explains nothing; the other reading must then do about as well. So must a size of all torques
# that the arm file's values may as well be off by.
AS_GOOD = 1.3
# A reading that explains a log predicts it: errors stay below this part of the motion. Unmodelled effects leave up to a tenth.
EXPLAINS = 0.3
# Or predictions miss by less than the motion itself, and its equation of motion leaves less than this share of every joint's torque: where a drive
# saturates or has a dead zone for whole windows, predictions of right readings miss by 0.35 and 0.58 of the motion and the equation leaves 0.016 and
# 0.063 (two cases). Wrong readings of them leave 0.07 to 1.2, so predictions have to be better than as the log stands here too. A real arm that
# balances moves so little that predictions miss by twice the motion; with its joints exchanged the equation leaves 0.068.
_ACCOUNTS_FOR = 0.1
# Errors below this part of the motion are as good as none.
_NEGLIGIBLE = 1e-3
# Other readings whose predictions are as good to this part, and that lower the equation error as far (to `_SUSPICIOUS`), are named beside it.
_ALIKE = 1.05
# Parameters count as impossible beyond the bounds by so many standard deviations.
_SURE = 3.0


@dataclass(frozen=True)
class Refit:
    """An arm without effects, fitted to training logs and judged on the holdout; errors are RMS per joint [rad or m]."""

    theta: NDArray[np.float64]
    sigma: NDArray[np.float64]
    error: NDArray[np.float64]
    motion: NDArray[np.float64]

    @classmethod
    def of(cls, arm: Arm, training: Sequence[Log], holdout: Sequence[Log], horizon: float) -> Refit:
        """Fit the parameters of the arm in the trust that it states, from its file and from what the equation of motion says of the logs."""
        errors = EquationError([Rows.of(log, arm) for log in training], arm)
        start = errors.fit(*bounds(arm)).theta if len(errors) else arm.theta
        found = _native.refit(
            arm.to_native(),
            start.tolist(),
            [log.to_native() for log in training],
            [log.to_native() for log in holdout],
            horizon,
        )
        theta, sigma, error, motion = (np.asarray(found[key]) for key in ("theta", "sigma", "refit", "motion"))
        return cls(theta, sigma, error, motion)

    def possible(self, arm: Arm) -> bool:
        """Whether an arm may have these parameters whose file is right about signs and orders of magnitude."""
        low, high = bounds(arm)
        slack = _SURE * np.where(np.isfinite(self.sigma), self.sigma, 0.0)
        b = arm.n_inertial
        return bool(np.all(self.theta[:b] >= (low - slack)[:b]) and np.all(self.theta[:b] <= (high + slack)[:b]))

    def against(self, other: Refit, *, rescaled: bool = False) -> float:
        """Return this error as a part of another one, the geometric mean over the joints.

        Of positions in other units each error is taken relative to its own motion. Of other readings it is not: a joint that hardly moves as it
        stands may move with another reading, which makes no prediction better.
        """
        if rescaled:
            return self.relative / other.relative
        least = np.maximum(_NEGLIGIBLE * np.maximum(self.motion, other.motion), np.finfo(float).tiny)
        errors = np.maximum(self.error, least) / np.maximum(other.error, least)
        return float(np.exp(np.mean(np.log(errors))))

    @property
    def relative(self) -> float:
        """RMS error as a part of the RMS displacement within a window, the geometric mean over the joints."""
        moved = np.maximum(self.motion, np.finfo(float).tiny)
        return float(np.exp(np.mean(np.log(np.maximum(self.error / moved, _NEGLIGIBLE)))))


@dataclass(frozen=True)
class Found:
    """A reading that is right where the one of the log is not.

    Attributes
    ----------
    reading : Reading
        What is wrong, and what undoes it.
    alike : tuple of Reading
        Other readings that explain the logs as well.
    unexplained : tuple of (float, float)
        Largest share of a joint's torque that the equation of motion leaves, as the log stands and as it is read then.
    error : tuple of (ndarray, ndarray)
        RMS prediction error per joint, as the log stands and as it is read then [rad or m].
    """

    reading: Reading
    alike: tuple[Reading, ...]
    unexplained: tuple[float, float]
    error: tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True)
class Suspect:
    """A reading with a smaller equation error than the log as it stands."""

    reading: Reading
    fit: Fit
    gain: float


def screen(base: EquationError, logs: Sequence[Log], arm: Arm) -> tuple[Fit, list[Suspect]]:
    """Return what the logs leave as they stand (`base`), and readings that lower it, the best first."""
    low, high = bounds(arm)
    stands = base.fit(low, high)
    travel = max(float(np.ptp(log.q, axis=0).max()) for log in logs)
    suspects = []
    for readings in READINGS:
        for reading in readings(arm, travel):
            fit = _read(reading, base, logs, arm, low, high)
            if (gain := stands.cost - fit.cost) > _SUSPICIOUS:
                suspects.append(Suspect(reading, fit, gain))
    return stands, sorted(suspects, key=lambda s: -s.gain)


def _read(
    reading: Reading,
    base: EquationError,
    logs: Sequence[Log],
    arm: Arm,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> Fit:
    """Return the equation error with the logs, or the arm, read so."""
    if reading.corrections.gravity is not None:
        weights = arm.gravity_parameters
        low, high = low.copy(), high.copy()
        if reading.corrections.gravity == "reversed":
            low[weights], high[weights] = -high[weights], -low[weights]
        else:
            low[weights] = high[weights] = 0.0
        return base.fit(low, high)
    read = [Rows.of(reading.corrections.on_log(log), arm) for log in logs]
    return EquationError(read, arm, base.scale).fit(low, high)


def confirm(
    stands: Fit,
    suspects: Sequence[Suspect],
    training: Sequence[Log],
    holdout: Sequence[Log],
    arm: Arm,
    horizon: float,
) -> Found | None:
    """Return the reading that predictions confirm, or none.

    Of several the one counts by which predictions and torques together say most: where something hidden makes up most of what predictions miss, they
    hardly tell readings apart.
    """
    if not suspects:
        return None
    as_is = Refit.of(arm, training, holdout, horizon)
    possible = as_is.possible(arm)
    tried = []
    for suspect in suspects[:_MOST_SUSPECTS]:
        corrections = suspect.reading.corrections
        read = [[corrections.on_log(log) for log in group] for group in (training, holdout)]
        refit = Refit.of(corrections.on_arm(arm), read[0], read[1], horizon)
        explains = refit.relative < EXPLAINS or (refit.relative < 1.0 and suspect.fit.share.max() < _ACCOUNTS_FOR)
        if refit.possible(corrections.on_arm(arm)) and explains:
            ratio = refit.against(as_is, rescaled=bool(corrections.unit))
            says = suspect.gain - math.log(ratio)
            if (ratio <= BETTER and says >= _SAYS) if possible else ratio <= AS_GOOD:
                tried.append((ratio, suspect, refit))
    if not tried:
        return None
    tried.sort(key=lambda entry: math.log(entry[0]) - entry[1].gain)
    ratio, best, refit = tried[0]
    alike = tuple(s.reading for part, s, _ in tried[1:] if part <= _ALIKE * ratio and best.gain - s.gain <= _SUSPICIOUS)
    shares = (float(stands.share.max()), float(best.fit.share.max()))
    return Found(best.reading, alike, shares, (as_is.error, refit.error))
