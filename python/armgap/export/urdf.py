"""URDF: the format of ROS and of most other simulators."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from armgap.export import header
from armgap.export.links import Links, physical
from armgap.export.mjcf import number

if TYPE_CHECKING:
    from armgap.export.corrected import Corrected

__all__ = ["render"]

#: URDF wants limits where a log tells none: beyond what any arm does, m and m/s (rad/s).
_FAR = 1e3


def render(model: Corrected) -> str:
    """Return a complete URDF file.

    A position in this file is what the encoder shows. URDF has no gravity of its own and no field for rotor inertia; that
    of the first joint is added to its link, which makes no difference.
    """
    links = _with_rotor(model)
    root = ET.Element("robot", name=model.arm.name)
    for line in (*header.lines(model, "urdf"), *_assumed(model)):
        root.append(header.comment(line))
    ET.SubElement(root, "link", name="base")
    for j in range(len(model.joints)):
        _add_link(root, links, j)
        _add_joint(root, model, links, j)
    _add_tip(root, links)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _assumed(model: Corrected) -> list[str]:
    lines = [f"gravity is {model.arm.gravity:g} m/s^2 along -z: set it in the simulator"]
    if model.arm.kind == "axis" or any(joint.limit is not None for joint in model.joints):
        lines.append(f"limits of position and speed are not known: they are set to {_FAR:g}")
    return lines


def _with_rotor(model: Corrected) -> Links:
    """Links with the rotor of the first joint in the first of them."""
    links, rotor = model.built(), model.joints[0].armature
    if model.arm.kind == "axis":
        return physical("axis", model.arm.gravity, [float(model.theta[0]) + rotor, float(model.theta[1])])
    return replace(links, inertia=(links.inertia[0] + rotor, *links.inertia[1:]))


def _add_link(root: ET.Element, links: Links, j: int) -> None:
    link = ET.SubElement(root, "link", name=f"link{j + 1}")
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=f"0 0 {number(-links.com[j])}", rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=number(links.mass[j]))
    moment = number(links.inertia[j])
    ET.SubElement(inertial, "inertia", ixx=moment, iyy=moment, izz=moment, ixy="0", ixz="0", iyz="0")


def _add_joint(root: ET.Element, model: Corrected, links: Links, j: int) -> None:
    values, slide, slope = model.joints[j], model.arm.kind == "axis", links.slope
    joint = ET.SubElement(root, "joint", name=f"joint{j + 1}", type="prismatic" if slide else "continuous")
    ET.SubElement(joint, "parent", link=f"link{j}" if j else "base")
    ET.SubElement(joint, "child", link=f"link{j + 1}")
    axis = (math.cos(slope), 0.0, math.sin(slope)) if slide else (0.0, 1.0, 0.0)
    back = [-values.reading * x for x in axis]
    shift = back if slide else [0.0, 0.0, -(links.length[j - 1] or 0.0) if j else 0.0]
    turn = 0.0 if slide else (model.tilt if j == 0 else 0.0) - values.reading
    ET.SubElement(joint, "origin", xyz=" ".join(number(x) for x in shift), rpy=f"0 {number(turn)} 0")
    ET.SubElement(joint, "axis", xyz=" ".join(number(x) for x in axis))
    ET.SubElement(joint, "dynamics", damping=number(values.viscous), friction=number(values.coulomb))
    if slide or values.limit is not None:
        far = {"lower": number(-_FAR), "upper": number(_FAR)} if slide else {}
        effort = number(values.limit if values.limit is not None else _FAR)
        ET.SubElement(joint, "limit", {"effort": effort, "velocity": number(_FAR), **far})


def _add_tip(root: ET.Element, links: Links) -> None:
    n, reach = len(links.mass), links.length[-1]
    if not reach:
        return
    ET.SubElement(root, "link", name="tip")
    joint = ET.SubElement(root, "joint", name="to_tip", type="fixed")
    ET.SubElement(joint, "parent", link=f"link{n}")
    ET.SubElement(joint, "child", link="tip")
    ET.SubElement(joint, "origin", xyz=f"0 0 {number(-reach)}", rpy="0 0 0")
