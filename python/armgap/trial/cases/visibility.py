"""Visibility of hidden effects after re-estimation of the arm's parameters.

An effect may leave a trace in two ways. Either prediction errors over short windows remain after re-estimation, at a
multiple of those without the effect; or re-estimation absorbs the effect, and the parameters end up far from the
arm file's. An effect that does neither cannot be found by any method, and its case is counted apart.

The floor is the prediction error for the same motions without the effect, which comes from the encoder steps and from
the initial states measured with these steps.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from armgap.trial.cases.armfile import spread
from armgap.trial.cases.windows import Mechanism, Window, cut, misses, refit
from armgap.trial.simulation.arms import TrialArm
from armgap.trial.simulation.simulated_arm import Array, Trace

__all__ = ["MULTIPLE", "VISIBLE_SIGMAS", "Visibility", "visibility"]

#: A hidden effect is visible if the prediction error is at least this multiple of the floor.
MULTIPLE = 2.0
#: A hidden effect is visible if re-estimation moves the parameters by at least so many of the arm file's sigmas.
VISIBLE_SIGMAS = 5.0
#: Share of windows with the largest errors from which visibility is computed: contacts and external disturbances are rare.
_SHARE = 0.1


@dataclass(frozen=True)
class Visibility:
    """Visibility of a hidden effect in the logs of a case.

    Attributes
    ----------
    above_floor : float
        RMS error of predictions after re-estimation, as a multiple of the floor, at the joint where it is largest.
    moved : float
        Distance by which re-estimation moves the parameters, in the arm file's sigmas.
    """

    above_floor: float
    moved: float

    @property
    def visible(self) -> bool:
        """Whether the hidden effect is visible, so that a method can find it."""
        return self.above_floor >= MULTIPLE or self.moved >= VISIBLE_SIGMAS

    def to_dict(self) -> dict[str, Any]:
        """Return the visibility as a JSON object."""
        return {**asdict(self), "visible": self.visible}


def visibility(arm: TrialArm, plain: dict[str, Trace], logs: dict[str, Trace], everywhere: bool = True) -> Visibility:
    """Return the visibility of one hidden effect in the logs of a case.

    Parameters
    ----------
    arm : TrialArm
        The true arm.
    plain, logs : dict of str to Trace
        The logs without and with the effect.
    everywhere : bool, default True
        Whether the effect acts in all logs. If so, the smaller visibility of training and holdout logs
        counts; if not, as for an external pulse, that of the training logs.
    """
    m = Mechanism(arm.kind, arm.gravity, arm.length)
    theta = np.array(arm.theta)
    sigma = np.array(spread(arm, arm.theta))
    without = misses(m, theta, _windows(plain, ""))
    rounding = np.array(arm.step) / math.sqrt(12.0)  # standard deviation of rounding to encoder steps
    noise = np.maximum(np.median(np.sqrt(np.mean(without**2, axis=1)), axis=0), rounding)
    found = refit(m, theta, sigma, _windows(logs, "train"), noise)
    judged = ("train", "holdout") if everywhere else ("train",)
    floor = np.maximum(_worst(without), rounding)
    with_it = min((_worst(misses(m, found, _windows(logs, part))) / floor).max() for part in judged)
    moved = float(np.sqrt(np.sum(((found - theta) / sigma) ** 2)))
    return Visibility(float(f"{with_it:.4g}"), float(f"{moved:.4g}"))


def _windows(logs: dict[str, Trace], part: str) -> list[Window]:
    return [w for name, x in logs.items() if name.startswith(part) for w in cut(x.t, x.q, x.tau)]


def _worst(error: Array) -> Array:
    """Return the RMS prediction error per joint [rad or m] over the share `_SHARE` of windows with the largest errors."""
    squares = np.sort(np.mean(error**2, axis=1), axis=0)[::-1]
    rms: Array = np.sqrt(np.mean(squares[: max(1, round(_SHARE * len(squares)))], axis=0))
    return rms
