"""Writing of corrected parameters into the text of a URDF."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from armgap.arm.description.edit import XmlText
from armgap.arm.description.resolve import Located
from armgap.arm.description.xml import Element, parse, read_text
from armgap.arm.rigid_body import about_axis, rpy_matrix, rpy_of
from armgap.export.chain.model import number, numbers
from armgap.export.chain.serial import CorrectedSerial
from armgap.export.formats import header
from armgap.export.formats.urdf import assumed, inertia_entries

__all__ = ["write_urdf"]

Array = NDArray[np.float64]

_DOWN = np.array([0.0, 0.0, -1.0])
#: Difference of unit vectors of gravity below which the directions count as equal.
_EQUAL_DIRECTION_TOLERANCE = 1e-9


def write_urdf(
    model: CorrectedSerial, path: Path, located: Located, inertial: Mapping[str, Array]
) -> tuple[bytes, tuple[str, ...]]:
    """Return the text of a URDF with corrected inertias of links, and remarks.

    A tilt of the base rotates the first joint of the chain about the origin of the base. An encoder offset rotates the joint of the encoder.
    """
    data = read_text(path)
    root = parse(data, path)
    text = XmlText(data, path)
    remarks = (*model.remarks("urdf", original=True), *_mounting(model, located), *assumed(model.simulated("urdf"))[1:])
    for line in header.written(model, remarks):
        text.add(root, f"<!-- {header.in_comment(line)} -->")
    links = {element.attributes.get("name"): element for element in root.all("link")}
    for name, ten in inertial.items():
        lines = [_tag(tag, entries) for tag, entries in inertia_entries(ten)]
        block = "<inertial>\n" + "".join(f"  {line}\n" for line in lines) + "</inertial>"
        if (old := links[name].first("inertial")) is not None:
            text.replace(old, block)
        else:
            text.add(links[name], block)
    joints = {element.attributes.get("name"): element for element in root.all("joint")}
    for j, name in enumerate(model.chain.joint_names):
        _joint(model, text, joints[name], j, located)
    return text.render(), remarks


def _joint(model: CorrectedSerial, text: XmlText, element: Element, j: int, located: Located) -> None:
    joint = model.joints[j]
    _put(text, element, "dynamics", {"damping": number(joint.viscous), "friction": number(joint.coulomb)})
    limit = element.first("limit")
    if limit is not None:
        changed = {}
        if joint.limit is not None and any(c.effect == "torque_saturation" and c.joint == j + 1 for c in model.causes):
            changed["effort"] = number(joint.limit)
        if joint.reading:
            ends = ((end, limit.attributes.get(end)) for end in ("lower", "upper"))
            changed |= {end: number(float(value) + joint.reading) for end, value in ends if value is not None}
        if changed:
            text.set(limit, changed)
    tilted = j == 0 and not np.array_equal(model.tilt, np.eye(3))
    if not (tilted or joint.reading):
        return
    origin = element.first("origin")
    given = {} if origin is None else origin.attributes
    shift, rpy = (np.array(given.get(key, "0 0 0").split(), dtype=np.float64) for key in ("xyz", "rpy"))
    rotation = rpy_matrix(rpy)
    axis = model.chain.axis[j]
    if joint.reading and model.chain.kinds[j] == "prismatic":
        shift = shift - joint.reading * rotation @ axis
    elif joint.reading:
        rotation = rotation @ about_axis(axis, -joint.reading)
    if tilted:
        # The tilt is a rotation about the origin of the base; here it is expressed in the frame of the link before the joint.
        turn = located.before.T @ model.tilt @ located.before
        away = located.before.T @ (model.tilt @ located.behind - located.behind)
        shift, rotation = turn @ shift + away, turn @ rotation
    _put(text, element, "origin", {"xyz": numbers(shift), "rpy": numbers(rpy_of(rotation))})


def _put(text: XmlText, parent: Element, tag: str, entries: dict[str, str]) -> None:
    if (element := parent.first(tag)) is not None:
        text.set(element, entries)
    else:
        text.add(parent, _tag(tag, entries))


def _tag(tag: str, entries: Mapping[str, Any]) -> str:
    return f"<{tag} {' '.join(f'{name}={quoteattr(value)}' for name, value in entries.items())}/>"


def _mounting(model: CorrectedSerial, located: Located) -> tuple[str, ...]:
    """Return a remark on the direction of gravity in the frame of the root, if it is not -z."""
    # The estimated tilt is written to the joints, so the remark states gravity without it.
    nominal = located.rotation @ (model.tilt @ model.chain.gravity)
    size = float(np.linalg.norm(nominal))
    if size == 0 or np.max(np.abs(nominal / size - _DOWN)) < _EQUAL_DIRECTION_TOLERANCE:
        return (f"gravity is {size:g} m/s^2 along -z: set it in the simulator",)
    return (f"gravity in the frame of the root is {numbers(np.round(nominal, 6))} m/s^2: set it in the simulator",)
