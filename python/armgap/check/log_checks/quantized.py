"""Torques in steps that matter: many levels, all whole multiples of a step that is large beside the torque's own spread.

A command that has few levels because it was made so, or that stays at each for long and then goes somewhere else, is not rounded.
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

# Rounding by this part of the torque's RMS variation is as large as many an effect.
_MATTERS = 0.015
# Fewer levels are a command's own.
_LEVELS = 8
# Changes of level that have to be seen.
_CHANGES = 40
# A command that stays at a level for so many rows as a rule, and then goes more than one step, or stays equally long, was made so.
_STAYS, _ONE_STEP, _EQUALLY_LONG = 5, 0.5, 0.2


def look(log: Log, arm: Arm | None) -> Outcome:
    """Say which torques are rounded so that it matters."""
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
    """Whether levels are passed as a rounded signal passes them."""
    if len(np.unique(np.round(tau / step))) < _LEVELS:
        return False
    moved = np.diff(tau)
    at = np.flatnonzero(np.abs(moved) > 0.5 * step)
    if len(at) < _CHANGES:
        return False
    stays = np.diff(at)
    if float(np.median(stays)) < _STAYS:
        return True
    single = float(np.mean(np.abs(moved[at]) < 1.5 * step))
    return single > _ONE_STEP and float(np.std(stays) / np.mean(stays)) > _EQUALLY_LONG
