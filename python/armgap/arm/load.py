"""Change of a planar arm's base parameters by a payload, a point mass on the last link."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm.arm import Arm

__all__ = ["first_length", "last_length", "payload_change"]


def payload_change(arm: Arm, mass: float, distance: float) -> NDArray[np.float64]:
    """Return the change of all parameters of a planar arm by a payload.

    Parameters
    ----------
    arm : Arm
        Nominal model of the arm, of a planar kind.
    mass : float
        Mass of the payload [kg].
    distance : float
        Distance of the mass from the axis of the last joint, along the last link [m].

    Returns
    -------
    ndarray, shape (n_parameters,)
        Change of the parameters [SI]; in proportion to the mass.
    """
    n = arm.n_joints
    masses, places, lengths = ([0.0] * (n - 1) + [x] for x in (mass, distance, 0.0))
    if n > 1:
        lengths[0] = first_length(arm)
    change = np.zeros(len(arm.theta))
    change[: arm.n_inertial] = _native.theta_from_links(arm.kind, arm.gravity, masses, lengths, places, [0.0] * n)
    if arm.kind == "axis" and arm.theta[0] > 0:
        change[1] = mass * arm.theta[1] / arm.theta[0]
    return change


def first_length(arm: Arm) -> float:
    """Return the length of link 1 of a planar arm [m]; by its parameters, or 0, where the arm file has none."""
    if arm.link_length is not None:
        return float(arm.link_length[0])
    return arm.gravity * float(arm.theta[1]) / float(arm.theta[4]) if arm.theta[4] > 0 else 0.0


def last_length(arm: Arm) -> float:
    """Return the length of the last link of a planar arm [m].

    Where the arm file has none, that of the simple pendulum with its inertia and weight, two thirds of a uniform rod's; 1 without gravity.
    """
    if arm.link_length is not None:
        return float(arm.link_length[-1])
    weights = arm.theta[arm.gravity_parameters]
    inertia = arm.theta[arm.n_inertial - len(weights) - 1] if len(weights) else 0.0
    return float(arm.gravity * inertia / weights[-1]) if len(weights) and weights[-1] > 0 and inertia > 0 else 1.0
