"""The chain of a serial arm: joints one after another from a fixed base, each with its placement, axis and limits."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm.rigid_body import INERTIAL_NAMES, INERTIAL_UNITS
from armgap.errors import OptionError

__all__ = ["JointKind", "SerialChain"]

JointKind = Literal["revolute", "prismatic"]

_SHAPES: dict[str, tuple[int, ...]] = {
    "rotation": (3, 3),
    "translation": (3,),
    "axis": (3,),
    "lower": (),
    "upper": (),
    "speed": (),
    "acceleration": (),
    "effort": (),
}


#: Largest sine of the angle between two axes that count as parallel: some hundredths of a degree of rounding in a description.
PARALLEL = 1e-3


def _unknown() -> NDArray[np.float64]:
    """Return an empty array, which stands for limits that are not given."""
    return np.empty(0)


@dataclass(frozen=True)
class SerialChain:
    """A serial chain of n joints.

    Joint j turns about, or slides along, `axis[j]` through the origin of its frame. The frame of joint j lies at `rotation[j]`,
    `translation[j]` in the frame of link j - 1 (of the base for the first joint), at position 0. The frame of link j is the joint's frame
    moved by the joint. All arrays are read-only.

    Attributes
    ----------
    joint_names, link_names : tuple of str
        Joints and the links that they move, from the base outwards, n of each.
    kinds : tuple of {"revolute", "prismatic"}
        Kind of each joint.
    rotation : ndarray, shape (n, 3, 3)
        Axes of each joint's frame in the frame of the preceding link, as columns.
    translation : ndarray, shape (n, 3)
        Origin of each joint's frame in the frame of the preceding link [m].
    axis : ndarray, shape (n, 3)
        Unit vector along the joint's axis, in the joint's frame.
    gravity : ndarray, shape (3,)
        Acceleration of gravity in the frame of the base [m/s^2].
    lower, upper : ndarray, shape (n,)
        Limits of position [rad or m]; -inf and inf where unknown, which is the default.
    speed : ndarray, shape (n,)
        Limits of speed [rad/s or m/s]; inf where unknown.
    acceleration : ndarray, shape (n,)
        Limits of acceleration [rad/s^2 or m/s^2]; inf where unknown.
    effort : ndarray, shape (n,)
        Limits of torque [N m or N] of the description; inf where unknown.
    """

    joint_names: tuple[str, ...]
    link_names: tuple[str, ...]
    kinds: tuple[JointKind, ...]
    rotation: NDArray[np.float64]
    translation: NDArray[np.float64]
    axis: NDArray[np.float64]
    gravity: NDArray[np.float64]
    lower: NDArray[np.float64] = field(default_factory=_unknown)
    upper: NDArray[np.float64] = field(default_factory=_unknown)
    speed: NDArray[np.float64] = field(default_factory=_unknown)
    acceleration: NDArray[np.float64] = field(default_factory=_unknown)
    effort: NDArray[np.float64] = field(default_factory=_unknown)

    def __post_init__(self) -> None:
        """Check the shapes of a chain's arrays, fill in limits that are not given, and make the arrays read-only.

        Raises
        ------
        OptionError
            If an array does not have one row per joint.
        """
        n = len(self.joint_names)
        for name, shape in (*((key, (n, *rest)) for key, rest in _SHAPES.items()), ("gravity", (3,))):
            values = np.array(getattr(self, name), dtype=np.float64)
            if not shape[1:] and values.size == 0 and name != "gravity":
                values = np.full(n, -np.inf if name == "lower" else np.inf)
            if values.shape != shape:
                raise OptionError(
                    f"`{name}` of the chain has shape {values.shape}", remedy=f"give {shape} for {n} joints"
                )
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if not (len(self.link_names) == len(self.kinds) == n > 0):
            raise OptionError("the chain's names and kinds differ in number", remedy="give one per joint")

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def rotary(self) -> tuple[bool, ...]:
        """Whether each joint is rotary."""
        return tuple(kind == "revolute" for kind in self.kinds)

    @property
    def parallel_joints(self) -> tuple[int, ...]:
        """Joints, from 1, that turn about an axis parallel to that of the preceding joint, which turns too."""
        before = np.einsum("jki,jk->ji", self.rotation[1:], self.axis[:-1])
        across = np.linalg.norm(np.cross(before, self.axis[1:]), axis=1)
        turn = self.rotary
        return tuple(j + 2 for j, sine in enumerate(across) if turn[j] and turn[j + 1] and sine < PARALLEL)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the 13 n parameters: ten per link, then rotor inertias, viscous and Coulomb coefficients per joint."""
        joints = range(1, self.n_joints + 1)
        links = [f"{name}{j}" for j in joints for name in INERTIAL_NAMES]
        return (*links, *(f"{name}{j}" for name in ("rotor", "viscous", "coulomb") for j in joints))

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Units of the 13 n parameters of a chain of n joints."""
        rotor = ["kg m^2" if turns else "kg" for turns in self.rotary]
        viscous = ["N m s/rad" if turns else "N s/m" for turns in self.rotary]
        coulomb = ["N m" if turns else "N" for turns in self.rotary]
        return (*(INERTIAL_UNITS * self.n_joints), *rotor, *viscous, *coulomb)

    def native(self) -> _native.Chain:
        """Return the dynamics of the chain: inertia matrices, torques and regressors over arrays of states, and its simulation.

        Raises
        ------
        OptionError
            If the chain has more joints than the compiled core supports.
        """
        try:
            return _native.Chain(list(self.kinds), self.rotation, self.translation, self.axis, self.gravity)
        except ValueError as error:
            raise OptionError(
                str(error),
                remedy="freeze joints that stand still: armgap model ROBOT.urdf --freeze JOINT=POSITION -o ARM.toml",
            ) from None

    def to_native(self) -> dict[str, Any]:
        """Return the chain as the dict of nested lists that the compiled core reads."""
        return {
            "kinds": list(self.kinds),
            "rotation": self.rotation.tolist(),
            "translation": self.translation.tolist(),
            "axis": self.axis.tolist(),
            "gravity": self.gravity.tolist(),
        }
