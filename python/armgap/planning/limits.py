"""Limits of a planned motion: the arm file's, or the range of the diagnosed logs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm.arm import Arm, MotionLimits
from armgap.errors import ArmFileError

__all__ = ["PlanLimits", "limits_of"]

Array = NDArray[np.float64]

#: Part of a limit that a reference motion may use, as the arm overshoots its reference, by an eighth if the drive is slow or late.
MARGIN = 0.88
#: Part of the torque limit that the feed-forward torque may use under the diagnosis' best model, re-estimated and with its causes; the rest is left
#: to the controller.
TORQUE_MARGIN = 0.8
#: Part of the torque limit that the feed-forward torque may use under every model with an effect in question.
TORQUE_MOST = 0.95
#: Half width, in samples, of the local cubics by which the logs' accelerations are estimated.
_ACCELERATION_HALF_WIDTH = 10
#: Quantile of the logs' estimated accelerations that is taken as their largest, as the estimates scatter.
COVERED = 0.995
_REMEDY = "add a [limits] table with position_min, position_max, speed and acceleration"


@dataclass(frozen=True)
class PlanLimits:
    """Limits of a planned motion, with their source.

    Attributes
    ----------
    motion : MotionLimits
        Range of positions, largest speeds and accelerations, and obstacles.
    torque : ndarray of shape (n_joints,), optional
        Largest torque [N m or N]; None where the arm file names none.
    source : {"arm file", "logs"}
        Source of `motion`.
    home : ndarray, shape (n_joints,)
        Pose at which the motion begins and ends: zero, or the nearest pose within the limits [rad or m].
    """

    motion: MotionLimits
    torque: Array | None
    source: str
    home: Array

    def inner(self) -> MotionLimits:
        """Return the limits of a reference motion: those of the planned motion reduced to the part `MARGIN`."""
        m = self.motion
        middle, half = 0.5 * (m.position_min + m.position_max), 0.5 * MARGIN * (m.position_max - m.position_min)
        low, high = np.minimum(middle - half, self.home), np.maximum(middle + half, self.home)
        return MotionLimits(low, high, MARGIN * m.speed, MARGIN * m.acceleration)

    def to_dict(self) -> dict[str, Any]:
        """Return the limits as a JSON object."""
        m = self.motion
        space = m.space
        return {
            "position_min": m.position_min.tolist(),
            "position_max": m.position_max.tolist(),
            "speed": m.speed.tolist(),
            "acceleration": m.acceleration.tolist(),
            "torque": None if self.torque is None else self.torque.tolist(),
            "link_radius": None if space is None else space.link_radius.tolist(),
            "boxes": None if space is None else space.boxes.tolist(),
            "source": self.source,
        }


def limits_of(arm: Arm, data: dict[str, Any]) -> PlanLimits:
    """Return the limits for an arm and a diagnosis (its JSON object).

    Raises
    ------
    ArmFileError
        If the arm file has no limits and the diagnosis does not hold the range of its logs.
    """
    motion, source = (arm.limits, "arm file") if arm.limits is not None else (_covered(arm, data), "logs")
    home = np.clip(np.zeros(arm.n_joints), motion.position_min, motion.position_max)
    return PlanLimits(motion, arm.torque_limit, source, home)


def _covered(arm: Arm, data: dict[str, Any]) -> MotionLimits:
    """Return the range of the diagnosed logs as limits: positions and speeds from its regimes, accelerations from its curves."""
    columns = [_joint_covered(arm, data, j) for j in range(1, arm.n_joints + 1)]
    low, high, speed, acceleration = (np.array(column) for column in zip(*columns, strict=True))
    return MotionLimits(low, high, speed, acceleration)


def _joint_covered(arm: Arm, data: dict[str, Any], joint: int) -> tuple[float, float, float, float]:
    edges = {r["variable"]: r["edges"] for r in data.get("regimes") or [] if r["joint"] == joint}
    curves = [s for s in data.get("series") or [] if s["joint"] == joint and len(s["t"]) > 4 * _ACCELERATION_HALF_WIDTH]
    position, speed = edges.get(f"q{joint}"), edges.get(f"abs(dq{joint})")
    found = [np.abs(_acceleration(s)) for s in curves]
    if not (position and speed and found):
        problem = f"is missing, and the diagnosis does not say what its logs covered on joint {joint}"
        raise ArmFileError(problem, remedy=_REMEDY, file=arm.path, column="limits")
    acceleration = float(np.quantile(np.concatenate(found), COVERED))
    covered = float(position[0]), float(position[-1]), float(speed[-1]), acceleration
    if not (covered[0] < covered[1] and covered[2] > 0 and acceleration > 0):
        problem = f"is missing, and joint {joint} did not move in the diagnosed logs"
        raise ArmFileError(problem, remedy=_REMEDY, file=arm.path, column="limits")
    return covered


def _acceleration(curve: dict[str, Any]) -> Array:
    """Return the accelerations [rad/s^2 or m/s^2] of a measured curve of positions, from each stretch without gaps."""
    t, q = (np.asarray(curve[key], dtype=np.float64) for key in ("t", "measured"))
    gaps = np.flatnonzero(np.diff(t) > 1.5 * np.median(np.diff(t))) + 1
    found = []
    for stretch in np.split(np.arange(len(t)), gaps):
        if len(stretch) > 4 * _ACCELERATION_HALF_WIDTH:
            times = np.ascontiguousarray(t[stretch])
            speed = _native.velocity(
                times, np.ascontiguousarray(q[stretch][:, None]), "local-cubic", _ACCELERATION_HALF_WIDTH
            )
            rate = _native.velocity(times, np.ascontiguousarray(speed), "local-cubic", _ACCELERATION_HALF_WIDTH)
            found.append(rate[_ACCELERATION_HALF_WIDTH:-_ACCELERATION_HALF_WIDTH, 0])
    return np.concatenate(found) if found else np.zeros(1)
