"""Reading of MJCF models through MuJoCo's own compiler, which resolves defaults, includes, meshes, and inertias from shapes."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.arm.description.mjcf_actuators import Actuators
from armgap.arm.description.tree import MOVING, Joint, Mimic, Tree
from armgap.arm.rigid_body import about_origin, moved, unit_axis
from armgap.errors import ModelFileError, OptionError

__all__ = ["mjcf_tree"]

Array = NDArray[np.float64]


def mjcf_tree(path: Path) -> Tree:
    """Return bodies and joints of an MJCF model.

    A body with several joints becomes several links, of which the last has the body's name and inertia. The frame of a link is its
    joint's frame: at the joint's ``pos``, along the body's axes. Bodies and joints without names are named by number: ``body1``, ``joint0``.

    Raises
    ------
    OptionError
        If MuJoCo is not installed.
    ModelFileError
        If MuJoCo refuses the file.
    """
    try:
        import mujoco
    except ImportError:
        remedy = "install it with pip install 'armgap[trial]', or give a URDF"
        raise OptionError("MJCF is read by MuJoCo, which is not installed", remedy=remedy) from None
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, RuntimeError) as error:
        said = " ".join(str(error).split())[:300]
        raise ModelFileError(f"MuJoCo refuses it: {said}", remedy="correct the model", file=path) from None
    return _Mjcf(mujoco, model, path).tree()


class _Mjcf:
    def __init__(self, mujoco: Any, model: Any, path: Path) -> None:
        self.mujoco = mujoco
        self.model = model
        self.path = path
        self.actuators = Actuators(mujoco, model)

    def tree(self) -> Tree:
        m = self.model
        links: dict[str, Array] = {self._body(0): np.zeros(10)}
        joints: dict[str, Joint] = {}
        offset = {0: np.zeros(3)}
        for body in range(1, m.nbody):
            parent = int(m.body_parentid[body])
            name, before = self._body(body), self._body(parent)
            first, count = int(m.body_jntadr[body]), int(m.body_jntnum[body])
            rotation = _matrix(m.body_quat[body])
            origin = m.body_pos[body] - offset[parent]  # in the frame of the parent's last joint
            anchor = np.zeros(3)
            for j in range(first, first + count):
                last = j == first + count - 1
                link = name if last else f"{name}/{self._joint_name(j)}"
                anchor = m.jnt_pos[j].copy()
                placed = (
                    (rotation, origin + rotation @ anchor) if j == first else (np.eye(3), anchor - m.jnt_pos[j - 1])
                )
                joint = self._joint(j, before, link, *placed)
                joints[joint.name] = joint
                links[link] = np.zeros(10)
                before = link
            if count == 0:
                fixed = f"{name}/fixed"
                joints[fixed] = Joint(fixed, before, name, "fixed", rotation, origin)
            offset[body] = anchor
            links[name] = self._inertial(body, anchor)
        for j in range(m.njnt):
            name = self._joint_name(j)
            if joints[name].kind in MOVING:
                joints[name] = self.actuators.on(j, joints[name])
        self._coupled(joints)
        name = str(m.names[: m.names.index(b"\0")], "utf-8", "replace") if isinstance(m.names, bytes) else ""
        weightless = m.opt.disableflags & self.mujoco.mjtDisableBit.mjDSBL_GRAVITY
        gravity = np.zeros(3) if weightless else np.array(m.opt.gravity)
        carried = {self._body(body): float(m.body_gravcomp[body]) for body in range(m.nbody)}
        return Tree(self.path, "MJCF", name, links, joints, gravity, tuple(self._notes()), carried)

    def _body(self, body: int) -> str:
        return self.model.body(body).name or f"body{body}"

    def _joint_name(self, j: int) -> str:
        return self.model.joint(j).name or f"joint{j}"

    def _inertial(self, body: int, anchor: Array) -> Array:
        m = self.model
        ten = about_origin(float(m.body_mass[body]), np.zeros(3), np.diag(m.body_inertia[body]))
        return moved(ten, _matrix(m.body_iquat[body]), m.body_ipos[body] - anchor)

    def _joint(self, j: int, parent: str, child: str, rotation: Array, translation: Array) -> Joint:
        m, types = self.model, self.mujoco.mjtJoint
        kinds = {types.mjJNT_HINGE: "revolute", types.mjJNT_SLIDE: "prismatic", types.mjJNT_BALL: "ball"}
        kind = kinds.get(types(int(m.jnt_type[j])), "free")
        joint = Joint(self._joint_name(j), parent, child, kind, rotation, translation)
        if kind not in MOVING:
            return joint
        axis = unit_axis(m.jnt_axis[j])
        dof, reference = int(m.jnt_dofadr[j]), float(m.qpos0[m.jnt_qposadr[j]])
        if axis is not None and reference != 0:  # MJCF gives frames at joint position `ref`, not at 0
            if kind == "prismatic":
                translation = translation - reference * (rotation @ axis)
            else:
                half = -0.5 * reference
                rotation = rotation @ _matrix(np.array([math.cos(half), *(math.sin(half) * axis)]))
        limited = bool(m.jnt_limited[j])
        lower, upper = (float(x) for x in m.jnt_range[j]) if limited else (-math.inf, math.inf)
        effort = float(np.max(np.abs(m.jnt_actfrcrange[j]))) if m.jnt_actfrclimited[j] else math.inf
        return replace(
            joint,
            rotation=rotation,
            translation=translation,
            axis=axis,
            lower=lower,
            upper=upper,
            effort=effort,
            viscous=float(m.dof_damping[dof]),
            coulomb=float(m.dof_frictionloss[dof]),
            rotor_inertia=float(m.dof_armature[dof]) or math.nan,
            remarks=self._remarks(j, dof),
        )

    def _remarks(self, j: int, dof: int) -> dict[str, str]:
        """Return remarks on what a joint has besides its axis, limits and friction."""
        m, remarks = self.model, {}
        if m.jnt_stiffness[j] or np.any(m.jnt_stiffnesspoly[j]):
            rates = ", ".join(f"{k:g}" for k in (m.jnt_stiffness[j], *np.trim_zeros(m.jnt_stiffnesspoly[j], "b")))
            remarks["springs are left out"] = f"stiffness {rates} about {float(m.qpos_spring[m.jnt_qposadr[j]]):.4g}"
        if np.any(m.dof_dampingpoly[dof]):
            further = ", ".join(f"{c:g}" for c in m.dof_dampingpoly[dof])
            remarks["damping that is not proportional to the speed is left out"] = f"coefficients {further}"
        low, high = m.jnt_actfrcrange[j]
        if m.jnt_actfrclimited[j] and not math.isclose(-low, high):
            remarks["torque limits that differ by direction are taken as the larger"] = f"{low:g} to {high:g}"
        return remarks

    def _coupled(self, joints: dict[str, Joint]) -> None:
        """Add a `Mimic` to each joint that an MJCF equality constraint couples to another joint."""
        m = self.model
        for e in np.flatnonzero(m.eq_type == self.mujoco.mjtEq.mjEQ_JOINT):
            if not m.eq_active0[e]:
                continue
            follower, leader = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
            offset, multiplier = (float(x) for x in m.eq_data[e][:2])
            # The constraint couples the joints' displacements from their reference positions (`ref` in MJCF).
            at = float(m.qpos0[m.jnt_qposadr[follower]])
            if leader < 0:
                mimic = Mimic("", 0.0, at + offset)
            else:
                leader_at = float(m.qpos0[m.jnt_qposadr[leader]])
                mimic = Mimic(self._joint_name(leader), multiplier, at + offset - multiplier * leader_at)
            name = self._joint_name(follower)
            joints[name] = replace(joints[name], mimic=mimic)

    def _notes(self) -> list[str]:
        """Return remarks on what acts on no single joint."""
        m, kinds, notes = self.model, self.mujoco.mjtEq, []
        active = [int(e) for e in np.flatnonzero(m.eq_active0)]
        closing, known = [int(kinds.mjEQ_CONNECT), int(kinds.mjEQ_WELD)], int(kinds.mjEQ_JOINT)
        if any(m.eq_type[e] in closing for e in active):
            notes.append("connections that close a chain are left out")
        bent = [self._joint_name(int(m.eq_obj1id[e])) for e in active if self._is_bent(e)]
        if bent:
            notes.append(f"couplings of joints are taken as linear: {', '.join(f'`{name}`' for name in bent[:12])}")
        if any(m.eq_type[e] not in (*closing, known) for e in active):
            notes.append("equality constraints of tendons and flexible bodies are left out")
        if m.ntendon:
            notes.append("tendons are left out")
        if self.actuators.elsewhere:
            names = ", ".join(f"`{name}`" for name in self.actuators.elsewhere[:12])
            notes.append(f"actuators that drive no single joint are left out: {names}")
        if m.opt.density or m.opt.viscosity:
            notes.append("forces of the medium (density, viscosity) are left out")
        return notes

    def _is_bent(self, e: int) -> bool:
        """Return whether an equality constraint couples two joints by more than a linear law."""
        coupled = self.model.eq_type[e] == self.mujoco.mjtEq.mjEQ_JOINT and self.model.eq_obj2id[e] >= 0
        return bool(coupled and np.any(self.model.eq_data[e][2:5]))


def _matrix(quaternion: Array) -> Array:
    """Return the rotation matrix, shape (3, 3), of a quaternion ``w, x, y, z`` of any length but 0."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )
