"""Writing of corrected parameters into an MJCF model, through MuJoCo's own model specification."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.arm.description.resolve import Located
from armgap.arm.description.tree import Tree
from armgap.arm.rigid_body import about_com, moved
from armgap.errors import ModelFileError
from armgap.export.chain.joint import Joint
from armgap.export.chain.serial import CorrectedSerial
from armgap.export.errors import ExportError
from armgap.export.formats import header
from armgap.export.formats.mjcf import FAR, SHARP
from armgap.export.formats.servos import driving, write_servo

__all__ = ["write_mjcf"]

Array = NDArray[np.float64]

_ROOT = re.compile(r"<mujoco[^>]*>")


def write_mjcf(
    model: CorrectedSerial, tree: Tree, located: Located, inertial: Mapping[str, Array]
) -> tuple[bytes, tuple[str, ...]]:
    """Return the text of an MJCF model with corrected inertias of bodies, and remarks.

    MuJoCo writes the file: included files become part of it, numbers have six digits.

    Raises
    ------
    ExportError
        If a link of the arm shares its body with another one.
    ModelFileError
        If MuJoCo refuses the corrected model.
    """
    import mujoco

    spec = mujoco.MjSpec.from_file(str(tree.file))
    compiled = spec.compile()
    writer = _Writer(mujoco, spec, compiled, model)
    writer.inertias(inertial, tree)
    for j, joint in enumerate(model.joints):
        writer.joint(model.chain.joint_names[j], joint, j)
    spec.option.gravity = located.rotation @ model.chain.gravity
    try:
        spec.compile()
    except ValueError as error:
        said = " ".join(str(error).split())[:300]
        raise ModelFileError(
            f"MuJoCo refuses it with the corrected values: {said}", remedy="export without --model", file=tree.file
        ) from None
    remarks = (*model.remarks("mjcf", original=True), *writer.remarks)
    lines = "".join(f"\n  <!-- {header.in_comment(line)} -->" for line in header.written(model, remarks))
    text = _ROOT.sub(lambda match: match[0] + lines, spec.to_xml(), count=1)
    return text.encode(), remarks


class _Writer:
    def __init__(self, mujoco: Any, spec: Any, compiled: Any, model: CorrectedSerial) -> None:
        self.mujoco = mujoco
        self.spec = spec
        self.compiled = compiled
        self.model = model
        self.remarks: list[str] = []
        self.angle = math.degrees(1.0) if spec.compiler.degree else 1.0
        """Number of the file's units of angle, degrees or radians, in one radian."""

    def inertias(self, inertial: Mapping[str, Array], tree: Tree) -> None:
        bodies = {body.name or f"body{body.id}": body for body in self.spec.bodies}
        for name in inertial:
            if name not in bodies:
                raise ExportError(
                    f"the body of link `{name}` has more than one joint",
                    remedy="give each joint a body of its own",
                    file=tree.file,
                )
        if self.spec.compiler.inertiafromgeom == self.mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
            # From here on MuJoCo uses the inertias that are stated, so the computed ones of all bodies are written.
            self.spec.compiler.inertiafromgeom = self.mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
            m = self.compiled
            for body in list(bodies.values())[1:]:
                self._state(
                    body,
                    float(m.body_mass[body.id]),
                    m.body_ipos[body.id],
                    m.body_iquat[body.id],
                    m.body_inertia[body.id],
                )
        for name, ten in inertial.items():
            body = bodies[name]
            last = int(self.compiled.body_jntadr[body.id] + self.compiled.body_jntnum[body.id]) - 1
            anchor = self.compiled.jnt_pos[last] if self.compiled.body_jntnum[body.id] else np.zeros(3)
            mass, com, inertia = about_com(moved(ten, np.eye(3), anchor))
            moments, axes = np.linalg.eigh(inertia)
            axes[:, 2] *= np.sign(np.linalg.det(axes))
            quaternion = np.empty(4)
            self.mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(axes).ravel())
            self._state(body, mass, com, quaternion, moments)

    @staticmethod
    def _state(body: Any, mass: float, com: Array, quaternion: Array, moments: Array) -> None:
        body.explicitinertial = True
        body.mass, body.ipos, body.iquat, body.inertia = mass, com, quaternion, moments
        body.fullinertia = [math.nan, 0, 0, 0, 0, 0]

    def joint(self, name: str, found: Joint, j: int) -> None:
        joint = next(x for x in self.spec.joints if (x.name or f"joint{x.id}") == name)
        angle = self.angle if self.model.chain.kinds[j] == "revolute" else 1.0
        if np.any(joint.damping[1:]):
            self.remarks.append(
                f"joint `{name}` keeps its further coefficients of damping, which the diagnosis did not have"
            )
        joint.damping[:] = [found.viscous, found.drag + joint.damping[1], found.cubic_drag + joint.damping[2]]
        joint.frictionloss, joint.armature = found.coulomb, found.armature
        if found.coulomb:
            joint.solref_friction[:] = [2 * self.spec.option.timestep, 1]
            joint.solimp_friction[:] = SHARP
        sprung = bool(np.any(joint.stiffness))
        if found.stiffness or found.cubic:
            joint.stiffness[:] = [found.stiffness, 0.0, found.cubic]
            joint.springref = angle * (found.rest + found.reading)
        elif sprung:
            self.remarks.append(f"joint `{name}` keeps its spring, which the diagnosis did not have")
            joint.springref += angle * found.reading
        if found.reading:
            joint.ref += angle * found.reading
            joint.range = np.array(joint.range) + angle * found.reading * np.any(joint.range)
        if (free := found.free(FAR)) is not None:
            low, high, stiffness = free
            tendon = self.spec.add_tendon(name=f"stop{j + 1}", springlength=[low, high])
            tendon.stiffness[:] = [stiffness, 0, 0]
            tendon.wrap_joint(joint.name, 1.0)
        for actuator in driving(self.mujoco, self.spec, name):
            # Armature and damping of the actuator are the joint's now, and its gains no longer follow from the corrected inertia.
            actuator.armature, actuator.damping[:] = 0.0, 0.0
            if actuator.biasprm[1] < 0 < actuator.biasprm[2]:
                actuator.biasprm[2] = self.compiled.actuator_biasprm[actuator.id][2]
        self.remarks += write_servo(self.mujoco, self.spec, self.model, name, j)
        self._drive(name, found, j)

    def _drive(self, name: str, found: Joint, j: int) -> None:
        """Write estimated gain, offset, limit, lag and delay into the actuators of a joint."""
        limited = any(c.effect == "torque_saturation" and c.joint == j + 1 for c in self.model.causes)
        if not (limited or found.offset or found.lag or found.delay or found.gain != 1.0):
            return
        enum = self.mujoco
        actuators = driving(self.mujoco, self.spec, name)
        if len(actuators) != 1:
            many = "no actuator" if not actuators else "several actuators"
            self.remarks.append(f"{many} of joint `{name}`: what was found of its drive is not in the file")
            return
        actuator, step = actuators[0], self.spec.option.timestep
        gear = float(actuator.gear[0])
        if actuator.gaintype != enum.mjtGain.mjGAIN_FIXED or actuator.biastype not in (
            enum.mjtBias.mjBIAS_NONE,
            enum.mjtBias.mjBIAS_AFFINE,
        ):
            self.remarks.append(
                f"the actuator of joint `{name}` is no motor or servo: what was found of its drive is not in the file"
            )
            return
        actuator.gainprm[:3] *= found.gain
        actuator.biasprm[:3] *= found.gain
        if found.offset:
            actuator.biastype = enum.mjtBias.mjBIAS_AFFINE
            actuator.biasprm[0] += found.offset / gear
        if limited and found.limit is not None:
            level = found.gain * found.limit / abs(gear)
            given = actuator.forcerange if np.any(actuator.forcerange) else [-level, level]
            actuator.forcerange = [max(-level, given[0]), min(level, given[1])]
        if found.lag and actuator.dyntype == enum.mjtDyn.mjDYN_NONE:
            actuator.dyntype, actuator.dynprm[0] = enum.mjtDyn.mjDYN_FILTEREXACT, found.lag
        elif found.lag:
            self.remarks.append(
                f"the actuator of joint `{name}` has dynamics of its own: the lag that was found is not in the file"
            )
        if steps := round(found.delay / step):
            actuator.delay, actuator.nsample = steps * step, steps + 1
