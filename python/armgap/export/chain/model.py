"""What simulators take: a chain of rigid bodies, and what sits at its joints."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armgap.arm.serial.chain import SerialChain
from armgap.export.chain.joint import Joint

__all__ = ["SimulatorModel", "number", "numbers"]

#: Longest time step of a simulation [s].
_TIME_STEP = 5e-4
#: Rate of decay by viscous friction, times the time step, up to which Runge-Kutta is used; it is stable to 2.8 (Hairer 1993, section IV.2).
_STABLE = 1.0
_POSES = 50


@dataclass(frozen=True)
class SimulatorModel:
    """An arm as MJCF and URDF describe one.

    Attributes
    ----------
    name : str
        Name of the arm.
    chain : SerialChain
        Joints with their placements, limits of position, and gravity in the frame of the base.
    inertial : ndarray, shape (n_joints, 10)
        Inertia of each link, see `armgap.arm.rigid_body`; each is that of a body.
    joints : tuple of Joint
        What sits at the joints.
    sample_period : float
        Sample period of the logs [s]; a time step divides it.
    tip : ndarray, shape (3,), optional
        Tip in the frame of the last link [m].
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
        """Integrator of MuJoCo for that step.

        Runge-Kutta of fourth order, whose errors are a tenth of those of the others; where viscous friction stops a joint too fast for it, or
        drives have a delay or a lag, which advance once a step, ``"implicitfast"``.
        """
        if any(joint.lag or joint.delay for joint in self.joints):
            return "implicitfast"
        n, rng = len(self.joints), np.random.default_rng(1)
        theta = np.concatenate([self.inertial.ravel(), [joint.armature for joint in self.joints], np.zeros(2 * n)])
        inertia = self.chain.native().inertia(theta, rng.uniform(-np.pi, np.pi, (_POSES, n)))
        rates = np.linalg.solve(inertia, np.diag([joint.viscous for joint in self.joints]))
        return "RK4" if np.abs(np.linalg.eigvals(rates)).max() * self.time_step < _STABLE else "implicitfast"


def number(value: float) -> str:
    """Return a number that reads back as itself."""
    return f"{value:.0f}" if float(value).is_integer() and abs(value) < 1e15 else repr(float(value))


def numbers(values: NDArray[np.float64]) -> str:
    """Return numbers that read back as themselves, with blanks between them."""
    return " ".join(number(value) for value in values)
