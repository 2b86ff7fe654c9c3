"""Default standard deviations of a serial arm's nominal parameters, where the arm file states none value by value.

Links
    One level of trust for all links, `Trust`, with a share t: the standard deviation of a link's mass m is ``t m``, of its first moments
    ``t m L``, of its inertias ``t m L^2``. L is the largest of the distance to the next joint, the distance to the centre of mass, and the radius of
    gyration, at least 5 % of the arm's reach (0.1 m for an arm without reach): a centre of mass on an axis, or an inertia of zero, is no better known
    than the rest of the link. ``"none"`` stands for values that are unknown: the standard deviation of the mass is what 100 kg per metre of L
    make, an order of magnitude above usual links (UR10: 15 to 25 kg/m, Panda: 10), and at least the mass itself.
Friction
    Half of each nominal coefficient. Without a nominal value, the standard deviation of Coulomb friction is a fifth of the largest expected torque of
    the joint: its limit of torque, or the largest gravity torque by the arm itself, but at least 2 % of that of any joint. That of viscous friction
    gives the same torque at 1 rad/s (0.2 m/s).
Rotors
    The nominal rotor inertia itself. Without a nominal value, the inertia that the joint moves with the arm stretched out, but at least 2 % of that
    of any joint: the last joints of geared arms carry little and have rotors of the same size.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from armgap.arm.rigid_body import about_com
from armgap.arm.serial.chain import SerialChain

__all__ = ["FRICTION_SHARE", "TRUSTS", "Scales", "Trust", "link_sigma"]

Array = NDArray[np.float64]
Trust = Literal["published", "cad", "guess", "none"]

TRUSTS: dict[Trust, float] = {"published": 0.1, "cad": 0.3, "guess": 1.0, "none": 1.0}
"""Standard deviation of a link's mass as a share of the mass, by level of trust in the arm's inertial parameters."""
#: Standard deviation of a friction coefficient that an arm file states, as a part of the coefficient.
FRICTION_SHARE = 0.5
#: Standard deviation of the mass of a link of unknown mass, per length of the link [kg/m]: more than the mass per length of any robot.
_UNKNOWN_KG_PER_M = 100.0
_USUAL_KG_PER_M = 10.0
"""Mass per length of a link without a mass in the description [kg/m], for scales of torque and inertia."""
#: Smallest characteristic length of a link, as a part of the arm's reach, and for an arm without reach [m].
_LEAST_REACH_SHARE = 0.05
_NO_REACH_M = 0.1
#: Standard deviation of unknown Coulomb friction, as a part of the joint's scale of torque.
_FRICTION_OF_TORQUE = 0.2
#: Smallest scale of torque or inertia of a joint, as a part of the largest over the arm's joints.
_LEAST_OF_LARGEST = 0.02
_GRAVITY = 9.81  # m/s^2; for scales of torque, whatever the gravity of the arm
# Speeds of rotary [rad/s] and linear joints [m/s] at which the standard deviations of unknown viscous and Coulomb friction torques are equal.
_TURNING_SPEED, _SLIDING_SPEED = 1.0, 0.2


class Scales:
    """Scales of length, torque, inertia and friction of an arm, for standard deviations of unknown parameters.

    Attributes
    ----------
    length : ndarray, shape (n,)
        Characteristic lengths of the links [m].
    torque : ndarray, shape (n,)
        Largest torques expected at the joints [N m or N].
    inertia : ndarray, shape (n,)
        Inertias moved by the joints [kg m^2 or kg].
    viscous, coulomb : ndarray, shape (n,)
        Standard deviations of unknown friction coefficients [SI].
    """

    def __init__(self, chain: SerialChain, inertial: Array) -> None:
        n, mass = chain.n_joints, inertial[:, 0]
        known = mass > 0
        step = np.append(np.linalg.norm(chain.translation[1:], axis=1), 0.0)
        com, gyration = np.zeros(n), np.zeros(n)
        for k in np.flatnonzero(known):
            _, centre, about = about_com(inertial[k])
            com[k] = np.linalg.norm(centre)
            gyration[k] = np.sqrt(max(float(np.trace(about)), 0.0) / (2 * mass[k]))
        reach = float(step.sum() + com[-1])
        least = _LEAST_REACH_SHARE * reach if reach > 0 else _NO_REACH_M
        self.length: Array = np.maximum.reduce([step, com, gyration, np.full(n, least)])
        moving = np.where(known, mass, _USUAL_KG_PER_M * self.length)
        centre_at = np.where(known, com, 0.5 * self.length)
        rotary = np.array(chain.rotary)
        torque, inertia = np.empty(n), np.empty(n)
        for j in range(n):
            arm = np.concatenate([[0.0], np.cumsum(step[j:-1])]) + centre_at[j:]
            m = moving[j:]
            weight, carried = (m * arm, m * (arm**2 + gyration[j:] ** 2)) if rotary[j] else (m, m)
            torque[j], inertia[j] = _GRAVITY * weight.sum(), carried.sum()
        for kind in (rotary, ~rotary):
            if kind.any():
                torque[kind] = np.maximum(torque[kind], _LEAST_OF_LARGEST * torque[kind].max())
                inertia[kind] = np.maximum(inertia[kind], _LEAST_OF_LARGEST * inertia[kind].max())
        self.torque: Array = np.where(np.isfinite(chain.effort), chain.effort, torque)
        self.inertia: Array = inertia
        self.coulomb: Array = _FRICTION_OF_TORQUE * self.torque
        self.viscous: Array = self.coulomb / np.where(rotary, _TURNING_SPEED, _SLIDING_SPEED)


def link_sigma(mass: Array, length: Array, trust: Trust) -> Array:
    """Return the standard deviations of the links' ten inertial parameters [SI], shape (n, 10).

    Parameters
    ----------
    mass, length : ndarray, shape (n,)
        Masses [kg] and characteristic lengths [m] of the links.
    trust : {"published", "cad", "guess", "none"}
        Level of trust in the inertial parameters.
    """
    sigma = TRUSTS[trust] * np.abs(mass)
    unknown = _UNKNOWN_KG_PER_M * length
    sigma = np.maximum(sigma, unknown) if trust == "none" else np.where(sigma > 0, sigma, unknown)
    powers = np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2])
    return np.asarray(np.maximum(sigma[:, None] * length[:, None] ** powers, np.finfo(np.float64).tiny))
