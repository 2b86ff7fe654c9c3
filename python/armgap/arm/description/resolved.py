"""What a description says about one serial arm."""

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
        Ten inertial numbers of each link, see `armgap.arm.rigid_body`, with all that hangs rigidly on it.
    rotor_inertia, viscous, coulomb : ndarray, shape (n_joints,)
        Inertia of the rotors at the joints [kg m^2 or kg], friction coefficients [N m s/rad, N m; N s/m, N]; nan where unknown.
    gear_ratio : ndarray, shape (n_joints,), optional
        Turns of the motor per turn of the joint.
    sigma : ndarray, shape (n_joints, 10), optional
        Standard deviations of `inertial`; nan in the rows of links whose trust nobody states.
    controller : Controller, optional
        Position actuators of the description.
    notes : tuple of str
        What was taken how, and what looks wrong.
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
    notes: tuple[str, ...] = ()
