"""A robot's description resolved to the model of one serial arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armgap.arm.controller import Controller
from armgap.arm.serial.chain import SerialChain

__all__ = ["ResolvedModel"]


@dataclass(frozen=True)
class ResolvedModel:
    """A chain with its links' inertia and its joints' nominal values.

    Attributes
    ----------
    name : str
        Name of the robot.
    chain : SerialChain
        The moving joints from base to tip.
    inertial : ndarray, shape (n_joints, 10)
        Ten inertial parameters of each link, see `armgap.arm.rigid_body`, including everything that is rigidly attached to the link.
    rotor_inertia, viscous, coulomb : ndarray, shape (n_joints,)
        Inertia of the rotors at the joints [kg m^2 or kg], friction coefficients [N m s/rad, N m; N s/m, N]; nan where unknown.
    gear_ratio : ndarray, shape (n_joints,), optional
        Turns of the motor per turn of the joint.
    sigma : ndarray, shape (n_joints, 10), optional
        Standard deviations of `inertial`; nan for links without stated trust.
    controller : Controller, optional
        Position actuators of the description.
    torque_limit : ndarray, shape (n_joints,), optional
        Largest torques of the position actuators [N m or N].
    notes : tuple of str
        Remarks on how elements of the description were read, and on suspicious values.
    """

    name: str
    chain: SerialChain
    inertial: NDArray[np.float64]
    rotor_inertia: NDArray[np.float64]
    viscous: NDArray[np.float64]
    coulomb: NDArray[np.float64]
    gear_ratio: NDArray[np.float64] | None = None
    sigma: NDArray[np.float64] | None = None
    controller: Controller | None = None
    torque_limit: NDArray[np.float64] | None = None
    notes: tuple[str, ...] = ()
