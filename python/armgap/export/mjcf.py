"""MJCF: the format of MuJoCo."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from armgap.export import header

if TYPE_CHECKING:
    from armgap.export.corrected import Corrected
    from armgap.export.joint import Joint

__all__ = ["render"]

#: Longest time step, s.
_TIME_STEP = 5e-4
#: Beyond any position.
_FAR = 1e6


def render(model: Corrected) -> str:
    """Return a complete MJCF file: bodies, joints, and one actuator per joint.

    Dry friction in MuJoCo is a soft constraint; the time constant and impedance written for it let a joint that is held
    creep by little. A position in this file is what the encoder shows.
    """
    root = ET.Element("mujoco", model=model.arm.name)
    for line in header.lines(model, "mjcf"):
        root.append(header.comment(line))
    model = model.uncoupled() or model
    step = model.arm.sample_period / math.ceil(model.arm.sample_period / _TIME_STEP - 1e-9)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    ET.SubElement(
        root,
        "option",
        timestep=number(step),
        gravity=f"0 0 {number(-model.arm.gravity)}",
        integrator="implicitfast",
    )
    parent = ET.SubElement(root, "worldbody")
    for j in range(len(model.joints)):
        parent = _link(parent, model, j, step)
    _stops(root, model)
    actuators = ET.SubElement(root, "actuator")
    for j, joint in enumerate(model.joints, start=1):
        _actuator(actuators, joint, j, step)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def number(value: float) -> str:
    """Return a number that reads back as itself."""
    return f"{value:.0f}" if float(value).is_integer() and abs(value) < 1e15 else repr(float(value))


def _link(parent: ET.Element, model: Corrected, j: int, step: float) -> ET.Element:
    links = model.built()
    place = {"pos": f"0 0 {number(-(links.length[j - 1] or 0.0))}"} if j else {}
    if j == 0 and model.tilt:
        place["euler"] = f"0 {number(model.tilt)} 0"
    body = ET.SubElement(parent, "body", {"name": f"link{j + 1}", **place})
    moment = number(links.inertia[j])
    ET.SubElement(
        body,
        "inertial",
        pos=f"0 0 {number(-links.com[j])}",
        mass=number(links.mass[j]),
        diaginertia=f"{moment} {moment} {moment}",
    )
    ET.SubElement(body, "joint", {"name": f"joint{j + 1}", **_joint(model, model.joints[j], step)})
    reach = links.length[j]
    if j == len(model.joints) - 1 and reach:
        ET.SubElement(body, "site", name="tip", pos=f"0 0 {number(-reach)}")
    return body


def _joint(model: Corrected, joint: Joint, step: float) -> dict[str, str]:
    slide = model.arm.kind == "axis"
    slope = model.built().slope
    entries = {
        "type": "slide" if slide else "hinge",
        "axis": f"{number(math.cos(slope))} 0 {number(math.sin(slope))}" if slide else "0 1 0",
        "damping": number(joint.viscous) + (f" {number(joint.drag)}" if joint.drag else ""),
        "frictionloss": number(joint.coulomb),
        "armature": number(joint.armature),
    }
    if joint.coulomb:
        entries |= {"solreffriction": f"{number(2 * step)} 1", "solimpfriction": "0.9999 0.9999 0.001 0.5 2"}
    if joint.stiffness or joint.cubic:
        hardening = f" 0 {number(joint.cubic)}" if joint.cubic else ""
        entries |= {"stiffness": number(joint.stiffness) + hardening, "springref": number(joint.rest + joint.reading)}
    if joint.reading:
        entries["ref"] = number(joint.reading)
    return entries


def _stops(root: ET.Element, model: Corrected) -> None:
    stops = [(j, joint.reading, joint.stop) for j, joint in enumerate(model.joints, start=1) if joint.stop]
    if not stops:
        return
    tendon = ET.SubElement(root, "tendon")
    for j, reading, (position, stiffness) in stops:
        edge = number(position + reading)
        free = f"{number(-_FAR)} {edge}" if position >= 0 else f"{edge} {number(_FAR)}"
        fixed = ET.SubElement(tendon, "fixed", name=f"stop{j}", stiffness=number(stiffness), springlength=free)
        ET.SubElement(fixed, "joint", joint=f"joint{j}", coef="1")


def _actuator(parent: ET.Element, joint: Joint, j: int, step: float) -> None:
    entries = {"name": f"motor{j}", "joint": f"joint{j}", "gainprm": number(joint.gain)}
    if joint.limit is not None:
        entries["ctrlrange"] = f"{number(-joint.limit)} {number(joint.limit)}"
    if joint.offset:
        entries |= {"biastype": "affine", "biasprm": f"{number(joint.offset)} 0 0"}
    if joint.lag:
        entries |= {"dyntype": "filterexact", "dynprm": number(joint.lag)}
    if joint.delay:
        steps = round(joint.delay / step)
        if steps:
            entries |= {"delay": number(steps * step), "nsample": str(steps + 1)}
    ET.SubElement(parent, "general", entries)
