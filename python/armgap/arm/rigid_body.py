"""Inertia of rigid bodies in ten inertial parameters, linear in the equation of motion: ``m, m cx, m cy, m cz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz``.

``c`` is the centre of mass and ``I`` the inertia about the origin of the body's frame, along its axes (Khalil 2002, section 9.3;
Featherstone 2008, section 2.13). The inertia about the centre of mass follows by the parallel axis theorem.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "INERTIAL_NAMES",
    "INERTIAL_UNITS",
    "about_axis",
    "about_com",
    "about_origin",
    "inconsistency",
    "moved",
    "pseudo_inertia",
    "rotation_between",
    "rpy_matrix",
    "rpy_of",
    "symmetric",
    "unit_axis",
]

Array = NDArray[np.float64]

INERTIAL_NAMES: tuple[str, ...] = ("mass", "mx", "my", "mz", "ixx", "ixy", "iyy", "ixz", "iyz", "izz")
"""Names of a body's ten inertial parameters; the joint's number is appended."""
INERTIAL_UNITS: tuple[str, ...] = ("kg", *["kg m"] * 3, *["kg m^2"] * 6)
#: Rows and columns of the six independent entries of a symmetric 3 x 3 matrix, in the order of arm files.
_ROWS, _COLUMNS = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)
# Size of a negative eigenvalue of an inertia that counts as rounding of the description, as a part of the inertia's trace.
_CONSISTENT = 1e-9
# Tolerance of a unit vector's length, and of sines and cosines at zero: a few times the rounding of double precision.
_UNIT = 4.0 * np.finfo(np.float64).eps


def symmetric(six: Sequence[float] | Array) -> Array:
    """Return the symmetric matrix, shape (3, 3), with the entries ``xx, xy, yy, xz, yz, zz``."""
    matrix = np.empty((3, 3))
    matrix[_ROWS, _COLUMNS] = six
    matrix[_COLUMNS, _ROWS] = six
    return matrix


def _six(matrix: Array) -> Array:
    return matrix[_ROWS, _COLUMNS]


def _steiner(mass: float, com: Array) -> Array:
    """Return the inertia of a point mass about the origin [kg m^2], shape (3, 3) (Steiner)."""
    return mass * (float(com @ com) * np.eye(3) - np.outer(com, com))


def about_origin(mass: float, com: Array, inertia: Array) -> Array:
    """Return a body's ten inertial parameters about the origin of its frame, shape (10,).

    Parameters
    ----------
    mass : float
        Mass [kg].
    com : ndarray, shape (3,)
        Centre of mass [m].
    inertia : ndarray, shape (3, 3)
        Inertia about the centre of mass, along the axes of the frame [kg m^2].
    """
    return np.concatenate([[mass], mass * com, _six(inertia + _steiner(mass, com))])


def about_com(ten: Array) -> tuple[float, Array, Array]:
    """Return mass, centre of mass and inertia about it from ten inertial parameters; the inverse of `about_origin`, for non-zero mass."""
    mass = float(ten[0])
    com = ten[1:4] / mass
    return mass, com, symmetric(ten[4:]) - _steiner(mass, com)


def moved(ten: Array, rotation: Array, translation: Array) -> Array:
    """Return a body's ten inertial parameters in another frame, shape (10,).

    Parameters
    ----------
    ten : ndarray, shape (10,)
        Inertial parameters in the body's own frame.
    rotation : ndarray, shape (3, 3)
        Axes of the body's frame in the other frame, as columns.
    translation : ndarray, shape (3,)
        Origin of the body's frame in the other frame [m].
    """
    mass, first = float(ten[0]), rotation @ ten[1:4]
    inertia = rotation @ symmetric(ten[4:]) @ rotation.T
    # Parallel axis theorem in first moments, because a massless body has no centre of mass.
    cross = np.outer(first, translation)
    inertia += (2.0 * float(first @ translation)) * np.eye(3) - cross - cross.T + _steiner(mass, translation)
    return np.concatenate([[mass], first + mass * translation, _six(inertia)])


def inconsistency(ten: Array) -> str:
    """Return why no body has these ten inertial parameters: the pseudo-inertia is not positive semi-definite (Wensing 2018); else empty.

    Returns
    -------
    str
        ``"mass is negative"``, or the principal moments about the centre of mass that break the triangle inequality.
    """
    mass = float(ten[0])
    if not np.isfinite(ten).all():
        return "its inertia is not finite"
    if mass < 0:
        return f"its mass is {mass:g} kg"
    if mass == 0:
        return "it has inertia and no mass" if np.any(ten[1:] != 0) else ""
    inertia = about_com(ten)[2]
    if not np.isfinite(inertia).all():
        return f"its mass of {mass:g} kg is too small for its first moments"
    covariance = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    if np.linalg.eigvalsh(covariance)[0] >= -_CONSISTENT * max(float(np.trace(symmetric(ten[4:]))), 0.0):
        return ""
    moments = ", ".join(f"{m:.3g}" for m in np.linalg.eigvalsh(inertia))
    return f"its principal moments {moments} kg m^2 break the triangle inequality"


def pseudo_inertia(ten: Array) -> Array:
    """Return the pseudo-inertia, shape (4, 4), of ten inertial parameters: linear in them and positive semi-definite for every body that can exist.

    Its upper left part is the second moment ``integral of x x' dm`` about the origin, its last column first moments and mass (Wensing, Kim and
    Slotine 2018, equation 6).
    """
    inertia = symmetric(ten[4:])
    second = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    return np.block([[second, ten[1:4, None]], [ten[None, 1:4], ten[:1, None]]])


def about_axis(axis: Array, angle: float) -> Array:
    """Return the rotation about a unit vector by an angle [rad], shape (3, 3) (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    half = math.sin(0.5 * angle)
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (2.0 * half * half) * (cross @ cross))


def rotation_between(start: Array, end: Array) -> Array:
    """Return the smallest rotation that turns one unit vector into another, shape (3, 3)."""
    normal, cosine = np.cross(start, end), float(start @ end)
    sine = float(np.linalg.norm(normal))
    if sine > _UNIT:
        return about_axis(normal / sine, math.atan2(sine, cosine))
    if cosine > 0:
        return np.eye(3)
    across = np.cross(start, np.eye(3)[int(np.argmin(np.abs(start)))])
    return about_axis(across / np.linalg.norm(across), math.pi)


def rpy_of(rotation: Array) -> Array:
    """Return roll, pitch and yaw [rad] of a rotation, shape (3,); the inverse of `rpy_matrix`, with a roll of zero where pitch is a right angle."""
    r = rotation
    level = math.hypot(r[0, 0], r[1, 0])
    pitch = math.atan2(-r[2, 0], level)
    if level < _UNIT:
        return np.array([0.0, pitch, math.atan2(-r[0, 1], r[1, 1])])
    return np.array([math.atan2(r[2, 1], r[2, 2]), pitch, math.atan2(r[1, 0], r[0, 0])]) + 0.0


def rpy_matrix(rpy: Sequence[float] | Array) -> Array:
    """Return the rotation by roll, pitch and yaw [rad] about the fixed axes x, y, z (URDF), shape (3, 3)."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(a), math.cos(a)) for a in rpy)
    matrix = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return matrix + 0.0  # no negative zeros


def unit_axis(axis: Sequence[float] | Array) -> Array | None:
    """Return an axis scaled to length 1, shape (3,); an axis of length 1 is returned unchanged to the last bit; None for a zero axis."""
    vector = np.array(axis, dtype=np.float64)
    largest = float(np.max(np.abs(vector)))
    if largest == 0:
        return None
    length = float(np.linalg.norm(vector))
    if abs(length - 1.0) <= _UNIT:
        return vector
    vector = vector / largest  # so that squares neither underflow nor overflow
    return vector / float(np.linalg.norm(vector))
