"""Export to MJCF, the format of MuJoCo."""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np

from armgap.arm.rigid_body import about_com
from armgap.export.chain.model import SimulatorModel, number, numbers
from armgap.export.formats import header

if TYPE_CHECKING:
    from armgap.export.chain.joint import Joint
    from armgap.export.corrected import Corrected

__all__ = ["FAR", "SHARP", "render"]

#: Position beyond any motion [rad or m], for the end of a range without limit.
FAR = 1e6
#: Impedance (`solimpfriction`) of dry friction in MuJoCo with which a loaded joint at rest creeps little.
SHARP = (0.9999, 0.9999, 0.001, 0.5, 2.0)


def render(model: Corrected) -> str:
    """Return the text of a complete MJCF file: bodies, joints, and one actuator per joint.

    Dry friction in MuJoCo is a soft constraint; with the time constant and impedance written, a loaded joint at rest
    creeps little. Joint positions of the file are encoder readings.

    Raises
    ------
    ExportError
        If no physically possible arm has the corrected parameters.
    """
    arm = model.simulated("mjcf")
    root = ET.Element("mujoco", model=arm.name)
    for line in header.lines(model, "mjcf"):
        root.append(header.comment(line))
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    gravity = numbers(arm.chain.gravity)
    ET.SubElement(root, "option", timestep=number(arm.time_step), gravity=gravity, integrator=arm.integrator)
    parent = ET.SubElement(root, "worldbody")
    for j in range(len(arm.joints)):
        parent = _link(parent, arm, j)
    if arm.tip is not None:
        ET.SubElement(parent, "site", name="tip", pos=numbers(arm.tip))
    _stops(root, arm)
    actuators = ET.SubElement(root, "actuator")
    for j in range(len(arm.joints)):
        _actuator(actuators, arm, j)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _link(parent: ET.Element, arm: SimulatorModel, j: int) -> ET.Element:
    rotation, translation = arm.chain.rotation[j], arm.chain.translation[j]
    placed = {"pos": numbers(translation)} if translation.any() else {}
    if not np.array_equal(rotation, np.eye(3)):
        placed["xyaxes"] = numbers(rotation[:, :2].T.ravel())
    body = ET.SubElement(parent, "body", {"name": arm.chain.link_names[j], **placed})
    mass, com, i = about_com(arm.inertial[j])
    six = np.array([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]])
    ET.SubElement(body, "inertial", pos=numbers(com), mass=number(mass), fullinertia=numbers(six))
    slide = arm.chain.kinds[j] == "prismatic"
    entries = {"type": "slide" if slide else "hinge", "axis": numbers(arm.chain.axis[j])}
    low, high = arm.chain.lower[j], arm.chain.upper[j]
    if np.isfinite(low) or np.isfinite(high):
        reading = arm.joints[j].reading
        entries["range"] = f"{number(max(low, -FAR) + reading)} {number(min(high, FAR) + reading)}"
    ET.SubElement(body, "joint", {"name": arm.chain.joint_names[j], **entries, **_joint(arm.joints[j], arm.time_step)})
    return body


def _joint(joint: Joint, step: float) -> dict[str, str]:
    entries = {
        "damping": numbers(joint.damping),
        "frictionloss": number(joint.coulomb),
        "armature": number(joint.armature),
    }
    if joint.coulomb:
        entries |= {"solreffriction": f"{number(2 * step)} 1", "solimpfriction": numbers(np.array(SHARP))}
    if joint.stiffness or joint.cubic:
        hardening = f" 0 {number(joint.cubic)}" if joint.cubic else ""
        entries |= {"stiffness": number(joint.stiffness) + hardening, "springref": number(joint.rest + joint.reading)}
    if joint.reading:
        entries["ref"] = number(joint.reading)
    return entries


def _stops(root: ET.Element, arm: SimulatorModel) -> None:
    stops = [(j, free) for j, joint in enumerate(arm.joints) if (free := joint.free(FAR)) is not None]
    if not stops:
        return
    tendon = ET.SubElement(root, "tendon")
    for j, (low, high, stiffness) in stops:
        springlength = f"{number(low)} {number(high)}"
        fixed = ET.SubElement(
            tendon, "fixed", name=f"stop{j + 1}", stiffness=number(stiffness), springlength=springlength
        )
        ET.SubElement(fixed, "joint", joint=arm.chain.joint_names[j], coef="1")


def _actuator(parent: ET.Element, arm: SimulatorModel, j: int) -> None:
    joint, step = arm.joints[j], arm.time_step
    entries = {"name": f"motor{j + 1}", "joint": arm.chain.joint_names[j], "gainprm": number(joint.gain)}
    if joint.limit is not None:
        entries["ctrlrange"] = f"{number(-joint.limit)} {number(joint.limit)}"
    if joint.offset:
        entries |= {"biastype": "affine", "biasprm": f"{number(joint.offset)} 0 0"}
    if joint.lag:
        entries |= {"dyntype": "filterexact", "dynprm": number(joint.lag)}
    if steps := round(joint.delay / step):
        entries |= {"delay": number(steps * step), "nsample": str(steps + 1)}
    ET.SubElement(parent, "general", entries)
