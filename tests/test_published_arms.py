"""Published descriptions of arms: what is read from them moves as in Pinocchio and in MuJoCo, which read the same files by themselves."""

from __future__ import annotations

import importlib.metadata
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armgap import Arm, read_model
from test_chain_dynamics import Description, agree, check_against_pinocchio, pinocchio, random_states


@dataclass(frozen=True)
class Published:
    """An arm of the package example-robot-data: file, tip, and joints between base and tip that stand still."""

    file: str
    tip: str | None = None
    frozen: dict[str, float] = field(default_factory=dict)


ARMS = {
    "UR3": Published("ur_description/urdf/ur3_robot.urdf", "tool0"),
    "UR5": Published("ur_description/urdf/ur5_robot.urdf", "tool0"),
    "UR5 with gripper": Published("ur_description/urdf/ur5_gripper.urdf"),
    "UR10": Published("ur_description/urdf/ur10_robot.urdf"),
    "Panda": Published("panda_description/urdf/panda.urdf", "panda_hand"),
    "Jaco": Published("kinova_description/robots/kinova.urdf", "j2s6s200_end_effector"),
    "xArm7": Published("xarm_description/urdf/xarm7.urdf"),
    "SO-100": Published("so_arm_description/urdf/so100.urdf"),
    "SO-101": Published("so_arm_description/urdf/so101.urdf"),
    "Z1": Published("z1_description/urdf/z1.urdf", frozen={"jointGripper": -0.5}),
    # A linear joint, and the arm without the last joint of its wrist.
    "TIAGo": Published("tiago_description/robots/tiago_no_hand.urdf", "arm_6_link"),
    "TIAGo Pro": Published("tiago_pro_description/robots/tiago_pro.urdf", "arm_left_7_link", {"torso_lift_joint": 0.1}),
    "TALOS": Published("talos_data/robots/talos_left_arm.urdf", "gripper_left_base_link"),
    "Baxter": Published("baxter_description/urdf/baxter.urdf", "left_wrist"),
    "CENTAURO": Published("centauro_description/urdf/centauro.urdf", "ball1_tip"),
    "G1": Published(
        "g1_description/urdf/g1_29dof_rev_1_0.urdf", "left_rubber_hand",
        {"waist_yaw_joint": 0.3, "waist_roll_joint": -0.2, "waist_pitch_joint": 0.1},
    ),
}  # fmt: skip
#: Rotor inertias of the joints, as steps from the first to the last [kg m^2 or kg].
ROTORS = (0.1, 0.4)


def robots() -> Path:
    try:
        package = importlib.metadata.distribution("example-robot-data")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("the package example-robot-data is not installed (extra dev)")
    return Path(str(package.locate_file("cmeel.prefix/share/example-robot-data/robots")))


def read(name: str) -> tuple[Arm, Description]:
    """The arm as the library reads it, and its links and joints with rotors and without friction."""
    of = ARMS[name]
    arm = read_model(robots() / of.file, tip=of.tip, frozen=of.frozen)
    chain = arm.chain
    assert chain is not None
    links = arm.theta[: 10 * arm.n_joints].reshape(-1, 10)
    rotors = np.linspace(*ROTORS, arm.n_joints)
    return arm, Description(
        list(chain.kinds), chain.rotation, chain.translation, chain.axis, chain.gravity, links, rotors
    )


def test_there_are_enough() -> None:
    assert len(ARMS) >= 12


@pytest.mark.parametrize("name", ARMS)
def test_pinocchio_has_the_same_dynamics(name: str) -> None:
    arm, description = read(name)
    model = pinocchio.buildModelFromUrdf(str(robots() / ARMS[name].file))
    assert arm.chain is not None
    moving = [model.getJointId(joint) for joint in arm.chain.joint_names]
    still = [i for i in range(1, model.njoints) if i not in moving]
    reference = pinocchio.neutral(model)
    for i in still:
        joint = model.joints[i]
        if joint.nq == 1:
            low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
            reference[joint.idx_q] = ARMS[name].frozen.get(model.names[i], min(max(0.0, low), high))
    if still:
        model = pinocchio.buildReducedModel(model, still, reference)
    assert list(model.names)[1:] == list(arm.chain.joint_names)
    model.armature = description.rotors
    check_against_pinocchio(description, model, 0)


def bare(file: Path) -> str:
    """A URDF without shapes, and without the inertias of links that are fixed to the base, of which some are none that a body can have."""
    root = ET.parse(file).getroot()
    joints = root.findall("joint")

    def link_of(joint: ET.Element, end: str) -> str:
        found = joint.find(end)
        assert found is not None
        return found.attrib["link"]

    moved = {link_of(joint, "child") for joint in joints if joint.get("type") != "fixed"}
    while more := {link_of(j, "child") for j in joints if link_of(j, "parent") in moved} - moved:
        moved |= more
    for link in root.findall("link"):
        for part in list(link):
            if part.tag != "inertial" or link.get("name") not in moved:
                link.remove(part)
    for part in list(root):
        if part.tag not in ("link", "joint"):
            root.remove(part)
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", balanceinertia="false", boundmass="0", boundinertia="0")
    return ET.tostring(root, encoding="unicode")


@pytest.mark.parametrize("name", ARMS)
def test_mujoco_has_the_same_dynamics(name: str) -> None:
    """Of the whole robot, of which all joints but the arm's stand still."""
    mujoco: Any = pytest.importorskip("mujoco", reason="MuJoCo is missing: pip install 'armgap[trial]'")
    arm, description = read(name)
    assert arm.chain is not None
    model = mujoco.MjModel.from_xml_string(bare(robots() / ARMS[name].file))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    model.dof_damping[:] = 0.0
    joints = [model.joint(joint) for joint in arm.chain.joint_names]
    places = [(int(joint.qposadr[0]), int(joint.dofadr[0])) for joint in joints]
    positions, velocities = (list(x) for x in zip(*places, strict=True))
    model.dof_armature[velocities] = description.rotors
    rest = np.zeros(model.nq)
    for k in range(model.njnt):
        low, high = model.jnt_range[k] if model.jnt_limited[k] else (-np.inf, np.inf)
        rest[model.jnt_qposadr[k]] = ARMS[name].frozen.get(model.joint(k).name, min(max(0.0, low), high))
    data = mujoco.MjData(model)

    n, chain, theta = description.n, description.chain(), description.theta()
    q, dq, ddq = random_states(n, 0)
    inertia, bias, tau, energy = [], [], [], []
    for state in [np.zeros((3, n)), *np.stack([q, dq, ddq], axis=1)]:
        data.qpos[:], data.qvel[:], data.qacc[:] = rest, 0.0, 0.0
        data.qpos[positions], data.qvel[velocities] = state[:2]
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        inertia.append(full[np.ix_(velocities, velocities)])
        bias.append(data.qfrc_bias[velocities])
        energy.append(data.energy.copy())
        data.qacc[:] = 0.0
        data.qacc[velocities] = state[2]
        mujoco.mj_inverse(model, data)
        tau.append(data.qfrc_inverse[velocities])
    agree(chain.inertia(theta, q), np.array(inertia[1:]))
    agree(chain.bias(theta, q, dq), np.array(bias[1:]))
    agree(chain.inverse_dynamics(theta, q, dq, ddq), np.array(tau[1:]))
    links = description.links.ravel()
    agree(chain.regressor(q, dq, ddq) @ links + description.rotors * ddq, np.array(tau[1:]))
    kinetic, potential = chain.energies(theta, q, dq)
    heights = np.array(energy)[:, 0]
    agree(kinetic, np.array(energy[1:])[:, 1])
    agree(potential, heights[1:] - heights[0])
