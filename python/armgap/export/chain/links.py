"""Physical link parameters with given base parameters.

Motion determines base parameters only: for the two-link arm five numbers, made of two masses, two centres of mass, two
inertias and the length of link 1. With ``s2 = m2 lc2``, ``S = m1 lc1 + m2 l1`` and ``B = theta1 - theta3``::

    theta2 = l1 s2        theta5 = g s2        so  l1 = g theta2/theta5
    theta3 = I2 + s2^2/m2                      so  m2 > s2^2/theta3 for I2 > 0
    B      = I1 + s1^2/m1 + m2 l1^2            so  m2 < B/l1^2,  m1 > s1^2/J1,  with s1 = S - m2 l1,  J1 = B - m2 l1^2

The interval of ``m2`` is not empty exactly if the inertia matrix is positive definite in every position, and any point of
the interval gives the same motion. Masses of the arm file are taken if they lie inside it. Otherwise ``m2`` is the middle of its interval,
where ``(m2 theta3 - s2^2)(B - m2 l1^2)`` is largest, which vanishes where either link becomes impossible; and
``m1 = s1^2/J1 + J1/l1^2``. Consistency in the sense of Wensing, Kim and Slotine (2018): positive masses, and moments of
inertia about the centre of mass that a distribution of positive mass can have.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armgap.export.errors import ExportError

if TYPE_CHECKING:
    from armgap.arm.arm import Arm

__all__ = ["Links", "links_of", "physical"]

#: Radius of gyration assumed for a moving mass that never turns, m.
_ANY_RADIUS = 0.1
#: Link length assumed where neither motion nor arm file determines one, m.
_ANY_LENGTH = 1.0
#: Relative difference of lengths below which they count as equal.
_SAME_LENGTH = 1e-6


@dataclass(frozen=True)
class Links:
    """Physical parameters per link [SI], with the choices made where motion does not determine them.

    Attributes
    ----------
    mass, com, inertia : tuple of float
        Mass [kg]; centre of mass along the link from the joint [m], negative beyond the joint; inertia about the centre of mass [kg m^2].
    length : tuple of (float or None)
        Length of each link [m]; None where neither motion nor arm file determines it.
    slope : float
        Inclination of a linear axis [rad].
    surplus : float
        Part of the constant force on a linear axis that exceeds its weight [N].
    choices : tuple of str
        Choices where motion does not determine a parameter, one sentence each.
    """

    mass: tuple[float, ...]
    com: tuple[float, ...]
    inertia: tuple[float, ...]
    length: tuple[float | None, ...]
    slope: float = 0.0
    surplus: float = 0.0
    choices: tuple[str, ...] = ()


def physical(
    kind: str,
    gravity: float,
    theta: Sequence[float],
    *,
    length: Sequence[float] | None = None,
    mass: Sequence[float] | None = None,
) -> Links:
    """Return physically possible link parameters whose base parameters are `theta`.

    Parameters
    ----------
    kind : {"axis", "pendulum", "two-link"}
        Kind of arm.
    gravity : float
        Acceleration of gravity [m/s^2].
    theta : sequence of float
        Inertial base parameters in the order of the kind.
    length, mass : sequence of float, optional
        Stated link lengths [m] and masses [kg].

    Raises
    ------
    ExportError
        If no physically possible arm has these base parameters; the message names the reason.

    Examples
    --------
    >>> links = physical("pendulum", 9.81, [0.05, 0.6], mass=[0.5])
    >>> round(links.com[0], 4), round(links.inertia[0], 4)
    (0.1223, 0.0425)
    """
    if kind not in _KINDS:
        raise ExportError(f"arms of kind `{kind}` cannot be exported", remedy=f"kinds that can: {', '.join(_KINDS)}")
    return _KINDS[kind](gravity, [float(x) for x in theta], length, mass)


def links_of(arm: Arm, theta: NDArray[np.float64]) -> tuple[Links | None, ExportError | None]:
    """Return link parameters with the base parameters `theta` and the arm file's lengths and masses, or the error why there are none."""
    length, mass = (None if x is None else x.tolist() for x in (arm.link_length, arm.link_mass))
    try:
        return physical(arm.kind, arm.gravity, theta[: arm.n_inertial].tolist(), length=length, mass=mass), None
    except ExportError as error:
        return None, error


def _axis(gravity: float, theta: list[float], length: Sequence[float] | None, mass: Sequence[float] | None) -> Links:
    moving, weight = theta
    _positive(moving, "the moving mass theta1")
    full = moving * gravity
    share = max(-1.0, min(1.0, weight / full)) if full > 0 else 0.0
    surplus = weight - full * share
    choices = []
    if abs(surplus) > 1e-12 * max(abs(weight), 1.0):
        choices.append(f"theta2 exceeds the weight of theta1 by {surplus:.4g} N, which stays as a constant force")
    inertia = moving * _ANY_RADIUS**2
    choices.append(f"inertia of the moving mass set to {inertia:.3g} kg m^2: it never turns")
    return Links((moving,), (0.0,), (inertia,), (None,), math.asin(share), surplus, tuple(choices))


def _pendulum(
    gravity: float, theta: list[float], length: Sequence[float] | None, mass: Sequence[float] | None
) -> Links:
    about_joint, torque = theta
    _positive(about_joint, "the inertia theta1")
    s = _moment(torque, gravity, "theta2")
    reach = length[0] if length else None
    scale = reach or (about_joint / abs(s) if s else _ANY_LENGTH)
    m, choice = _mass(1, s * s / about_joint, math.inf, s * s / about_joint + about_joint / scale**2, mass)
    return Links((m,), (s / m,), (about_joint - s * s / m,), (reach,), choices=(choice, _OTHER_AXES))


def _two_link(
    gravity: float, theta: list[float], length: Sequence[float] | None, mass: Sequence[float] | None
) -> Links:
    th1, th2, th3, th4, th5 = theta
    _positive(th3, "the inertia theta3")
    if th3 * (th1 - th3) <= th2 * th2:
        raise ExportError(
            "theta1, theta2 and theta3 give an inertia matrix that is not positive definite",
            remedy="no arm that could be built has them; see whether the logs excite both joints",
        )
    l1, choices = _first_length(gravity, th2, th5, length)
    s2, total = th2 / l1, _moment(th4, gravity, "theta4")
    rest = th1 - th3
    low, high = s2 * s2 / th3, rest / l1**2
    m2, choice2 = _mass(2, low, high, 0.5 * (low + high), mass)
    j1, s1 = rest - m2 * l1**2, total - m2 * l1
    m1, choice1 = _mass(1, s1 * s1 / j1, math.inf, s1 * s1 / j1 + j1 / l1**2, mass)
    return Links(
        (m1, m2),
        (s1 / m1, s2 / m2),
        (j1 - s1 * s1 / m1, th3 - s2 * s2 / m2),
        (l1, length[1] if length else None),
        choices=(*choices, choice1, choice2, _OTHER_AXES),
    )


def _first_length(
    gravity: float, th2: float, th5: float, length: Sequence[float] | None
) -> tuple[float, tuple[str, ...]]:
    """Return the length of link 1 [m] that theta2 and theta5 imply, or the stated one if they imply none, and notes on the choice."""
    stated = length[0] if length else None
    moment = _moment(th5, gravity, "theta5")
    if gravity == 0 or (th2 == 0 and moment == 0):
        chosen = stated or _ANY_LENGTH
        return chosen, () if stated else (f"length of link 1 set to {chosen:g} m: nothing determines it",)
    if 0 in (th2, moment) or (th2 > 0) != (moment > 0):
        raise ExportError(
            f"theta2 = {th2:.4g} and theta5 = {th5:.4g} imply a link 1 of length {_ratio(th2, moment)} m",
            remedy="state [geometry] link_length in the arm file and use --keep-lengths",
        )
    implied = th2 / moment
    if stated is None:
        return implied, (f"length of link 1 is {implied:.6g} m, which theta2 and theta5 imply",)
    if abs(implied - stated) <= _SAME_LENGTH * stated:
        return implied, ()
    note = f"length of link 1 is {implied:.6g} m, which theta2 and theta5 imply; the arm file states {stated:.6g} m"
    return implied, (note,)


def _ratio(a: float, b: float) -> str:
    return f"{a / b:.4g}" if b else "infinity"


def _moment(torque: float, gravity: float, name: str) -> float:
    """Return the first moment of mass [kg m] that causes the gravity torque `torque` [N m]."""
    if gravity > 0:
        return torque / gravity
    if torque != 0:
        raise ExportError(f"{name} is {torque:.4g} N m without gravity", remedy="state gravity in the arm file")
    return 0.0


def _mass(link: int, low: float, high: float, canonical: float, stated: Sequence[float] | None) -> tuple[float, str]:
    """Return a mass [kg] strictly between its bounds, the stated one if possible, else the canonical one, and a note on the choice."""
    span = f"above {low:.4g} kg" if math.isinf(high) else f"between {low:.4g} and {high:.4g} kg"
    if stated and low < stated[link - 1] < high:
        return stated[
            link - 1
        ], f"mass of link {link} is the arm file's {stated[link - 1]:.4g} kg; any mass {span} moves alike"
    why = f" (the arm file's {stated[link - 1]:.4g} kg is impossible with these values)" if stated else ""
    return canonical, f"mass of link {link} chosen as {canonical:.4g} kg{why}; any mass {span} moves alike"


def _positive(value: float, what: str) -> None:
    if not value > 0:
        raise ExportError(f"{what} is {value:.4g}, not positive", remedy="see whether the logs excite that joint")


_OTHER_AXES = "inertias about the two axes a planar arm never turns about are set equal to the one it does"
_KINDS = {"axis": _axis, "pendulum": _pendulum, "two-link": _two_link}
