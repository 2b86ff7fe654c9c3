"""Coarsely quantised torques: many levels, all whole multiples of a step that is large relative to the torque's own variation.

A command with few levels by design, or that stays at each level for long and then jumps by more than one step, is not quantised.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.check.check import Check
from armgap.check.log_checks.numbers import blocks, grid_step
from armgap.check.log_checks.outcome import NOTHING, Outcome
from armgap.log.log import Log

__all__ = ["look"]

Array = NDArray[np.float64]

# Rounding error as a part of the torque's RMS variation from which quantisation is reported: as large as many an effect.
_MATTERS = 0.015
# Number of levels below which a torque counts as a command with levels by design, not as quantised, unless it leaves them soon and by one step.
_MIN_QUANTIZED_LEVELS = 8
# Changes of a torque's level that the check of quantisation needs.
_CHANGES = 40
# A torque counts as rounded if its median stay at a level is below so many rows, or if more than this share of its changes are of one step and
# the standard deviation of the stays exceeds this part of their mean.
_MEDIAN_STAY_ROWS, _ONE_STEP, _EQUALLY_LONG = 5, 0.5, 0.2


def look(log: Log, arm: Arm | None) -> Outcome:
    """Return the outcome with a check of the torques whose quantisation is coarse enough to matter."""
    found = []
    for j in range(log.tau.shape[1]):
        tau = np.concatenate([log.tau[rows, j] for rows in blocks(len(log))])
        spread = float(np.std(tau))
        step = grid_step(tau)
        if step is None or step / np.sqrt(12) <= _MATTERS * spread or not _rounded(tau, step):
            continue
        said = (
            f"tau{j + 1} moves in steps of {step:.3g}, {100 * step / spread:.2g} % of its RMS variation of {spread:.3g}"
        )
        remedy = ("log the torque with more digits",)
        found.append(Check("quantized_torque", "warning", said, remedy, j + 1, log.name))
    return Outcome(tuple(found)) if found else NOTHING


def _rounded(tau: Array, step: float) -> bool:
    """Whether a torque passes through its levels as a rounded continuous signal does."""
    moved = np.diff(tau)
    at = np.flatnonzero(np.abs(moved) > 0.5 * step)
    if len(at) < _CHANGES:
        return False
    stays = np.diff(at)
    brief = float(np.median(stays)) < _MEDIAN_STAY_ROWS
    single = float(np.mean(np.abs(moved[at]) < 1.5 * step)) > _ONE_STEP
    if len(np.unique(np.round(tau / step))) < _MIN_QUANTIZED_LEVELS:
        return brief and single
    return brief or (single and float(np.std(stays) / np.mean(stays)) > _EQUALLY_LONG)
