"""A robot's description as a tree of links and joints."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armgap.errors import ModelFileError

__all__ = ["MOVING", "Joint", "Mimic", "Tree"]

Array = NDArray[np.float64]

MOVING = ("revolute", "prismatic")
"""Kinds of joint that a serial chain can have; joints of other kinds are ``"fixed"``, or have several degrees of freedom."""


@dataclass(frozen=True)
class Mimic:
    """Coupling of a joint to another joint: its position is ``multiplier`` times the position of `joint`, plus `offset` [rad or m]."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Joint:
    """One joint of a description.

    Attributes
    ----------
    name, parent, child : str
        Names of the joint, its parent link and its child link.
    kind : str
        ``"revolute"``, ``"prismatic"``, ``"fixed"``, or the description's own word for a joint with more degrees of freedom.
    rotation : ndarray, shape (3, 3)
        Axes of the joint's frame in the frame of the parent link, as columns, at position 0.
    translation : ndarray, shape (3,)
        Origin of the joint's frame in the frame of the parent link [m].
    axis : ndarray, shape (3,), optional
        Unit vector along the joint's axis, in the joint's frame; None if the description gives a zero axis.
    lower, upper, speed, effort : float
        Limits of position [rad or m], speed [rad/s or m/s] and torque [N m or N]; infinite where unknown.
    viscous, coulomb, rotor_inertia : float
        Friction coefficients and inertia of the rotor at the joint [SI]; nan where unknown.
    reduction : float
        Turns of the motor per turn of the joint; nan where unknown.
    kp, kd : float
        Gains of the joint's position actuator [SI]; nan without one.
    mimic : Mimic, optional
        Coupling to the joint that this joint follows.
    row : int, optional
        Line of the joint in the description's file.
    remarks : mapping of str to str
        What the description says of the joint that the chain has no place for, or that was taken in a certain way: words for all joints
        alike, and details of this joint, which may be empty.
    """

    name: str
    parent: str
    child: str
    kind: str
    rotation: Array
    translation: Array
    axis: Array | None = None
    lower: float = -math.inf
    upper: float = math.inf
    speed: float = math.inf
    effort: float = math.inf
    viscous: float = math.nan
    coulomb: float = math.nan
    rotor_inertia: float = math.nan
    reduction: float = math.nan
    kp: float = math.nan
    kd: float = math.nan
    mimic: Mimic | None = None
    row: int | None = None
    remarks: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Tree:
    """Links and joints of a description, checked to be a forest.

    Attributes
    ----------
    file : Path
        File of the description.
    format : str
        ``"URDF"`` or ``"MJCF"``.
    name : str
        Name of the robot.
    links : mapping of str to ndarray, shape (10,)
        Inertia of each link about the origin of its frame, see `armgap.arm.rigid_body`; zeros where the description has none.
    joints : mapping of str to Joint
        Joints in the order of the file.
    gravity : ndarray, shape (3,)
        Acceleration of gravity in the frame of the root link [m/s^2].
    notes : tuple of str
        Remarks from reading the description.
    compensated : mapping of str to float
        Share of each link's weight that the description's simulator carries; 0 for links that are not in it.

    Raises
    ------
    ModelFileError
        If a joint names a missing link, a link has two parents, or links form a loop.
    """

    file: Path
    format: str
    name: str
    links: Mapping[str, Array]
    joints: Mapping[str, Joint]
    gravity: Array
    notes: tuple[str, ...] = ()
    compensated: Mapping[str, float] = field(default_factory=dict)
    parent_joint: dict[str, Joint] = field(init=False, default_factory=dict)
    """Joint that moves each link, by name of the link; root links have no entry."""
    child_joints: dict[str, list[Joint]] = field(init=False, default_factory=dict)
    """Joints that each link is the parent of, by name of the link."""

    def __post_init__(self) -> None:
        """Check that the links of all joints exist, and index joints by parent and child link."""
        for joint in self.joints.values():
            for what, link in (("parent", joint.parent), ("child", joint.child)):
                if link not in self.links:
                    raise self.error(joint, f"its {what} `{link}` is no link", "add the link, or correct the name")
            if joint.child in self.parent_joint:
                other = self.parent_joint[joint.child].name
                problem = f"moves the link `{joint.child}`, as the joint `{other}` does"
                raise self.error(joint, problem, "give each link one parent; closed chains are not supported")
            self.parent_joint[joint.child] = joint
            self.child_joints.setdefault(joint.parent, []).append(joint)
        reached = set(self.roots)
        ahead = list(reached)
        while ahead:
            below = [joint.child for joint in self.child_joints.get(ahead.pop(), ())]
            reached.update(below)
            ahead += below
        for joint in self.joints.values():
            if joint.child not in reached:
                raise self.error(joint, "is part of a circle of links", "correct parent and child of its joints")

    @property
    def roots(self) -> list[str]:
        """Names of the links that no joint moves."""
        return [link for link in self.links if link not in self.parent_joint]

    def path(self, link: str) -> list[Joint]:
        """Return the joints from the root link to a link."""
        joints: list[Joint] = []
        while link in self.parent_joint:
            joints.append(self.parent_joint[link])
            link = joints[-1].parent
        return joints[::-1]

    def error(self, joint: Joint | None, problem: str, remedy: str) -> ModelFileError:
        """Return an error about a joint, or about the whole description if `joint` is None."""
        column, row = (None, None) if joint is None else (f"joint {joint.name}", joint.row)
        return ModelFileError(problem, remedy=remedy, file=self.file, column=column, row=row)
