"""Export to URDF, the format of ROS and of most other simulators."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from armgap.arm.rigid_body import about_axis, about_com, rotation_between, rpy_of
from armgap.export.chain.model import SimulatorModel, number, numbers
from armgap.export.formats import header

if TYPE_CHECKING:
    from armgap.export.corrected import Corrected

__all__ = ["assumed", "inertia_entries", "render"]

Array = NDArray[np.float64]

#: Limit written where URDF requires one and none is known: beyond any motion of an arm, m and m/s (rad/s).
_UNKNOWN_LIMIT = 1e3
_DOWN = np.array([0.0, 0.0, -1.0])


def render(model: Corrected) -> str:
    """Return the text of a complete URDF file.

    Joint positions of the file are encoder readings. URDF has no gravity of its own: the base is mounted so that gravity acts along -z. URDF
    has no field for rotor inertia.

    Raises
    ------
    ExportError
        If no physically possible arm has the corrected parameters.
    """
    arm = model.simulated("urdf")
    root = ET.Element("robot", name=arm.name)
    for line in (*header.lines(model, "urdf"), *assumed(arm)):
        root.append(header.comment(line))
    taken = set(arm.chain.link_names)
    base = _free("base", taken)
    if (mounted := _mounting(arm.chain.gravity)) is not None:
        world = _free("world", taken)
        ET.SubElement(root, "link", name=world)
        ET.SubElement(root, "link", name=base)
        _fixed(root, _free("mount", set(arm.chain.joint_names)), world, base, rpy=mounted)
    else:
        ET.SubElement(root, "link", name=base)
    for j in range(len(arm.joints)):
        link = ET.SubElement(root, "link", name=arm.chain.link_names[j])
        inertial = ET.SubElement(link, "inertial")
        for tag, entries in inertia_entries(arm.inertial[j]):
            ET.SubElement(inertial, tag, entries)
        _joint(root, arm, j, base)
    if arm.tip is not None:
        tip = _free("tip", taken)
        ET.SubElement(root, "link", name=tip)
        _fixed(root, _free("to_tip", set(arm.chain.joint_names)), arm.chain.link_names[-1], tip, xyz=arm.tip)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def assumed(arm: SimulatorModel) -> list[str]:
    """Return remarks on settings that a simulator needs in addition to the URDF file, and on limits that are not known."""
    lines = [f"gravity is {np.linalg.norm(arm.chain.gravity):g} m/s^2 along -z: set it in the simulator"]
    if rotors := [
        f"{name} {number(joint.armature)}"
        for name, joint in zip(arm.chain.joint_names, arm.joints, strict=True)
        if joint.armature
    ]:
        lines.append(f"URDF has no rotor inertia: set as armature in the simulator, SI: {', '.join(rotors)}")
    if any(_limits(arm, j)[1] for j in range(len(arm.joints))):
        lines.append(f"limits of position, speed or torque that are not known are set to {_UNKNOWN_LIMIT:g}")
    return lines


def inertia_entries(ten: Array) -> list[tuple[str, dict[str, str]]]:
    """Return the elements inside a link's ``inertial`` element, with their attributes, for ten inertial parameters."""
    mass, com, i = about_com(ten)
    six = {"ixx": i[0, 0], "ixy": i[0, 1], "ixz": i[0, 2], "iyy": i[1, 1], "iyz": i[1, 2], "izz": i[2, 2]}
    return [
        ("origin", {"xyz": numbers(com), "rpy": "0 0 0"}),
        ("mass", {"value": number(mass)}),
        ("inertia", {name: number(value) for name, value in six.items()}),
    ]


def _mounting(gravity: Array) -> Array | None:
    """Return roll, pitch and yaw [rad] of the base in a world with gravity along -z; None for an upright base."""
    size = float(np.linalg.norm(gravity))
    if size == 0 or np.array_equal(gravity / size, _DOWN):
        return None
    return rpy_of(rotation_between(gravity / size, _DOWN))


def _free(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    return name


def _fixed(
    root: ET.Element, name: str, parent: str, child: str, xyz: Array | None = None, rpy: Array | None = None
) -> None:
    joint = ET.SubElement(root, "joint", name=name, type="fixed")
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    zero = np.zeros(3)
    ET.SubElement(joint, "origin", xyz=numbers(zero if xyz is None else xyz), rpy=numbers(zero if rpy is None else rpy))


def _joint(root: ET.Element, arm: SimulatorModel, j: int, base: str) -> None:
    chain, values = arm.chain, arm.joints[j]
    limits, _ = _limits(arm, j)
    slide, bounded = chain.kinds[j] == "prismatic", "lower" in limits
    kind = "prismatic" if slide else "revolute" if bounded else "continuous"
    joint = ET.SubElement(root, "joint", name=chain.joint_names[j], type=kind)
    ET.SubElement(joint, "parent", link=chain.link_names[j - 1] if j else base)
    ET.SubElement(joint, "child", link=chain.link_names[j])
    # Positions in the file are encoder readings: the joint's frame is placed where the reading is zero.
    axis, back = chain.axis[j], -values.reading
    shift = chain.translation[j] + (back * chain.rotation[j] @ axis if slide else 0.0)
    turned = chain.rotation[j] if slide else chain.rotation[j] @ about_axis(axis, back)
    ET.SubElement(joint, "origin", xyz=numbers(shift), rpy=numbers(rpy_of(turned)))
    ET.SubElement(joint, "axis", xyz=numbers(axis))
    ET.SubElement(joint, "dynamics", damping=number(values.viscous), friction=number(values.coulomb))
    if limits:
        ET.SubElement(joint, "limit", {name: number(value) for name, value in limits.items()})


def _limits(arm: SimulatorModel, j: int) -> tuple[dict[str, float], bool]:
    """Return the limits of a URDF joint, none for a continuous joint, and whether one of them is unknown."""
    chain, values = arm.chain, arm.joints[j]
    low, high, speed = float(chain.lower[j]), float(chain.upper[j]), float(chain.speed[j])
    effort = values.limit if values.limit is not None else float(chain.effort[j])
    bounded = math.isfinite(low) or math.isfinite(high) or chain.kinds[j] == "prismatic"
    if not (bounded or math.isfinite(effort) or math.isfinite(speed)):
        return {}, False
    found = {"effort": effort, "velocity": speed}
    if bounded:
        found |= {"lower": low + values.reading, "upper": high + values.reading}
    known = {name: min(max(value, -_UNKNOWN_LIMIT), _UNKNOWN_LIMIT) for name, value in found.items()}
    return known, known != found
