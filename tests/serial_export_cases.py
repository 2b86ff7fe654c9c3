"""Serial arm from a URDF with causes, and its torques computed with Pinocchio, with which exported files are compared."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armgap import Arm, Diagnosis, read_model
from export_cases import found

Array = np.ndarray

#: URDF of three joints, with a flange and a camera on the last link, and with all elements that an export has to leave unchanged.
URDF = """\
<?xml version="1.0" encoding="utf-8"?>
<!-- before the root -->
<robot name="described" xmlns:drake="http://drake.mit.edu">
  <!-- a comment with <inertial> in it -->
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="floor"/>
  <joint name="stand" type="fixed">
    <parent link="floor"/>
    <child link="pedestal"/>
    <origin xyz="0.1 -0.2 0.7" rpy="0 0 0.4"/>
  </joint>
  <link name="pedestal"><inertial><mass value="30"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="turret">
    <visual><geometry><mesh filename="meshes/turret.stl" scale='1 1 1'/></geometry></visual>
    <inertial>
      <!-- of the CAD model -->
      <origin xyz="0.01 0.02 0.1" rpy="0 0.1 0"/>
      <mass value="4.0"/>
      <inertia ixx="0.03" iyy="0.04" izz="0.02" ixy="0.001" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="turn" type="revolute">
    <parent link="pedestal"/>
    <child link="turret"/>
    <origin xyz="0 0 0.2" rpy="0 0 0"/>
    <axis xyz="0 0 1"/>
    <limit lower="-2.5" upper="2.5" effort="80" velocity="3"/>
  </joint>
  <link name="upper">
    <inertial><origin xyz="0 0 0.2"/><mass value="3.0"/>
      <inertia ixx="0.05" iyy="0.05" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="lift" type="continuous">
    <parent link="turret"/><child link="upper"/>
    <origin xyz="0.05 0 0.1" rpy="-1.5 0.1 0"/>
    <axis xyz="0 0.6 0.8"/>
    <dynamics damping="0.5" friction="0.4" drake:note="kept > here"/>
  </joint>
  <link name="ram"/>
  <joint name="slide" type="prismatic">
    <parent link="upper"/><child link="ram"/>
    <origin xyz="0 0 0.4" rpy="0.3 0 0.2"/>
    <axis xyz="0 1 0"/>
    <limit lower="-0.3" upper="0.3" effort="200" velocity="1"/>
  </joint>
  <link name="flange">
    <inertial><origin xyz="0.02 0 0.05"/><mass value="1.5"/>
      <inertia ixx="0.01" iyy="0.012" izz="0.008" ixy="0" ixz="0.001" iyz="0"/></inertial>
  </link>
  <joint name="bolted" type="fixed"><parent link="ram"/><child link="flange"/><origin xyz="0 0.1 0.05" rpy="0.2 0 0"/></joint>
  <link name="camera"><inertial><mass value="0.2"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="glued" type="fixed"><parent link="flange"/><child link="camera"/><origin xyz="0.1 0 0"/></joint>
  <drake:proximity/>
</robot>
"""
CHAIN = ("turn", "lift", "slide")
#: Rotor inertias, viscous and Coulomb friction per joint, which the URDF does not have [SI].
ROTOR, VISCOUS, COULOMB = np.array([0.3, 0.2, 2.0]), np.array([1.0, 0.8, 6.0]), np.array([0.7, 0.9, 3.0])
STATES = 30
PAYLOAD = {"mass": 0.8, "com_x": 0.03, "com_y": 0.05, "com_z": 0.1}
TILT = {"x": 0.06, "y": -0.04}
SPRING = {"k": 12.0, "q0": 0.3}
LINK = {
    "mass": 1.0,
    "mx": 0.01,
    "my": 0.02,
    "mz": 0.2,
    "ixx": 0.05,
    "ixy": 0.0,
    "iyy": 0.06,
    "ixz": 0.001,
    "iyz": 0.0,
    "izz": 0.02,
}
#: Causes of each case: effect, joint (from 1; None for the whole arm) and parameters.
CAUSES: dict[str, tuple[tuple[str, int | None, dict[str, float]], ...]] = {
    "none": (),
    "payload": (("payload", None, PAYLOAD),),
    "base_tilt": (("base_tilt", None, TILT),),
    "nominal_link": (("nominal_link", 2, LINK),),
    "encoder_offset": (("encoder_offset", 2, {"offset": 0.1}), ("encoder_offset", 3, {"offset": 0.02})),
    "all": (
        ("payload", None, PAYLOAD),
        ("base_tilt", None, TILT),
        ("encoder_offset", 1, {"offset": -0.2}),
        ("rotor_inertia", 1, {"inertia": 0.1}),
    ),
}


def described_arm(folder: Path) -> Arm:
    """Return the arm of the `URDF`, which is written to the folder, with rotor inertias and friction added."""
    path = folder / "described.urdf"
    path.write_text(URDF)
    arm = read_model(path, trust="cad", sample_period=0.002)
    theta = np.concatenate([arm.theta[:30], ROTOR, VISCOUS, COULOMB])
    return replace(arm, theta=theta, sigma=np.concatenate([arm.sigma[:30], 0.5 * theta[30:]]))


def states(seed: int = 5) -> list[tuple[Array, Array, Array]]:
    """Return random positions (as encoders show them), velocities and accelerations of the three joints, none of them at rest."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1, 1, (STATES, 3)) * np.array([2.0, 3.0, 0.25])
    dq = rng.uniform(0.3, 1.5, (STATES, 3)) * rng.choice([-1, 1], (STATES, 3))
    return list(zip(q, dq, rng.uniform(-4, 4, (STATES, 3)), strict=True))


def by_pinocchio(urdf: str) -> Any:
    """Return Pinocchio's model of a URDF text."""
    return pytest.importorskip("pinocchio").buildModelFromXML(urdf)


def expected(causes: tuple[tuple[str, int | None, dict[str, float]], ...], q: Array, dq: Array, ddq: Array) -> Array:
    """Return the torques of the described arm with causes [N m or N]: links by Pinocchio, causes by their equations."""
    pin = pytest.importorskip("pinocchio")
    model = by_pinocchio(URDF)
    q, tau = q.copy(), VISCOUS * dq + COULOMB * np.sign(dq) + ROTOR * ddq
    for effect, joint, p in causes:
        if effect == "payload":
            com = np.array([p["com_x"], p["com_y"], p["com_z"]])
            model.inertias[3] += pin.Inertia(p["mass"], com, np.zeros((3, 3)))
        elif effect == "nominal_link":
            dynamic = model.inertias[joint].toDynamicParameters() + np.array(list(p.values()))
            model.inertias[joint] = pin.Inertia.FromDynamicParameters(dynamic)
        elif effect == "base_tilt":
            turned = pin.exp3(np.array([p["x"], p["y"], 0.0]))  # rotation of the base
            model.gravity.linear = turned.T @ np.array([0.0, 0.0, -9.81])
        elif effect == "encoder_offset":
            q[joint - 1] -= p["offset"]
        elif effect == "rotor_inertia":
            tau[joint - 1] += p["inertia"] * ddq[joint - 1]
        elif effect == "joint_spring":
            tau[joint - 1] += p["k"] * (q[joint - 1] - p["q0"])
    return tau + pin.rnea(model, model.createData(), configuration(model, q), dq, ddq)


def configuration(model: Any, q: Array) -> Array:
    """Return joint positions in Pinocchio's form: cosine and sine for a joint without limits."""
    out = []
    for joint, x in zip(model.joints[1:], q, strict=True):
        out += [x] if joint.nq == 1 else [np.cos(x), np.sin(x)]
    return np.array(out)


def diagnosed(arm: Arm, theta: Array | None = None, case: str = "none") -> Diagnosis:
    """Return a diagnosis of the arm with the causes of a case, and with parameter values `theta` if they are given."""
    if theta is None:
        return found(arm, *CAUSES[case])
    data = found(arm, *CAUSES[case]).to_dict()
    for name, value in zip(arm.parameter_names, theta, strict=True):
        data["parameters"]["with_causes"][name]["value"] = float(value)
    return Diagnosis.from_dict(data)
