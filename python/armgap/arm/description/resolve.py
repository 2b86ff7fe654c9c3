"""Resolution of a tree of links to a serial chain from base to tip; links behind joints that stand still are fused into the links before them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm_file import suggest
from armgap.arm.description.control import controlled, joint_remarks
from armgap.arm.description.resolved import ResolvedModel
from armgap.arm.description.tree import MOVING, Joint, Tree
from armgap.arm.rigid_body import about_axis, inconsistency, moved
from armgap.arm.serial.chain import JointKind, SerialChain

__all__ = ["Carried", "Located", "locate", "resolve"]

Array = NDArray[np.float64]

#: Largest number of joints or links that an error message lists.
_LISTED_LINKS = 12
# Largest distance between placements that count as equal [m]: what rounding of a description's numbers leaves.
_SAME_PLACE = 1e-6
_MOST_FOLLOWED = 16
# Values of joint damping and friction in descriptions that are placeholders: some tools write these values to stabilise a simulation.
_PLACEHOLDERS = (10.0, 100.0, 1000.0)


@dataclass(frozen=True)
class _Pose:
    """Rotation and translation from one frame to another."""

    rotation: Array
    translation: Array

    def then(self, rotation: Array, translation: Array) -> _Pose:
        return _Pose(self.rotation @ rotation, self.translation + self.rotation @ translation)


@dataclass(frozen=True)
class Carried:
    """A link of a description that one of the chain's links carries.

    Attributes
    ----------
    link : str
        Name of the carried link.
    rotation : ndarray, shape (3, 3)
        Axes of the carried link in the frame of the chain's link, as columns.
    translation : ndarray, shape (3,)
        Origin of the carried link in the frame of the chain's link [m].
    rigid : bool
        Whether only fixed joints lie between the chain's link and the carried link.
    """

    link: str
    rotation: Array
    translation: Array
    rigid: bool


@dataclass(frozen=True)
class Located:
    """Placement of a chain in the tree of a robot's description.

    Attributes
    ----------
    base : str
        The link in whose frame the chain begins.
    rotation : ndarray, shape (3, 3)
        Axes of the base's frame in the frame of the root link, as columns.
    translation : ndarray, shape (3,)
        Origin of the base's frame in the frame of the root link [m].
    before, behind : ndarray, shapes (3, 3) and (3,)
        Axes, as columns, and origin [m] of the link before the first joint in the frame of the base.
    carried : tuple of tuple of Carried
        Description links carried by each link of the chain, itself included.
    """

    base: str
    rotation: Array
    translation: Array
    before: Array
    behind: Array
    carried: tuple[tuple[Carried, ...], ...]


def _here() -> _Pose:
    return _Pose(np.eye(3), np.zeros(3))


def resolve(tree: Tree, *, base: str | None, tip: str | None, frozen: Mapping[str, float]) -> ResolvedModel:
    """Return the chain of the moving joints from `base` to `tip`.

    Parameters
    ----------
    tree : Tree
        Links and joints.
    base, tip : str, optional
        First and last link; by default the root link, and the end of the only branch with moving joints.
    frozen : mapping of str to float
        Positions of joints that stand still [rad or m]. Other joints outside the chain stand at 0, or at the limit next to 0.

    Raises
    ------
    ModelFileError
        If no chain, or more than one, fits; the message lists the links to choose from.
    """
    return _Resolver(tree, frozen).model(base, tip)


def locate(tree: Tree, chain: SerialChain, frozen: Mapping[str, float]) -> Located:
    """Return the placement of a chain in the description that it was resolved from.

    Parameters
    ----------
    tree : Tree
        Links and joints.
    chain : SerialChain
        Chain whose joints have the names and placements of the description's.
    frozen : mapping of str to float
        Positions of joints that stand still, as for `resolve`; other joints outside the chain stand at 0, or at the limit next to 0.

    Raises
    ------
    ModelFileError
        If the description is of another arm.
    """
    resolver = _Resolver(tree, frozen)
    return resolver.located(chain)


class _Resolver:
    def __init__(self, tree: Tree, frozen: Mapping[str, float]) -> None:
        self.tree = tree
        self.frozen = frozen
        self.still: dict[str, float] = {}
        """Positions [rad or m] of moving joints outside the chain for which no position was given, by name of the joint."""
        self.moved: list[str] = []
        """Names of the links that the chain's joints move."""
        for name in frozen:
            if name not in tree.joints:
                raise tree.error(None, f"has no joint `{name}` to freeze", suggest(name, self._movable()))
            if tree.joints[name].kind not in (*MOVING, "fixed"):
                raise tree.error(tree.joints[name], "cannot be frozen at one number", "begin the chain behind it")

    def _movable(self) -> list[str]:
        return [joint.name for joint in self.tree.joints.values() if joint.kind in MOVING]

    def _moves(self, joint: Joint) -> bool:
        return joint.kind in MOVING and joint.name not in self.frozen

    def model(self, base: str | None, tip: str | None) -> ResolvedModel:
        tree = self.tree
        base = self._base(base)
        tip = self._tip(base) if tip is None else self._known(tip, "tip")
        to_base, to_tip = tree.path(base), tree.path(tip)
        if to_tip[: len(to_base)] != to_base:
            problem = f"the tip `{tip}` does not hang on the base `{base}`"
            raise tree.error(None, problem, f"choose a tip below it: {', '.join(_few(self._below(base)))}")
        path = to_tip[len(to_base) :]
        for joint in path:
            self._check(joint)
        moving = [joint for joint in path if self._moves(joint)]
        if not moving:
            raise tree.error(None, f"no joint moves between `{base}` and `{tip}`", "choose another base or tip")
        placements, inertial = self._fused(path, base)
        remarks = joint_remarks(moving)
        controller, torque_limit, gravity = controlled(tree, moving, self.moved, self._gravity(to_base), remarks)
        chain = SerialChain(
            joint_names=tuple(joint.name for joint in moving),
            link_names=tuple(joint.child for joint in moving),
            kinds=tuple(_kind(joint) for joint in moving),
            rotation=np.array([pose.rotation for pose in placements]),
            translation=np.array([pose.translation for pose in placements]),
            axis=np.array([joint.axis for joint in moving]),
            gravity=gravity,
            lower=_values(moving, "lower"),
            upper=_values(moving, "upper"),
            speed=_values(moving, "speed"),
            acceleration=np.full(len(moving), math.inf),
            effort=_values(moving, "effort"),
        )
        notes = [*tree.notes, *self._said(chain, inertial), *remarks]
        viscous, coulomb = (self._friction(moving, name, notes) for name in ("viscous", "coulomb"))
        return ResolvedModel(
            name=tree.name,
            chain=chain,
            inertial=inertial,
            rotor_inertia=_values(moving, "rotor_inertia"),
            viscous=viscous,
            coulomb=coulomb,
            gear_ratio=_gear_ratio(moving, notes),
            controller=controller,
            torque_limit=torque_limit,
            notes=tuple(notes),
        )

    def _known(self, link: str, what: str) -> str:
        if link not in self.tree.links:
            raise self.tree.error(None, f"has no link `{link}` for a {what}", suggest(link, list(self.tree.links)))
        return link

    def _base(self, base: str | None) -> str:
        if base is not None:
            return self._known(base, "base")
        roots = [root for root in self.tree.roots if root in self.tree.child_joints] or self.tree.roots
        if len(roots) > 1:
            raise self.tree.error(None, f"has {len(roots)} roots", f"choose a base: {', '.join(_few(roots))}")
        return roots[0]

    def _below(self, base: str) -> list[str]:
        """Return the links that descend from the link `base`, deepest last."""
        found, ahead = [], [base]
        while ahead:
            link = ahead.pop(0)
            below = [joint.child for joint in self.tree.child_joints.get(link, ())]
            found += below
            ahead += below
        return found

    def _tip(self, base: str) -> str:
        """Return the last link of the only branch below `base` that has moving joints."""
        skip = len(self.tree.path(base))
        ends: dict[tuple[str, ...], str] = {}
        for link in (base, *self._below(base)):
            path = self.tree.path(link)[skip:]
            if link in self.tree.child_joints or any(joint.kind not in (*MOVING, "fixed") for joint in path):
                continue
            ends.setdefault(tuple(joint.name for joint in path if self._moves(joint)), link)
        longest = {joints: link for joints, link in ends.items() if not any(_begins(other, joints) for other in ends)}
        if len(longest) == 1:
            return next(iter(longest.values()))
        if not longest:
            raise self._no_branch(base)
        choices = [f"`{link}` ({_joints(joints)})" for joints, link in longest.items()]
        common = _common([[joint.child for joint in self.tree.path(link)[skip:]] for link in longest.values()])
        before = (
            tuple(joint.name for joint in self.tree.path(common[-1])[skip:] if self._moves(joint)) if common else ()
        )
        if before:
            choices.insert(0, f"`{common[-1]}` ({_joints(before)}), where they part")
        raise self.tree.error(None, "has several branches that move", f"choose a tip: {', '.join(_few(choices))}")

    def _no_branch(self, base: str) -> Exception:
        for link in self._below(base):
            for joint in self.tree.path(link):
                if joint.kind not in (*MOVING, "fixed"):
                    return self._unsupported(joint)
        return self.tree.error(None, f"nothing moves on `{base}`", "choose another base")

    def _unsupported(self, joint: Joint) -> Exception:
        problem = f"is {joint.kind}, not one of {', '.join(MOVING)}"
        return self.tree.error(joint, problem, f"begin the chain behind it with the base `{joint.child}`")

    def _check(self, joint: Joint) -> None:
        """Raise for a joint on the way from base to tip that a serial chain cannot have."""
        if joint.kind == "fixed":
            return
        if joint.kind not in MOVING:
            raise self._unsupported(joint)
        if joint.axis is None:
            raise self.tree.error(joint, "has a zero axis", "give the direction that it turns about or slides along")
        if joint.mimic is not None and self._moves(joint):
            problem = f"follows the joint `{joint.mimic.joint}` and does not move by itself"
            raise self.tree.error(joint, problem, f"freeze it ({joint.name} = POSITION), or end the chain before it")

    def _position(self, joint: Joint, followed: int = 0) -> float:
        """Return the position [rad or m] at which a joint outside the chain stands still."""
        if joint.name in self.frozen:
            return self.frozen[joint.name]
        position = 0.0
        if joint.mimic is not None and joint.mimic.joint in self.tree.joints and followed < _MOST_FOLLOWED:
            leader = self.tree.joints[joint.mimic.joint]
            position = joint.mimic.multiplier * self._position(leader, followed + 1) + joint.mimic.offset
        return min(max(position, joint.lower), joint.upper)

    def _moved(self, pose: _Pose, joint: Joint) -> _Pose:
        """Return the pose of the link behind a joint that stands still, from the pose of the link before the joint."""
        placed = pose.then(joint.rotation, joint.translation)
        if joint.kind == "fixed":
            return placed
        if joint.axis is None:
            raise self.tree.error(joint, "has a zero axis", "give the direction that it turns about or slides along")
        position = self._position(joint)
        if joint.kind == "prismatic":
            return placed.then(np.eye(3), position * joint.axis)
        return placed.then(about_axis(joint.axis, position), np.zeros(3))

    def _fused(self, path: list[Joint], base: str) -> tuple[list[_Pose], Array]:
        """Return the placements of the moving joints, and the ten inertial parameters of each link with all links fused into it."""
        placements: list[_Pose] = []
        inertial: list[Array] = []
        pose, link = _here(), base
        for joint in (*path, None):
            if inertial:
                inertial[-1] += self._hanging(link, pose, joint)
            if joint is None:
                break
            if self._moves(joint):
                placements.append(pose.then(joint.rotation, joint.translation))
                inertial.append(np.zeros(10))
                pose = _here()
            else:
                pose = self._moved(pose, joint)
            link = joint.child
        return placements, np.array(inertial)

    def _hanging(self, link: str, pose: _Pose, onward: Joint | None) -> Array:
        """Return the ten inertial parameters of a link with all links that hang on it, except those behind the chain's joint `onward`."""
        bodies = self._carried(link, pose, onward)
        self.moved += [body.link for body in bodies]
        return sum((moved(self.tree.links[b.link], b.rotation, b.translation) for b in bodies), np.zeros(10))

    def _carried(self, link: str, pose: _Pose, onward: Joint | None, *, rigid: bool = True) -> list[Carried]:
        """Return a link and all links that hang on it, with their placements, except those behind the chain's joint `onward`."""
        found: list[Carried] = []
        ahead = [(link, pose, rigid)]
        while ahead:
            name, at, fixed = ahead.pop()
            found.append(Carried(name, at.rotation, at.translation, fixed))
            for joint in self.tree.child_joints.get(name, ()):
                if joint is onward:
                    continue
                if joint.kind not in (*MOVING, "fixed"):
                    problem = f"is {joint.kind} and hangs on the chain"
                    raise self.tree.error(joint, problem, "take it out of the description")
                if self._moves(joint):
                    self.still[joint.name] = self._position(joint)
                ahead.append((joint.child, self._moved(at, joint), fixed and joint.kind == "fixed"))
        return found

    def located(self, chain: SerialChain) -> Located:
        """Return the placement of the chain in the tree; every moving joint outside the chain stands still."""
        tree, joints = self.tree, [self.tree.joints.get(name) for name in chain.joint_names]
        for name, joint in zip(chain.joint_names, joints, strict=True):
            if joint is None or joint.kind not in MOVING:
                raise tree.error(None, f"has no moving joint `{name}`", "give the description that the arm file is of")
        path = tree.path(joints[-1].child)  # type: ignore[union-attr]
        moving = [joint for joint in path if joint.name in chain.joint_names]
        if tuple(joint.name for joint in moving) != chain.joint_names:
            problem = "has the joints of the arm in another order or on several branches"
            raise tree.error(None, problem, "give the description that the arm file is of")
        carried: list[list[Carried]] = []
        poses: list[_Pose] = []
        pose, rigid = _here(), True
        bases = {path[0].parent: pose}
        for joint, onward in zip(path, [*path[1:], None], strict=True):
            if joint in moving:
                poses.append(pose.then(joint.rotation, joint.translation))
                carried.append([])
                pose, rigid = _here(), True
            else:
                pose, rigid = self._moved(pose, joint), rigid and joint.kind == "fixed"
            if carried:
                carried[-1] += self._carried(joint.child, pose, onward, rigid=rigid)
            else:
                bases[joint.child] = pose
        for j in range(1, chain.n_joints):
            self._same_place(chain, j, poses[j])
        base, at = self._base_of(chain, bases, poses[0])
        last = bases[moving[0].parent]
        before, behind = at.rotation.T @ last.rotation, at.rotation.T @ (last.translation - at.translation)
        return Located(base, at.rotation, at.translation, before, behind, tuple(map(tuple, carried)))

    def _base_of(self, chain: SerialChain, bases: dict[str, _Pose], first: _Pose) -> tuple[str, _Pose]:
        """Return the base link of the chain and its pose: the link before the first joint whose frame matches the chain's placement of that joint."""
        for name, at in bases.items():
            rotation = at.rotation.T @ first.rotation
            translation = at.rotation.T @ (first.translation - at.translation)
            if _close(rotation, chain.rotation[0]) and _close(translation, chain.translation[0]):
                return name, at
        self._same_place(chain, 0, first)
        raise AssertionError("the root is a base")

    def _same_place(self, chain: SerialChain, j: int, pose: _Pose) -> None:
        joint = self.tree.joints[chain.joint_names[j]]
        axis = joint.axis if joint.axis is not None else np.zeros(3)
        same = _close(pose.rotation, chain.rotation[j]) and _close(pose.translation, chain.translation[j])
        if not (same and _close(axis, chain.axis[j])):
            problem = "lies elsewhere than in the arm file"
            raise self.tree.error(
                joint, problem, "give the description of the arm file, and the frozen joints' positions"
            )

    def _gravity(self, to_base: Iterable[Joint]) -> Array:
        """Return the acceleration of gravity [m/s^2] in the frame of the chain's base, shape (3,)."""
        pose = _here()
        for joint in to_base:
            still = joint.kind in (*MOVING, "fixed")
            pose = self._moved(pose, joint) if still else pose.then(joint.rotation, joint.translation)
        return np.asarray(pose.rotation.T @ self.tree.gravity) + 0.0

    def _said(self, chain: SerialChain, inertial: Array) -> list[str]:
        """Return remarks about the chain and its links for `ResolvedModel.notes`."""
        notes = []
        if self.still:
            stands = ", ".join(_few([f"`{name}` at {value:g}" for name, value in self.still.items()]))
            notes.append(f"joints off the chain stand still: {stands}")
        for name, value in self.frozen.items():
            joint = self.tree.joints[name]
            if not joint.lower <= value <= joint.upper:
                notes.append(
                    f"joint `{name}` is frozen at {value:g}, outside its limits {joint.lower:g} to {joint.upper:g}"
                )
        down = chain.gravity / max(float(np.linalg.norm(chain.gravity)), 1e-12)
        if not np.allclose(down, [0, 0, -1], atol=1e-6) and chain.gravity.any():
            notes.append(f"gravity in the frame of the base is {', '.join(f'{g:.4g}' for g in chain.gravity)} m/s^2")
        if not inertial.any():
            return [*notes, "the description has no inertias: kinematics only, the links' values are unknown"]
        masses = inertial[:, 0]
        for name, ten in zip(chain.link_names, inertial, strict=True):
            if not ten.any():
                notes.append(f"link `{name}` has no inertia: its values are unknown")
            elif why := inconsistency(ten):
                notes.append(f"link `{name}` is no body: {why}")
        if len(masses) > 2 and np.all(masses == masses[0]):
            notes.append(f'every link has the mass {masses[0]:g} kg: a placeholder, it seems; use trust = "none"')
        return notes

    def _friction(self, moving: list[Joint], name: str, notes: list[str]) -> Array:
        """Return the joints' friction coefficients `name`; nan where the description has placeholders or no friction."""
        values = _values(moving, name)
        word = {"viscous": "damping", "coulomb": "friction"}[name]
        if np.any(values < 0):
            notes.append(f"a {word} is negative: taken as unknown")
            values = np.where(values < 0, math.nan, values)
        if self.tree.format != "URDF":
            return values
        usual = np.isin(values, _PLACEHOLDERS)
        rest = values[(values > 0) & ~usual]
        same = len(rest) > 1 and len(rest) >= 0.5 * len(values) and bool(np.all(rest == rest[0]))
        if same:
            notes.append(f"{word} {rest[0]:g} on all joints that have one: a placeholder, taken as unknown")
        if usual.any():
            notes.append(f"{word} of 10, 100 or 1000: a placeholder, taken as unknown")
        if same or usual.any():
            values = np.where(usual | (same & (values > 0)), math.nan, values)
        return values


def _close(one: Array, other: Array) -> bool:
    return bool(np.all(np.abs(one - other) <= _SAME_PLACE))


def _few(words: Iterable[str]) -> list[str]:
    listed = list(words)
    more = len(listed) - _LISTED_LINKS
    return listed if more <= 0 else [*listed[:_LISTED_LINKS], f"and {more} more"]


def _joints(names: tuple[str, ...]) -> str:
    return "1 joint" if len(names) == 1 else f"{len(names)} joints"


def _begins(longer: tuple[str, ...], shorter: tuple[str, ...]) -> bool:
    return len(longer) > len(shorter) and longer[: len(shorter)] == shorter


def _common(sequences: list[list[str]]) -> list[str]:
    """Return the common prefix of several sequences."""
    first, last = min(sequences), max(sequences)
    count = next((i for i, (a, b) in enumerate(zip(first, last, strict=False)) if a != b), min(len(first), len(last)))
    return first[:count]


def _kind(joint: Joint) -> JointKind:
    return "revolute" if joint.kind == "revolute" else "prismatic"


def _values(joints: list[Joint], name: str) -> Array:
    return np.array([getattr(joint, name) for joint in joints], dtype=np.float64)


def _gear_ratio(moving: list[Joint], notes: list[str]) -> Array | None:
    """Return the joints' gear ratios, shape (n,); None if a joint has no gear ratio, or if all are 1, which stands for unknown."""
    ratios = _values(moving, "reduction")
    if np.isnan(ratios).all() or np.all(ratios[np.isfinite(ratios)] == 1.0):
        return None
    if np.isnan(ratios).any():
        missing = ", ".join(f"`{joint.name}`" for joint in moving if math.isnan(joint.reduction))
        notes.append(f"gear ratios are left out: there is none for {missing}")
        return None
    return ratios
