"""`torque_is_position`: a torque column holds the position reference of a servo.

A servo follows its reference: ``q_ref = q + a dq + b ddq`` with factor 1 of ``q``, and small ``a`` and ``b``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.check.check import Check
from armgap.check.equation_error import EquationError, Rows, bounds
from armgap.log.log import Log

__all__ = ["find"]

# Units of a position reference whose positions are in rad: rad, degrees, turns.
_UNITS = (1.0, 180.0 / np.pi, 0.5 / np.pi)
# Largest deviation from 1 of the factor between position and reference, and largest offset between the two as a part of the travel.
_NEAR_ONE = 0.15
_NEAR_ZERO = 0.15
# Longest response time of a servo [s]: its inertia term is smaller than this time squared. A hanging arm swings more slowly.
_SLOWEST = 0.1
# Largest share of the column's variance that the servo's equation may leave, and largest ratio to the share that the equation of motion leaves.
_MAX_SERVO_RESIDUAL = 0.05
_MAX_RESIDUAL_RATIO = 0.2
# Largest number of samples of a log that are used.
_MAX_LOG_SAMPLES = 4000


def find(logs: Sequence[Log], arm: Arm) -> list[Check]:
    """Return checks of the torque columns that hold commanded positions."""
    rows = [Rows.of(log, arm) for log in logs]
    base = EquationError(rows, arm)
    if not len(base):
        return []
    torque = np.minimum(base.of_torques(base.fit(*bounds(arm))).share, _in_any_unit(base, arm))
    checks = []
    for j in range(arm.n_joints):
        left = max(_servo(log, j) for log in logs)
        if left < _MAX_SERVO_RESIDUAL and left < _MAX_RESIDUAL_RATIO * float(torque[j]):
            message = (
                f"`tau{j + 1}` follows `q{j + 1}` like the reference of a position controller, to {100 * left:.2g} % of its variance; "
                f"as a torque {100 * min(float(torque[j]), 1.0):.0f} % of it stays unexplained"
            )
            remedy = f"--columns tau{j + 1}=NAME of the torque's own column"
            checks.append(Check("torque_is_position", "error", message, (remedy,), j + 1))
    return checks


def _in_any_unit(base: EquationError, arm: Arm) -> NDArray[np.float64]:
    """Return per torque column the share of its variance that the equation of motion leaves unexplained, if the torque may have any unit."""
    factors = base.expected()
    if np.any(factors <= 0):
        return np.ones(len(factors))
    return base.with_factors(*bounds(arm), factors).share


def _servo(log: Log, j: int) -> float:
    """Return the share of a torque column's variance that ``q + a dq + b ddq`` leaves; 1 if the column is no position reference of a servo."""
    t, q, tau = log.t[:_MAX_LOG_SAMPLES], log.q[:_MAX_LOG_SAMPLES, j], log.tau[:_MAX_LOG_SAMPLES, j]
    variance = float(np.var(tau))
    if variance == 0 or np.ptp(q) == 0:
        return 1.0
    dq = np.gradient(_smooth(q), t)
    ddq = np.gradient(_smooth(dq), t)
    a = np.column_stack([np.ones_like(q), q, dq, ddq])
    size = np.maximum(np.abs(a).max(axis=0), 1e-30)
    x = np.linalg.lstsq(a / size, tau, rcond=None)[0] / size
    follows = any(abs(x[1] / unit - 1.0) < _NEAR_ONE for unit in _UNITS) and abs(x[0]) < _NEAR_ZERO * float(np.ptp(tau))
    follows &= abs(x[3]) < _SLOWEST**2 * abs(x[1])
    return float(np.var(tau - a @ x)) / variance if follows else 1.0


def _smooth(x: NDArray[np.float64]) -> NDArray[np.float64]:
    kernel = np.ones(5) / 5
    padded = np.concatenate([np.full(2, x[0]), x, np.full(2, x[-1])])
    return np.convolve(padded, kernel, mode="valid")
