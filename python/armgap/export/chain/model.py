"""Model of an arm in the terms of simulators: a chain of rigid bodies with friction, springs and drives at its joints."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armgap.arm.serial.chain import SerialChain
from armgap.export.chain.joint import Joint

__all__ = ["SimulatorModel", "number", "numbers"]

#: Longest time step of an exported simulation [s].
_TIME_STEP = 5e-4
#: Decay rate by viscous friction, times the time step, up to which Runge-Kutta is used; the method is stable to 2.8 (Hairer 1993, section IV.2).
_STABLE = 1.0
#: Number of random poses at which the decay rate by viscous friction is computed.
_RANDOM_POSES = 50


@dataclass(frozen=True)
class SimulatorModel:
    """Model of an arm in terms that MJCF and URDF can describe.

    Attributes
    ----------
    name : str
        Name of the arm.
    chain : SerialChain
        Joints with their placements, limits of position, and gravity in the frame of the base.
    inertial : ndarray, shape (n_joints, 10)
        Ten inertial parameters of each link, see `armgap.arm.rigid_body` [SI]; physically consistent.
    joints : tuple of Joint
        Friction, springs, drive, encoder and stop of each joint.
    sample_period : float
        Sample period of the logs [s]; a whole multiple of the time step.
    tip : ndarray, shape (3,), optional
        Position of the tip in the frame of the last link [m].
    """

    name: str
    chain: SerialChain
    inertial: NDArray[np.float64]
    joints: tuple[Joint, ...]
    sample_period: float
    tip: NDArray[np.float64] | None = None

    @property
    def time_step(self) -> float:
        """Longest time step of 0.5 ms or less that divides the sample period [s]."""
        return self.sample_period / math.ceil(self.sample_period / _TIME_STEP - 1e-9)

    @property
    def integrator(self) -> str:
        """MuJoCo's integrator for the time step.

        Runge-Kutta of fourth order, whose errors are a tenth of those of other integrators; where viscous friction makes a joint too stiff for
        it, or drives have a delay or a lag, which advance once a step, ``"implicitfast"``.
        """
        if any(joint.lag or joint.delay for joint in self.joints):
            return "implicitfast"
        n, rng = len(self.joints), np.random.default_rng(1)
        theta = np.concatenate([self.inertial.ravel(), [joint.armature for joint in self.joints], np.zeros(2 * n)])
        inertia = self.chain.native().inertia(theta, rng.uniform(-np.pi, np.pi, (_RANDOM_POSES, n)))
        rates = np.linalg.solve(inertia, np.diag([joint.viscous for joint in self.joints]))
        return "RK4" if np.abs(np.linalg.eigvals(rates)).max() * self.time_step < _STABLE else "implicitfast"


def number(value: float) -> str:
    """Return the shortest text of a number that reads back as the same number."""
    return f"{value:.0f}" if float(value).is_integer() and abs(value) < 1e15 else repr(float(value))


def numbers(values: NDArray[np.float64]) -> str:
    """Return numbers, separated by blanks, as texts that read back as the same numbers."""
    return " ".join(number(value) for value in values)
