"""Reading of URDF: links with inertia, joints with axis, limits and friction; shapes, colours and simulators' own elements are ignored."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from armgap.arm.description.tree import MOVING, Joint, Mimic, Tree
from armgap.arm.description.xml import Element
from armgap.arm.rigid_body import about_origin, moved, rpy_matrix, symmetric, unit_axis
from armgap.errors import ModelFileError

__all__ = ["urdf_tree"]

Array = NDArray[np.float64]

_KINDS = {"continuous": "revolute", **{kind: kind for kind in (*MOVING, "fixed", "floating", "planar")}}
_INERTIA = ("ixx", "ixy", "iyy", "ixz", "iyz", "izz")
_GRAVITY = np.array([0.0, 0.0, -9.81])
_XACRO = "run `xacro FILE > robot.urdf` and give what it writes"


def urdf_tree(root: Element, path: Path) -> Tree:
    """Return links and joints of a URDF.

    Raises
    ------
    ModelFileError
        If a required element is missing or a value is no number; the message names the element and its line.
    """
    return _Urdf(root, path).tree()


class _Urdf:
    def __init__(self, root: Element, path: Path) -> None:
        self.root = root
        self.path = path
        self.notes: list[str] = []

    def tree(self) -> Tree:
        if (macro := next(_macros(self.root), None)) is not None:
            raise ModelFileError(
                f"is a xacro and no URDF yet: `{macro.tag}`", remedy=_XACRO, file=self.path, row=macro.row
            )
        links: dict[str, Array] = {}
        for element in self.root.all("link"):
            name = self._name(element)
            if name in links:
                self._fail(element, "is there twice", "give each link a name of its own")
            links[name] = self._inertial(element)
        joints: dict[str, Joint] = {}
        # Only children of the root element are joints of the robot; transmissions and sensors have elements of the same name inside.
        for element in self.root.all("joint"):
            joint = self._joint(element)
            if joint.name in joints:
                self._fail(element, "is there twice", "give each joint a name of its own")
            joints[joint.name] = joint
        if not links:
            raise ModelFileError("has no links", remedy="give the URDF of an arm", file=self.path)
        for name, reduction in self._reductions():
            if name in joints:
                joints[name] = replace(joints[name], reduction=reduction)
        name = self.root.attributes.get("name", "")
        return Tree(self.path, "URDF", name, links, joints, _GRAVITY, tuple(self.notes))

    def _fail(self, element: Element, problem: str, remedy: str) -> NoReturn:
        name = element.attributes.get("name")
        column = f"{element.tag} {name}" if name else element.tag
        macro = any(map(_is_macro, element.attributes.values()))
        raise ModelFileError(
            problem, remedy=_XACRO if macro else remedy, file=self.path, column=column, row=element.row
        )

    def _name(self, element: Element) -> str:
        name = element.attributes.get("name", "")
        if not name:
            self._fail(element, "has no name", "give it one")
        if _is_macro(name):
            self._fail(element, "is that of a xacro and no URDF yet", _XACRO)
        return name

    def _numbers(self, element: Element, key: str, default: tuple[float, ...] | None) -> Array:
        """Return the numbers of an XML attribute, as many as the default has; without a default, the one number of a required attribute."""
        text = element.attributes.get(key)
        if text is None:
            if default is None:
                self._fail(element, f"has no `{key}`", "add it")
            return np.array(default)
        count = 1 if default is None else len(default)
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != count or not all(map(math.isfinite, values)):
            wanted = "a finite number" if count == 1 else f"{count} finite numbers"
            self._fail(element, f"`{key}` is {text[:60]!r}, not {wanted}", "correct it")
        return np.array(values)

    def _number(self, element: Element, key: str, default: float | None = None) -> float:
        return float(self._numbers(element, key, None if default is None else (default,))[0])

    def _placement(self, element: Element) -> tuple[Array, Array]:
        origin = element.first("origin")
        if origin is None:
            return np.eye(3), np.zeros(3)
        zero = (0.0, 0.0, 0.0)
        return rpy_matrix(self._numbers(origin, "rpy", zero)), self._numbers(origin, "xyz", zero)

    def _inertial(self, link: Element) -> Array:
        """Return a link's ten inertial parameters; zeros for a link without an inertial element."""
        inertial = link.first("inertial")
        if inertial is None:
            return np.zeros(10)
        mass_element, inertia_element = inertial.first("mass"), inertial.first("inertia")
        mass = 0.0 if mass_element is None else self._number(mass_element, "value")
        six = np.zeros(6)
        if inertia_element is not None:
            six = np.array([self._number(inertia_element, key, 0.0) for key in _INERTIA])
        rotation, translation = self._placement(inertial)
        return moved(about_origin(mass, np.zeros(3), symmetric(six)), rotation, translation)

    def _joint(self, element: Element) -> Joint:
        name = self._name(element)
        word = element.attributes.get("type", "")
        if word not in _KINDS:
            self._fail(element, f"has the type `{word}`" if word else "has no type", f"known: {', '.join(_KINDS)}")
        ends = []
        for key in ("parent", "child"):
            end = element.first(key)
            if end is None or not end.attributes.get("link"):
                self._fail(element, f"has no {key} link", f'add <{key} link="..."/>')
            ends.append(end.attributes["link"])
        rotation, translation = self._placement(element)
        axis_element = element.first("axis")
        axis = (1.0, 0.0, 0.0)
        given = np.array(axis) if axis_element is None else self._numbers(axis_element, "xyz", axis)
        joint = Joint(
            name, ends[0], ends[1], _KINDS[word], rotation, translation, unit_axis(given), row=element.row,
            mimic=self._mimic(element),
        )  # fmt: skip
        joint = self._limited(joint, element.first("limit"), continuous=word == "continuous")
        dynamics = element.first("dynamics")
        if dynamics is not None:
            viscous, coulomb = (self._number(dynamics, key, 0.0) for key in ("damping", "friction"))
            joint = replace(joint, viscous=viscous, coulomb=coulomb)
        return joint

    def _limited(self, joint: Joint, limit: Element | None, *, continuous: bool) -> Joint:
        """Return the joint with its limits; limits of speed or torque that are zero, and limits of position that are both zero, count as unknown."""
        if limit is None:
            return joint
        lower, upper = (self._number(limit, key, 0.0) for key in ("lower", "upper"))
        speed, effort = (self._number(limit, key, 0.0) for key in ("velocity", "effort"))
        if continuous or lower == upper == 0.0:
            lower, upper = -math.inf, math.inf
        elif lower > upper:
            self.notes.append(f"the limits of joint `{joint.name}` are exchanged, {lower:g} to {upper:g}: left out")
            lower, upper = -math.inf, math.inf
        return replace(
            joint,
            lower=lower,
            upper=upper,
            speed=speed if speed > 0 else math.inf,
            effort=effort if effort > 0 else math.inf,
        )

    def _mimic(self, element: Element) -> Mimic | None:
        mimic = element.first("mimic")
        if mimic is None:
            return None
        other = mimic.attributes.get("joint", "")
        return Mimic(other, self._number(mimic, "multiplier", 1.0), self._number(mimic, "offset", 0.0))

    def _reductions(self) -> Iterator[tuple[str, float]]:
        """Yield names of joints with their gear ratios, given in the element of a transmission, of its joint or of its actuator."""
        for transmission in self.root.all("transmission"):
            joints, actuators = (list(transmission.all(tag)) for tag in ("joint", "actuator"))
            if len(joints) != 1:
                continue  # a differential transmission has no gear ratio of a single joint
            for holder in (transmission, *joints, *actuators):
                element = holder.first("mechanicalReduction")
                if element is None:
                    continue
                try:
                    value = float(element.text)
                except ValueError:
                    value = math.nan
                if not (math.isfinite(value) and value != 0):
                    text = element.text.strip()[:60]
                    self._fail(element, f"is {text!r}, not a number", "correct it")
                yield joints[0].attributes.get("name", ""), abs(value)


def _is_macro(text: str) -> bool:
    """Whether an attribute's value is an expression of xacro."""
    return "${" in text or "$(" in text


def _macros(root: Element) -> Iterator[Element]:
    """Yield the elements that only xacro understands."""
    ahead = [root]
    while ahead:
        element = ahead.pop()
        if element.tag.startswith("xacro:"):
            yield element
        ahead += element.children
