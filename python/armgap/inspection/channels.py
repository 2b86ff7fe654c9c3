"""Properties of each joint's position and torque in a log: steps, saturation, rest and motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armgap._renamed import old_names
from armgap.arm.arm import Arm
from armgap.log.log import Log

__all__ = ["FlatTop", "JointChannels", "joint", "step_of"]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__)

# Largest number of samples from which the step of a channel is determined.
_MAX_CHANNEL_SAMPLES = 200_000
# Largest number of changes of a channel between samples, the smallest ones, to which its step is fitted.
_SMALLEST = 2000
# Changes of a channel are whole multiples of a step if at least this share of them (second) lies this close (first, in steps).
_MULTIPLE_TOLERANCE, _WHOLE_MULTIPLES_SHARE = 0.05, 0.97
# Smallest number of samples in a row at its extreme for which a torque counts as cut off.
_FLAT_SAMPLES = 5
# Distance from a torque's extreme, as a part of the largest absolute torque, within which a sample counts as at the extreme.
_FLAT_MARGIN = 1e-6
# A joint counts as at rest if it moves over the time _SPAN_S by at most _REST_STEPS steps, or at most at the part _REST_SHARE of its top speed.
_SPAN_S = 0.02
_REST_STEPS = 2.0
_REST_SHARE = 1e-3


@dataclass(frozen=True)
class FlatTop:
    """A level [N m or N] at which a torque is cut off, with the share of the samples at this level and the longest time without a break [s]."""

    level: float
    share: float
    longest_s: float


@dataclass(frozen=True)
class JointChannels:
    """Properties of one joint's position and torque in a log.

    Attributes
    ----------
    joint : int
        Joint, counted from 1.
    q_range, tau_range : tuple of float
        Smallest and largest position [rad or m] and torque [N m or N]; no torque for a log of references.
    q_step, tau_step : float, optional
        Step of which all changes of position or torque are whole multiples; None without a step.
    q_step_arm : float, optional
        Encoder step that the arm file states [rad or m]; None where it states none.
    top_speed : float
        Speed exceeded for 1 % of the time [rad/s or m/s].
    rest, motion : float
        Shares of the time at rest and in motion.
    reversals : int
        Number of changes of the joint's direction of motion.
    flat_tops : tuple of FlatTop
        Levels at which the torque is cut off.
    """

    joint: int
    q_range: tuple[float, float]
    q_step: float | None
    q_step_arm: float | None
    tau_range: tuple[float, float] | None
    tau_step: float | None
    top_speed: float
    rest: float
    motion: float
    reversals: int
    flat_tops: tuple[FlatTop, ...]


def joint(log: Log, j: int, arm: Arm | None) -> JointChannels:
    """Return the properties of position and torque of joint `j` (from 0) in a log."""
    q = np.ascontiguousarray(log.q[:, j])
    tau = np.ascontiguousarray(log.tau[:, j]) if log.has_torques else None
    step = step_of(q)
    dq = _speeds(log.t, q, log.sample_period)
    top = float(np.quantile(np.abs(dq), 0.99)) if len(dq) else 0.0
    still = np.abs(dq) <= max(_REST_STEPS * (step or _smallest(q)) / _SPAN_S, _REST_SHARE * top)
    moving = np.sign(dq[~still])
    return JointChannels(
        joint=j + 1,
        q_range=(float(q.min()), float(q.max())),
        q_step=step,
        q_step_arm=None if arm is None or arm.encoder_step is None else float(arm.encoder_step[j]),
        tau_range=None if tau is None else (float(tau.min()), float(tau.max())),
        tau_step=None if tau is None else step_of(tau),
        top_speed=top,
        rest=float(still.mean()) if len(still) else 1.0,
        motion=float(1.0 - still.mean()) if len(still) else 0.0,
        reversals=int(np.sum(moving[1:] != moving[:-1])),
        flat_tops=() if tau is None else _flat_tops(tau, log.sample_period),
    )


def step_of(values: NDArray[np.float64]) -> float | None:
    """Return the step of which all changes of the values are whole multiples; None without a step.

    Examples
    --------
    >>> q = np.round(np.sin(np.arange(4000) / 50.0) / 2e-3) * 2e-3
    >>> round(step_of(q), 9), step_of(np.sin(np.arange(400) / 5.0))
    (0.002, None)
    """
    moved = np.abs(np.diff(values[:_MAX_CHANNEL_SAMPLES]))
    moved = np.sort(moved[moved > 1e-12 * max(float(np.abs(values[:_MAX_CHANNEL_SAMPLES]).max()), 1e-300)])[:_SMALLEST]
    if len(moved) < 20:
        return None
    # The smallest change seen may itself be several steps; the largest step that fits is taken.
    return next((step for parts in (1, 2, 3) if (step := _fitted(moved, float(moved[0]) / parts)) is not None), None)


def _fitted(moved: NDArray[np.float64], step: float) -> float | None:
    """Return the step nearest to a guess; None if changes are not whole multiples of it."""
    for most in (5, 50, 500):  # the step is fitted to small multiples first, so that errors of the guess do not add up
        multiples = np.round(moved / step)
        near = (multiples >= 1) & (multiples <= most)
        if near.any():
            step = float(np.sum(moved[near]) / np.sum(multiples[near]))
    off = np.abs(moved / step - np.round(moved / step))
    return step if float(np.mean(off < _MULTIPLE_TOLERANCE)) > _WHOLE_MULTIPLES_SHARE else None


def _smallest(values: NDArray[np.float64]) -> float:
    """Return the size of changes between samples at rest, for a channel without steps."""
    moved = np.abs(np.diff(values[:_MAX_CHANNEL_SAMPLES]))
    moved = moved[moved > 0]
    return float(np.quantile(moved, 0.05)) if len(moved) else 0.0


def _speeds(t: NDArray[np.float64], q: NDArray[np.float64], period: float) -> NDArray[np.float64]:
    stride = max(1, round(_SPAN_S / period))
    return np.asarray(np.diff(q[::stride]) / np.diff(t[::stride]))


def _flat_tops(tau: NDArray[np.float64], period: float) -> tuple[FlatTop, ...]:
    """Return the extremes at which a torque stays for several samples in a row, repeatedly or for long."""
    low, high = float(tau.min()), float(tau.max())
    margin = _FLAT_MARGIN * max(abs(low), abs(high))
    found = []
    for level in (high, low):
        there = np.abs(tau - level) <= margin
        edges = np.flatnonzero(np.diff(np.r_[False, there, False].astype(np.int8)))
        lengths = edges[1::2] - edges[::2]
        lengths = lengths[lengths >= _FLAT_SAMPLES]
        if len(lengths) and level != 0.0 and low != high:
            found.append(FlatTop(level, float(lengths.sum() / len(tau)), float(lengths.max() * period)))
    return tuple(found)
