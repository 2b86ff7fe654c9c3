"""URDF and MJCF as serial arms: against Pinocchio and MuJoCo, through the arm file and back, and what is broken or unusual."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray

from armgap import Arm, Log, read_model
from armgap.errors import ArmgapError, ModelFileError, OptionError
from armgap.rigid_body import about_com, about_origin, inconsistency, moved, symmetric
from armgap.serial_trust import TRUSTS

Array = NDArray[np.float64]
Run = Callable[..., tuple[int, str, str]]

#: Descriptions of the package example-robot-data, and the tips of those with several branches.
DESCRIPTIONS = [
    ("ur_description/urdf/ur3_robot.urdf", "tool0"),
    ("ur_description/urdf/ur5_robot.urdf", "tool0"),
    ("ur_description/urdf/ur10_robot.urdf", None),
    ("ur_description/urdf/ur5_gripper.urdf", None),
    ("panda_description/urdf/panda.urdf", "panda_hand"),
    ("so_arm_description/urdf/so100.urdf", None),
    ("so_arm_description/urdf/so101.urdf", None),
    ("xarm_description/urdf/xarm7.urdf", None),
    ("kinova_description/robots/kinova.urdf", "j2s6s200_end_effector"),
    ("z1_description/urdf/z1.urdf", None),
    ("tiago_description/robots/tiago_no_hand.urdf", "arm_7_link"),
    ("tiago_pro_description/robots/tiago_pro.urdf", "arm_left_7_link"),
    ("talos_data/robots/talos_left_arm.urdf", "gripper_left_base_link"),
    ("double_pendulum_description/urdf/double_pendulum.urdf", None),
    ("asr_twodof_description/urdf/TwoDofs.urdf", None),
    ("pr2_description/urdf/pr2.urdf", "r_gripper_palm_link"),
]
#: Rounding of double precision over a chain of ten joints, relative to the largest entry.
ROUNDING = 1e-13
POSES = 5


# The equation of motion by Jacobians, which shares nothing with the recursions of Pinocchio and MuJoCo.


def _turn(axis: Array, angle: float) -> Array:
    x = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * x + (1 - np.cos(angle)) * x @ x


def _frames(arm: Arm, q: Array) -> list[tuple[Array, Array, Array]]:
    """Rotation and origin of each link in the base, and the joint's axis there."""
    chain, rotation, origin = arm.chain, np.eye(3), np.zeros(3)
    assert chain is not None
    found = []
    for j in range(arm.n_joints):
        origin = origin + rotation @ chain.translation[j]
        rotation = rotation @ chain.rotation[j]
        axis = rotation @ chain.axis[j]
        if chain.rotary[j]:
            rotation = rotation @ _turn(chain.axis[j], q[j])
        else:
            origin = origin + q[j] * axis
        found.append((rotation, origin, axis))
    return found


def mass_and_gravity(arm: Arm, q: Array) -> tuple[Array, Array]:
    """M(q) without rotors, and g(q)."""
    n, frames = arm.n_joints, _frames(arm, q)
    assert arm.chain is not None
    mass, weight = np.zeros((n, n)), np.zeros(n)
    for k, (rotation, origin, _) in enumerate(frames):
        ten = moved(arm.theta[10 * k : 10 * k + 10], rotation, np.zeros(3))
        linear, angular = np.zeros((3, n)), np.zeros((3, n))
        for j in range(k + 1):
            _, start, axis = frames[j]
            if arm.chain.rotary[j]:
                linear[:, j], angular[:, j] = np.cross(axis, origin - start), axis
            else:
                linear[:, j] = axis
        m, first = ten[0], ten[1:4]
        coupling = linear.T @ np.cross(angular, first, axisa=0, axisc=0)
        mass += m * linear.T @ linear + coupling + coupling.T + angular.T @ symmetric(ten[4:]) @ angular
        weight -= arm.chain.gravity @ (m * linear + np.cross(angular, first, axisa=0, axisc=0))
    return mass, weight


def _close(found: Array, expected: Array) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING * max(float(np.max(np.abs(expected))), 1e-6))


@pytest.fixture(scope="module")
def robots() -> Path:
    """Folder of the package's descriptions."""
    try:
        package = metadata.distribution("example-robot-data")
    except metadata.PackageNotFoundError:
        pytest.skip("the package example-robot-data is not installed (extra dev)")
    return Path(str(package.locate_file("cmeel.prefix/share/example-robot-data/robots")))


@pytest.mark.parametrize(("file", "tip"), DESCRIPTIONS, ids=[Path(f).stem for f, _ in DESCRIPTIONS])
def test_pinocchio_has_the_same_arm(file: str, tip: str | None, robots: Path, tmp_path: Path) -> None:
    """Inertia matrix and gravity torques agree at random positions, with the other joints where the notes say that they are."""
    pin = pytest.importorskip("pinocchio")
    arm = read_model(robots / file, tip=tip)
    assert arm.chain is not None
    model = pin.buildModelFromUrdf(str(robots / file))
    chain = [model.getJointId(name) for name in arm.chain.joint_names]
    data, columns = model.createData(), [model.joints[j].idx_v for j in chain]
    rng = np.random.default_rng(1)
    for _ in range(POSES):
        q = rng.uniform(-3, 3, arm.n_joints)
        step = np.zeros(model.nv)
        for other in range(1, model.njoints):
            joint = model.joints[other]
            if joint.nq == 1 and joint.nv == 1:
                low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
                step[joint.idx_v] = min(max(0.0, low), high)
        step[columns] = q
        start = pin.neutral(model)
        for other in range(1, model.njoints):
            joint = model.joints[other]
            if joint.nq == 1:
                start[joint.idx_q] = 0.0
        pose = pin.integrate(model, start, step)
        mass = pin.crba(model, data, pose)
        mass = np.triu(mass) + np.triu(mass, 1).T
        weight = pin.computeGeneralizedGravity(model, data, pose)
        found = mass_and_gravity(arm, q)
        _close(found[0], mass[np.ix_(columns, columns)])
        _close(found[1], weight[columns])
    _same_again(arm, tmp_path)


def _same_again(arm: Arm, folder: Path) -> None:
    """What is written is read back: chain and joints to the last bit, links to rounding."""
    path = folder / "again.toml"
    path.write_text(arm.to_toml(), encoding="utf-8")
    again = Arm.read(path)
    assert arm.chain is not None
    assert again.chain is not None
    for name in ("joint_names", "link_names", "kinds"):
        assert getattr(again.chain, name) == getattr(arm.chain, name)
    for name in ("rotation", "translation", "axis", "gravity", "lower", "upper", "speed", "acceleration", "effort"):
        np.testing.assert_array_equal(getattr(again.chain, name), getattr(arm.chain, name))
    n = 10 * arm.n_joints
    links, read = arm.theta[:n].reshape(-1, 10), again.theta[:n].reshape(-1, 10)
    assert np.all(np.abs(read - links).max(axis=1) <= 1e-15 * np.abs(links).max(axis=1))
    np.testing.assert_array_equal(again.theta[n:], arm.theta[n:])
    np.testing.assert_array_equal(again.sigma, arm.sigma)
    assert (again.name, again.kind, again.sample_period) == (arm.name, arm.kind, arm.sample_period)
    assert again.gear_ratio is None if arm.gear_ratio is None else np.array_equal(again.gear_ratio, arm.gear_ratio)
    assert (arm.controller is None) == (again.controller is None)
    if arm.controller is not None and again.controller is not None:
        for (name, values), (other, read) in zip(arm.controller.vectors, again.controller.vectors, strict=True):
            assert name == other
            np.testing.assert_array_equal(values, read)


# MJCF

TURNED = """\
<mujoco model="turned"><compiler angle="radian"/><option gravity="0 1 -9.7"/>
<default><joint damping="0.3" frictionloss="0.2" armature="0.01"/><geom density="700"/></default>
<worldbody><body name="upper" pos="0.1 0 0.5" euler="0.3 0.2 -0.4">
  <joint name="one" axis="0 2 1" range="-2 2" limited="true"/>
  <geom type="capsule" fromto="0 0 0 0.1 0 0.4" size="0.04"/>
  <body name="fore" pos="0.1 0 0.4" quat="0.9 0.1 0.2 0.3">
    <joint name="two" type="slide" axis="1 0 1" pos="0.2 0.1 0" damping="4"/>
    <inertial pos="0.1 0 0" mass="2" fullinertia="0.03 0.02 0.04 0.001 -0.002 0.003"/>
    <body name="plate" pos="0 0.2 0"><geom type="box" size="0.1 0.05 0.02"/></body>
    <body name="hand" pos="0 0 0.3"><joint name="three" axis="1 0 0" pos="0 0.05 0.02"/>
      <geom type="sphere" size="0.06" pos="0.02 0 0.1"/></body>
  </body></body></worldbody></mujoco>
"""
SEVERAL_JOINTS = """\
<mujoco model="several"><compiler angle="degree"/>
<worldbody><body name="a" pos="0 0 1" euler="10 20 30">
  <joint name="x" axis="1 0 0" pos="0.1 0.2 0.3" ref="40"/>
  <joint name="y" axis="0 1 0" pos="-0.1 0 0.2"/>
  <joint name="z" type="slide" axis="0 0 1" pos="0.3 0 0" ref="0.25"/>
  <geom type="box" size="0.1 0.2 0.3" pos="0.05 0.1 0"/>
  <body name="b" pos="0.2 0.3 0.4"><joint name="w" axis="0 1 1" ref="-15"/>
    <geom type="cylinder" size="0.05 0.2" pos="0 0 0.2"/></body>
</body></worldbody></mujoco>
"""
SERVOS = """\
<mujoco model="servos"><compiler angle="radian"/>
<worldbody><body name="link"><joint name="shoulder" axis="0 1 0" range="-1 1" limited="true"/>
  <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.03"/>
  <body name="forearm" pos="0 0 0.3"><joint name="elbow" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/>
    <body name="left" pos="0.3 0.02 0"><joint name="finger" type="slide" axis="0 1 0" range="0.01 0.04" limited="true"/>
      <geom type="box" size="0.03 0.01 0.01"/></body>
    <body name="right" pos="0.3 -0.02 0"><joint name="other" type="slide" axis="0 -1 0"/>
      <geom type="box" size="0.03 0.01 0.01"/></body>
  </body></body></worldbody>
<equality><joint joint1="other" joint2="finger"/></equality>
<actuator><position joint="shoulder" kp="40" kv="2" forcerange="-12 12"/><position joint="elbow" kp="20" kv="1" gear="2"/></actuator>
</mujoco>
"""


def _mujoco(text: str, folder: Path) -> tuple[Any, Any, Any, Path]:
    mujoco = pytest.importorskip("mujoco", reason="the extra trial is not installed")
    path = folder / "model.xml"
    path.write_text(text)
    model = mujoco.MjModel.from_xml_path(str(path))
    return mujoco, model, mujoco.MjData(model), path


def _mujoco_equation(mujoco: Any, model: Any, data: Any, q: Array) -> tuple[Array, Array]:
    """M(q) and g(q) of all degrees of freedom."""
    data.qpos[:], data.qvel[:] = q, 0
    mujoco.mj_forward(model, data)
    columns = []
    for unit in np.eye(model.nv):
        product = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, product, unit)
        columns.append(product)
    return np.array(columns).T, np.array(data.qfrc_bias)


@pytest.mark.parametrize(
    ("text", "bodies"), [(TURNED, "upper fore hand"), (SEVERAL_JOINTS, "a b")], ids=["turned", "several"]
)
def test_mujoco_has_the_same_arm(text: str, bodies: str, tmp_path: Path) -> None:
    """Inertia matrix, gravity torques and the places of the bodies agree, for axes, anchors and references of any kind."""
    mujoco, model, data, path = _mujoco(text, tmp_path)
    arm = read_model(path)
    assert arm.chain is not None
    assert arm.n_joints == model.nv
    rng = np.random.default_rng(2)
    rotors = arm.theta[10 * arm.n_joints : 11 * arm.n_joints]
    for _ in range(POSES):
        q = rng.uniform(-1, 1, arm.n_joints)
        mass, weight = _mujoco_equation(mujoco, model, data, q)
        found = mass_and_gravity(arm, q)
        _close(found[0] + np.diag(rotors), mass)
        _close(found[1], weight)
        frames = dict(zip(arm.chain.link_names, _frames(arm, q), strict=True))
        for name in bodies.split():
            last = model.body(name).jntadr[0] + model.body(name).jntnum[0] - 1
            rotation = data.xmat[model.body(name).id].reshape(3, 3)
            anchor = data.xpos[model.body(name).id] + rotation @ model.jnt_pos[last]
            np.testing.assert_allclose(frames[name][1], anchor, atol=1e-14)
            np.testing.assert_allclose(frames[name][0], rotation, atol=1e-14)
    _same_again(arm, tmp_path)


def test_mujoco_joints_have_friction_and_rotors(tmp_path: Path) -> None:
    _, _, _, path = _mujoco(TURNED, tmp_path)
    arm = read_model(path)
    assert arm.theta[30:].tolist() == [0.01] * 3 + [0.3, 4.0, 0.3] + [0.2] * 3
    assert arm.chain is not None
    assert arm.chain.gravity.tolist() == [0.0, 1.0, -9.7]
    assert (arm.chain.lower[0], arm.chain.upper[0], arm.chain.upper[1]) == (-2.0, 2.0, np.inf)


def test_position_actuators_are_a_controller(tmp_path: Path) -> None:
    """Gains at the joint go with the square of the gear; fingers that an equality ties together stand at the leader's limit."""
    mujoco, model, data, path = _mujoco(SERVOS, tmp_path)
    with pytest.raises(ModelFileError, match=r"`forearm`.*where they part"):
        read_model(path)
    arm = read_model(path, tip="forearm", frozen={"finger": 0.02})
    assert arm.controller is not None
    assert arm.controller.kp.tolist() == [40.0, 80.0]
    assert arm.controller.kd.tolist() == [2.0, 4.0]
    assert arm.chain is not None
    assert arm.chain.effort.tolist() == [12.0, np.inf]
    assert any("`other` at 0.02" in note for note in arm.notes)
    q = np.array([0.4, -0.7, 0.02, 0.02])
    mass, weight = _mujoco_equation(mujoco, model, data, q)
    found = mass_and_gravity(arm, q[:2])
    _close(found[0], mass[:2, :2])
    _close(found[1], weight[:2])
    _same_again(arm, tmp_path)


def test_mjcf_without_mujoco(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "model.xml"
    path.write_text(SERVOS)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(OptionError, match=r"armgap\[trial\]"):
        read_model(path, tip="forearm")


# What is broken or unusual

URDF = """\
<?xml version="1.0"?>
<robot name="three" xmlns:drake="http://drake.mit.edu">
  <link name="base"><inertial><mass value="50"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="column"/><origin xyz="0 0 0.3"/><axis xyz="0 0 2"/>
    <limit lower="0" upper="0.5" velocity="0.2" effort="900"/><dynamics damping="20" friction="8"/></joint>
  <link name="column"><inertial><origin xyz="0 0 0.1"/><mass value="6"/><inertia ixx="0.2" iyy="0.2" izz="0.05"/></inertial></link>
  <joint name="shoulder" type="continuous"><parent link="column"/><child link="upper"/><origin xyz="0.1 0 0.2" rpy="0.1 0.2 0.3"/>
    <axis xyz="0 1 0"/><limit velocity="3" effort="90"/><dynamics damping="0.5" friction="1.5"/></joint>
  <link name="upper"><inertial><origin xyz="0.01 0 0.2" rpy="0.3 0 0.1"/><mass value="3"/>
    <inertia ixx="0.03" ixy="0.001" ixz="0.002" iyy="0.04" iyz="0" izz="0.02"/></inertial></link>
  <joint name="wrist" type="fixed"><parent link="upper"/><child link="mount"/><origin xyz="0 0 0.4" rpy="0 1.2 0"/></joint>
  <link name="mount"/>
  <joint name="elbow" type="revolute"><parent link="mount"/><child link="fore"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="4" effort="40"/><dynamics damping="0.2" friction="0.7"/></joint>
  <link name="fore"><inertial><origin xyz="0 0 0.1"/><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.002"/></inertial></link>
  <joint name="flange_joint" type="fixed"><parent link="fore"/><child link="flange"/><origin xyz="0 0 0.25"/></joint>
  <link name="flange"/>
  <joint name="finger" type="prismatic"><parent link="flange"/><child link="jaw"/><axis xyz="1 0 0"/>
    <limit lower="0.01" upper="0.04" velocity="1" effort="10"/></joint>
  <link name="jaw"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/></inertial></link>
  <joint name="thumb" type="prismatic"><parent link="flange"/><child link="pad"/><axis xyz="1 0 0"/><mimic joint="finger" multiplier="-1"/>
    <limit lower="-0.04" upper="-0.01" velocity="1" effort="10"/></joint>
  <link name="pad"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/></inertial></link>
  <drake:collision_filter_group name="g"><drake:member link="fore"/></drake:collision_filter_group>
  <vendor:thing anything="goes"/>
</robot>
"""
ARM = """\
name = "three"
kind = "serial"
urdf = "three.urdf"
tip = "flange"
sample_period = 0.002
[friction]
coulomb = [8.0, 1.5, 0.7]
"""
LINKS = """\
kind = "serial"
sample_period = 0.002
[[link]]
joint = "one"
axis = [0, 1, 0]
mass = 2.0
com = [0, 0, 0.2]
inertia = {ixx = 0.03, iyy = 0.03, izz = 0.01}
[[link]]
joint = "two"
placement = {xyz = [0, 0, 0.4], rpy = [0, 0.1, 0]}
mass = 1.0
"""


@pytest.fixture
def three(here: Path) -> Path:
    (here / "three.urdf").write_text(URDF)
    (here / "arm.toml").write_text(ARM)
    return here


def test_the_unbroken_ones_pass(three: Path, run: Run) -> None:
    arm = Arm.read(three / "arm.toml")
    assert arm.chain is not None
    assert (arm.chain.joint_names, arm.rotary_joints, arm.rotary) == (
        ("lift", "shoulder", "elbow"),
        (False, True, True),
        False,
    )
    assert arm.chain.axis.tolist() == [[0, 0, 1], [0, 1, 0], [0, 1, 0]]
    assert arm.parameter_units[-6:] == ("N s/m", "N m s/rad", "N m s/rad", "N", "N m", "N m")
    assert arm.theta[-6:].tolist() == [20.0, 0.5, 0.2, 8.0, 1.5, 0.7]
    assert arm.theta[20] == pytest.approx(1.2, abs=1e-15)  # the forearm with both jaws
    assert "`finger` at 0.01" in arm.notes[0]
    assert "`thumb` at -0.01" in arm.notes[0]
    status, out, err = run("model", "three.urdf", "--tip", "flange", "--freeze", "finger=0.02", "-o", "made.toml")
    assert (status, err) == (0, "")
    for words in ("shoulder", "prismatic", "0 to 0.5 m", "900 N", "4 rad/s", "`thumb` at -0.02", "made.toml"):
        assert words in out
    made = Arm.read(three / "made.toml")
    assert made.chain is not None
    assert made.theta[26] != arm.theta[26]
    (three / "links.toml").write_text(LINKS)
    assert Arm.read(three / "links.toml").n_joints == 2
    assert (
        run("model", "three.urdf", "--tip", "flange", "-o", "-")[1] == read_model("three.urdf", tip="flange").to_toml()
    )


ELBOW = '<joint name="elbow" type="revolute">'
#: What is replaced in URDF by what, the words of the complaint, and further options.
BROKEN = [
    ("no such tip", "", "", ("`flnge`", "did you mean `flange`"), ("--tip", "flnge")),
    ("no such base", "", "", ("`bse`", "did you mean `base`"), ("--base", "bse", "--tip", "flange")),
    ("tip above base", "", "", ("`column`", "`fore`", "flange"), ("--base", "fore", "--tip", "column")),
    ("several branches", "", "", ("several branches", "`flange` (3 joints), where they part", "`jaw` (4 joints)"), ()),
    ("nothing moves", "", "", ("no joint moves", "`flange`"), ("--base", "fore", "--tip", "flange")),
    ("no joint to freeze", "", "", ("`finge`", "did you mean `finger`"), ("--freeze", "finge=0")),
    ("frozen at no number", "", "", ("--freeze", "finger=open"), ("--freeze", "finger=open")),
    ("frozen twice", "", "", ("given twice",), ("--freeze", "finger=0", "--freeze", "finger=1")),
    ("sample period in ms", "", "", ("2", "1e-05 to 0.5"), ("--tip", "flange", "--sample-period", "2")),
    ("a mimic joint in the chain", "", "", ("`joint thumb`", "follows the joint `finger`", "freeze"), ("--tip", "pad")),
    ("floating", ELBOW, ELBOW.replace("revolute", "floating"), ("`joint elbow`", "floating", "`fore`"), ("--tip", "flange")),
    ("planar", ELBOW, ELBOW.replace("revolute", "planar"), ("`joint elbow`", "planar"), ("--tip", "flange")),
    ("no type", ' type="revolute"', "", ("`joint elbow`", "no type", "continuous"), ()),
    ("unknown type", "revolute", "hinge", ("`hinge`", "revolute"), ()),
    ("zero axis", 'xyz="0 0 2"', 'xyz="0 0 0"', ("`joint lift`", "zero axis"), ("--tip", "flange")),
    ("axis of two numbers", 'xyz="0 0 2"', 'xyz="0 2"', ("`axis`", "row 4", "3 finite numbers"), ()),
    ("decimal comma", 'value="6"', 'value="6,5"', ("`mass`", "'6,5'", "row 6"), ()),
    ("mass is nan", 'value="6"', 'value="nan"', ("'nan'", "finite"), ()),
    ("no mass value", 'mass value="6"', "mass", ("has no `value`",), ()),
    ("no child", '<child link="fore"/>', "", ("`joint elbow`", "no child link"), ()),
    ("child is no link", '<child link="fore"/>', '<child link="four"/>', ("`joint elbow`", "`four`"), ()),
    ("two parents", '<child link="pad"/>', '<child link="jaw"/>', ("`joint thumb`", "`finger`", "closed chains"), ()),
    ("a circle", '<parent link="base"/>', '<parent link="fore"/>', ("circle",), ()),
    ("link twice", '<link name="mount"/>', '<link name="mount"/><link name="mount"/>', ("`link mount`", "twice"), ()),
    ("joint twice", '"wrist"', '"elbow"', ("`joint elbow`", "twice"), ()),
    ("joint without a name", 'joint name="lift" type', "joint type", ("`joint`", "has no name"), ()),
    ("not XML", "</robot>", "", ("not valid XML", "row"), ()),
    ("xacro by its elements", "<vendor:thing", "<xacro:thing", ("xacro", "robot.urdf", "`xacro:thing`"), ()),
    ("xacro by its values", 'value="6"', 'value="${m}"', ("${m}", "xacro FILE"), ()),
    ("xacro by its names", '<link name="base">', '<link name="${prefix}base">', ("`link ${prefix}base`", "xacro FILE"), ()),
    ("SDF", URDF, "<sdf><model/></sdf>", ("<sdf>", "convert"), ()),
    ("a table", URDF, "t,q1\n0,1\n", ("no XML", "<robot>"), ()),
    ("empty", URDF, "", ("no XML",), ()),
    ("no links", URDF, "<robot name='r'/>", ("no links",), ()),
    ("an entity", '<robot name', '<!DOCTYPE robot [<!ENTITY a "b">]><robot name', ("entity",), ()),
    ("reduction of no number", "<vendor:thing", '<transmission name="t"><joint name="lift"/><actuator name="m"><mechanicalReduction>x'
     "</mechanicalReduction></actuator></transmission><vendor:thing", ("mechanicalReduction", "'x'"), ()),
    ("a kilometre too many", 'xyz="0.1 0 0.2"', 'xyz="1e300 0 0"', ("too long to compute with", "kg and m"), ("--tip", "flange")),
    ("folder that is not there", "", "", ("folder does not exist",), ("--tip", "flange", "-o", "none/arm.toml")),
]  # fmt: skip


@pytest.mark.parametrize(("good", "bad", "says", "options"), [c[1:] for c in BROKEN], ids=[c[0] for c in BROKEN])
def test_a_broken_description(
    good: str, bad: str, says: tuple[str, ...], options: tuple[str, ...], three: Path, run: Run
) -> None:
    assert good in URDF
    (three / "three.urdf").write_text(URDF.replace(good, bad, 1))
    before = sorted(three.iterdir())
    output = () if "-o" in options else ("-o", "made.toml")
    _refused(run("model", "three.urdf", *options, *output), says)
    assert sorted(three.iterdir()) == before


def _refused(answer: tuple[int, str, str], says: tuple[str, ...]) -> None:
    status, out, err = answer
    assert (status, out, err.count("\n")) == (2, "", 1), err
    for words in says:
        assert words in err
    assert err.count(";") >= 1  # what to do about it


#: What is replaced in ARM, or LINKS, by what, and the words of the complaint.
BROKEN_ARMS = [
    ("misspelt key", ARM, "tip =", "tpi =", ("`tpi`", "did you mean `tip`")),
    ("no description", ARM, 'urdf = "three.urdf"\n', "", ("exactly one of urdf, mjcf and [[link]]",)),
    ("two descriptions", ARM, "tip =", 'mjcf = "x.xml"\ntip =', ("`mjcf`", "stands beside `urdf`")),
    ("not that kind of description", ARM, "urdf =", "mjcf =", ("is URDF, not MJCF",)),
    ("no such description", ARM, "three.urdf", "thre.urdf", ("thre.urdf", "No such file")),
    ("base parameters", ARM, "[friction]", "[inertial]\ntheta = [1]\n[friction]", ("`inertial`", "[[link]]")),
    ("lengths", ARM, "[friction]", "[geometry]\nlink_length = [1]\n[friction]", ("`geometry`", "leave it out")),
    ("unknown trust", ARM, "tip =", 'trust = "CAD"\ntip =', ("`trust`", "`CAD`")),
    ("gravity of two", ARM, "tip =", "gravity = [0, -9.81]\ntip =", ("`gravity`", "3 numbers")),
    ("gravity too strong", ARM, "tip =", "gravity = [0, 0, -9810]\ntip =", ("`gravity`", "9810")),
    ("too few frictions", ARM, "[8.0, 1.5, 0.7]", "[8.0]", ("`friction.coulomb`", "lift, shoulder, elbow")),
    ("friction of no joint", ARM, "[8.0, 1.5, 0.7]", "{lift = 8, shoulder = 2, elbw = 1}", ("did you mean `elbow`",)),
    ("friction lacks a joint", ARM, "[8.0, 1.5, 0.7]", "{lift = 8, shoulder = 2}", ("lacks the joint `elbow`",)),
    ("negative friction", ARM, "1.5", "-1.5", ("`friction.coulomb`", "-1.5")),
    ("frozen at a word", ARM, "[friction]", '[frozen]\nfinger = "open"\n[friction]', ("`frozen.finger`", "'open'")),
    ("limits exchanged", ARM, "[friction]", "[limits]\nposition_max = [-1, 1, 1]\n[friction]", ("`lift`", "exchange")),
    ("payload without a mass", ARM, "[friction]", "[payload]\ncom = [0, 0, 0]\n[friction]", ("`payload.mass`",)),
    ("payload far away", ARM, "[friction]", "[payload]\nmass = 1\ncom = [0, 0, 300]\n[friction]", ("in m",)),
    ("controller without gains", ARM, "[friction]", "[controller]\nkp = [1, 2, 3]\n[friction]", ("`controller.kd`",)),
    ("controller of no kind", ARM, "[friction]", '[controller]\nkind = "mpc"\n[friction]', ("'mpc'", "pd")),
    ("gear ratios twice", ARM, "[friction]", "[drive]\ngear_ratio = [1, 2, 3]\n[transmission]\ngear_ratio = [1, 2, 3]\n[friction]",
     ("`transmission.gear_ratio`", "`drive.gear_ratio`")),
    ("column of no joint", ARM, "[friction]", '[columns]\nq_ref4 = "x"\n[friction]', ("`columns.q_ref4`",)),
    ("kind of torque", ARM, "[friction]", '[columns]\ntau_kind = "guessed"\n[friction]', ("`columns.tau_kind`", "measured")),
    ("joint twice", LINKS, '"two"', '"one"', ("`link 2.joint`", "twice")),
    ("no joint", LINKS, 'joint = "two"\n', "", ("`link 2.joint`", "is missing")),
    ("misspelt key of a link", LINKS, "com =", "con =", ("`link 1.con`", "did you mean `com`")),
    ("axis of zeros", LINKS, "[0, 1, 0]", "[0, 0, 0]", ("`link 1.axis`", "zero")),
    ("axis of words", LINKS, "[0, 1, 0]", '["y", 1, 0]', ("`link 1.axis`", "3 numbers")),
    ("kind of joint", LINKS, "axis =", 'kind = "ball"\naxis =', ("`link 1.kind`", "`ball`", "revolute")),
    ("no rotation", LINKS, "rpy = [0, 0.1, 0]", "rotation = [[1, 0, 0], [0, 2, 0], [0, 0, 1]]", ("is no rotation",)),
    ("two rotations", LINKS, "rpy = [0, 0.1, 0]", "rpy = [0, 0, 0], rotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]", ("`rotation`",)),
    ("massless with a centre", LINKS, "mass = 2.0\n", "", ("`link 1.mass`", "`com`")),
    ("negative mass of a link", LINKS, "mass = 2.0", "mass = -2.0", ("`link 1.mass`", "-2")),
    ("half an inertia", LINKS, "iyy = 0.03, ", "", ("`link 1.inertia.iyy`",)),
    ("inertia as a list", LINKS, "{ixx = 0.03, iyy = 0.03, izz = 0.01}", "[1, 2, 3]", ("`link 1.inertia`", "ixx")),
    ("a mass of any size", LINKS, "mass = 2.0\ncom = [0, 0, 0.2]", "mass = 1e300\ncom = [0, 0, 1e9]", ("`link`", "too heavy")),
    ("links and a tip", LINKS, "[[link]]", 'tip = "x"\n[[link]]', ("`tip`", "[[link]]")),
]  # fmt: skip


@pytest.mark.parametrize(("text", "good", "bad", "says"), [c[1:] for c in BROKEN_ARMS], ids=[c[0] for c in BROKEN_ARMS])
def test_a_broken_arm_file(text: str, good: str, bad: str, says: tuple[str, ...], three: Path, run: Run) -> None:
    assert good in text
    (three / "arm.toml").write_text(text.replace(good, bad, 1))
    _log().write_csv(three / "log.csv")
    _refused(run("inspect", "log.csv", "--arm", "arm.toml"), says)


# Unusual, and said


@pytest.mark.parametrize(
    ("good", "bad", "note"),
    [
        ('friction="0.7"', 'friction="1000"', "friction of 10, 100 or 1000: a placeholder"),
        ('damping="0.2"', 'damping="-0.2"', "a damping is negative"),
        ('izz="0.05"', 'izz="5"', "link `column` is no body: its principal moments 0.2, 0.2, 5 kg m^2 break"),
        ('mass value="6"', 'mass value="-6"', "link `column` is no body: its mass is -6 kg"),
        ('lower="0" upper="0.5"', 'lower="0.5" upper="0"', "the limits of joint `lift` are exchanged"),
        ('"0 0 0.3"', '"0 0 0.3" rpy="1 0 0"', None),
    ],
)
def test_what_is_unusual_is_said(good: str, bad: str, note: str | None, three: Path) -> None:
    (three / "three.urdf").write_text(URDF.replace(good, bad, 1))
    arm = read_model(three / "three.urdf", tip="flange")
    assert [n for n in arm.notes if "stand still" not in n and (note is None or note not in n)] == []
    assert note is None or any(note in n for n in arm.notes)


def test_placeholders_are_no_nominal_friction(three: Path) -> None:
    text = URDF
    for value in ('damping="20"', 'damping="0.5"', 'damping="0.2"'):
        text = text.replace(value, 'damping="3"')
    (three / "three.urdf").write_text(text)
    arm = read_model(three / "three.urdf", tip="flange")
    assert any("damping 3 on all joints that have one: a placeholder" in note for note in arm.notes)
    assert arm.theta[-6:].tolist() == [0.0, 0.0, 0.0, 8.0, 1.5, 0.7]
    assert (arm.sigma[-6:] > 0).all()


def test_an_arm_without_inertias(three: Path) -> None:
    """Kinematics only: values unknown, and trusted as such."""
    import re

    (three / "three.urdf").write_text(re.sub(r"<inertial>.*?</inertial>", "", URDF, flags=re.DOTALL))
    arm = read_model(three / "three.urdf", tip="flange")
    assert any("kinematics only" in note for note in arm.notes)
    assert not arm.theta[:30].any()
    assert (arm.sigma[:30].reshape(3, 10)[:, 0] > 3.0).all()  # kg
    _same_again(arm, three)


def test_reductions_of_transmissions(three: Path) -> None:
    def transmission(joint: str, ratio: float) -> str:
        inner = (
            f'<joint name="{joint}"/><actuator name="m"><mechanicalReduction>{ratio}</mechanicalReduction></actuator>'
        )
        return f'<transmission name="t"><type>simple</type>{inner}</transmission>'

    def ratios(values: dict[str, float]) -> Any:
        added = "".join(transmission(*pair) for pair in values.items())
        (three / "three.urdf").write_text(URDF.replace("</robot>", f"{added}</robot>"))
        return read_model(three / "three.urdf", tip="flange").gear_ratio

    assert ratios({"lift": 50, "shoulder": -101, "elbow": 101}).tolist() == [50.0, 101.0, 101.0]
    assert ratios({"lift": 50, "shoulder": 101}) is None
    assert ratios(dict.fromkeys(("lift", "shoulder", "elbow"), 1.0)) is None


def test_gravity_is_in_the_frame_of_the_base(three: Path) -> None:
    """The base of a chain that begins at a turned link, and a scalar."""
    mount = read_model(three / "three.urdf", base="mount", tip="flange")
    assert mount.chain is not None
    pitch = 0.2 + 1.2  # the shoulder at 0 and the fixed wrist turn about y, but for the roll and yaw of the shoulder
    assert mount.chain.gravity @ mount.chain.gravity == pytest.approx(9.81**2)
    assert abs(mount.chain.gravity[2] + 9.81 * np.cos(pitch)) < 0.2
    assert any("gravity in the frame of the base" in note for note in mount.notes)
    (three / "arm.toml").write_text(ARM.replace("tip", "gravity = 1.62\ntip"))
    moon = Arm.read(three / "arm.toml")
    assert moon.chain is not None
    assert (moon.gravity, moon.chain.gravity.tolist()) == (1.62, [0.0, 0.0, -1.62])


def test_a_payload_is_part_of_the_last_link(three: Path) -> None:
    bare = Arm.read(three / "arm.toml")
    (three / "arm.toml").write_text(ARM + "[payload]\nmass = 2.0\ncom = [0.1, 0, 0.3]\n")
    loaded = Arm.read(three / "arm.toml")
    difference = loaded.theta - bare.theta
    np.testing.assert_allclose(
        difference[20:30], about_origin(2.0, np.array([0.1, 0, 0.3]), np.zeros((3, 3))), atol=1e-15
    )
    assert not np.delete(difference, range(20, 30)).any()
    np.testing.assert_array_equal(loaded.sigma, bare.sigma)


def test_trust_widens_what_is_less_trusted(three: Path) -> None:
    """No entry is pinned: zeros have a scale too."""
    sigma = {word: read_model(three / "three.urdf", tip="flange", trust=word).sigma for word in TRUSTS}
    links = {word: values[:30].reshape(3, 10) for word, values in sigma.items()}
    np.testing.assert_allclose(links["published"][:, 0], [0.6, 0.3, 0.12], rtol=1e-12)
    np.testing.assert_allclose(links["cad"], 3 * links["published"], rtol=1e-12)
    np.testing.assert_allclose(links["guess"], 10 * links["published"], rtol=1e-12)
    assert (links["none"] >= links["guess"]).all()
    assert all((values > 0).all() for values in sigma.values())


def test_features_of_arm_files(three: Path) -> None:
    (three / "arm.toml").write_text(
        ARM
        + "viscous = {elbow = 0.3, lift = 21, shoulder = 0.6}\n"
        + "[drive]\nrotor_inertia = [4, 0.5, 0.2]\ntorque_limit = [900, 90, 40]\ngear_ratio = [50, 100, 100]\n"
        + "[encoder]\ncounts_per_rev = [10000, 4096, 4096]\n[limits]\nposition_min = [0, -3, -1]\nacceleration = [1, 2, 3]\n"
        + '[columns]\nq_ref1 = "target"\ntau_kind = "measured"\n[corrections]\ngravity = "reversed"\n'
        + '[controller]\nkp = [1, 2, 3]\nkd = [1, 2, 3]\nkd_on = "error"\ndelay = [0.01, 0, 0]\n'
    )
    arm = Arm.read(three / "arm.toml")
    assert arm.theta[30:36].tolist() == [4.0, 0.5, 0.2, 21.0, 0.6, 0.3]
    assert arm.sigma[30:36].tolist() == [4.0, 0.5, 0.2, 10.5, 0.3, 0.15]
    assert arm.encoder_step is not None
    np.testing.assert_allclose(arm.encoder_step, [1e-4, 2 * np.pi / 4096, 2 * np.pi / 4096], rtol=1e-15)
    assert arm.chain is not None
    assert (arm.chain.lower.tolist(), arm.chain.acceleration.tolist()) == ([0, -3, -1], [1, 2, 3])
    assert (arm.tau_kind, arm.columns) == ("measured", {"q_ref1": "target"})
    assert arm.chain.gravity.tolist() == [0, 0, 9.81]
    assert arm.controller is not None
    assert (arm.controller.kd_on, arm.controller.delay) == ("error", pytest.approx([0.01, 0, 0]))
    _same_again(arm, three)
    native = arm.to_native()
    assert set(native["chain"]) == {"kinds", "rotation", "translation", "axis", "gravity"}
    assert len(native["theta"]) == 39


def test_rigid_bodies() -> None:
    """Parallel axes there and back, and what no body can have."""
    rng = np.random.default_rng(3)
    points, mass = rng.normal(size=(20, 3)), rng.uniform(0.1, 1, 20)
    com = mass @ points / mass.sum()
    inertia = sum(m * ((p @ p) * np.eye(3) - np.outer(p, p)) for m, p in zip(mass, points - com, strict=True))
    ten = about_origin(float(mass.sum()), com, np.asarray(inertia))
    assert inconsistency(ten) == ""
    found = about_com(ten)
    np.testing.assert_allclose(found[1], com, atol=1e-15)
    np.testing.assert_allclose(found[2], inertia, atol=1e-13)
    turn, at = _turn(np.array([0.6, 0.0, 0.8]), 0.7), np.array([0.3, -2.0, 1.0])
    np.testing.assert_allclose(
        moved(ten, turn, at), sum(about_origin(m, turn @ p + at, np.zeros((3, 3))) for m, p in zip(mass, points, strict=True)), atol=1e-12
    )  # fmt: skip
    assert "mass" in inconsistency(-ten)
    assert "no mass" in inconsistency(about_origin(0.0, com, np.eye(3)))
    assert "triangle" in inconsistency(about_origin(1.0, com, np.diag([1.0, 1.0, 3.0])))


# Logs

JOINTS = ("lift", "shoulder", "elbow")


def _log(samples: int = 400) -> pl.DataFrame:
    """A motion of the three joints, in columns named after them."""
    t = np.arange(samples) * 0.002
    data = {"t": t}
    for j, joint in enumerate(JOINTS):
        data[f"{joint}/position"] = 0.2 * (j + 1) * np.sin((5 + j) * t)
        data[f"{joint}/velocity"] = 0.2 * (j + 1) * (5 + j) * np.cos((5 + j) * t)
        data[f"{joint}/effort"] = (j + 1) * np.cos(7 * t)
    return pl.DataFrame(data)


def test_columns_are_found_by_the_names_of_joints(three: Path) -> None:
    """In any order, beside columns of other joints."""
    arm, frame = Arm.read(three / "arm.toml"), _log()
    for columns in (frame.columns, frame.columns[::-1]):
        log = Log.from_frame(frame.select(columns).with_columns(pl.lit(0.02).alias("finger/position")), arm=arm)
        for j, joint in enumerate(JOINTS):
            np.testing.assert_array_equal(log.q[:, j], frame[f"{joint}/position"])
            np.testing.assert_array_equal(log.tau[:, j], frame[f"{joint}/effort"])
            assert log.dq is not None
            np.testing.assert_array_equal(log.dq[:, j], frame[f"{joint}/velocity"])
        assert [log.units[f"q{j}"] for j in (1, 2, 3)] == ["m", "rad", "rad"]
        assert [log.units[f"tau{j}"] for j in (1, 2, 3)] == ["N", "Nm", "Nm"]


def test_explicit_columns_win(three: Path) -> None:
    frame = _log().with_columns((2 * pl.col("elbow/effort")).alias("elbow current"))
    (three / "arm.toml").write_text(ARM + '[columns]\ntau3 = "elbow current"\nq_ref1 = "target"\n')
    arm = Arm.read(three / "arm.toml")
    np.testing.assert_array_equal(Log.from_frame(frame, arm=arm).tau[:, 2], frame["elbow current"])
    np.testing.assert_array_equal(
        Log.from_frame(frame, arm=arm, columns={"tau3": "elbow/effort"}).tau[:, 2], frame["elbow/effort"]
    )
    written = Log.from_frame(frame, arm=arm).to_polars()
    np.testing.assert_array_equal(Log.from_frame(written, arm=arm).tau[:, 2], frame["elbow current"])


def test_angles_in_degrees_leave_lengths_alone(three: Path) -> None:
    arm, frame = Arm.read(three / "arm.toml"), _log()
    degrees = frame.with_columns(pl.col(f"{joint}/position") * (180 / np.pi) for joint in JOINTS[1:])
    log = Log.from_frame(degrees, arm=arm, units={"q": "deg"})
    np.testing.assert_allclose(log.q, Log.from_frame(frame, arm=arm).q, rtol=1e-14)
    assert [log.units[f"q{j}"] for j in (1, 2, 3)] == ["m", "deg", "deg"]
    recognised = Log.from_frame(degrees, arm=arm)  # by the velocities
    np.testing.assert_allclose(recognised.q, log.q, rtol=1e-14)


#: What is done to a log, further options, and the words of the complaint.
BROKEN_LOGS: list[tuple[str, Callable[[pl.DataFrame], pl.DataFrame], tuple[str, ...], tuple[str, ...]]] = [
    ("an effort is missing", lambda f: f.drop("elbow/effort"), (), ("`elbow/effort`", "mapped to tau3", "missing")),
    ("a position is missing", lambda f: f.drop("shoulder/position"), (), ("`shoulder/position`", "mapped to q2")),
    ("other joints", lambda f: f.rename({c: f"x_{c}" for c in f.columns if "/" in c}), (), ("`q1`", "--columns")),
    ("a word in a column", lambda f: f.with_columns(pl.lit("x").alias("lift/effort")), (), ("`lift/effort`", "row 1")),
    ("a length in mm", lambda f: f.with_columns(pl.col("lift/position") * 1e3), (), ("`lift/position`", "mm")),
    ("mapped to no joint", lambda f: f, ("--columns", "q4=lift/position"), ("`q4`", "3 joints")),
    ("mapped to what is not there", lambda f: f, ("--columns", "q1=lift_position"), ("`lift_position`", "missing")),
    ("mapped twice", lambda f: f, ("--columns", "q1=elbow/position"), ("mapped to both", "`elbow/position`")),
    ("two arms in one log", lambda f: f.rename({c: f"a/{c}" for c in f.columns if "/" in c}).with_columns(
        pl.lit(1.0).alias("b/lift/position")), (), ("`lift/position`", "fits several columns")),
]  # fmt: skip


@pytest.mark.parametrize(("change", "options", "says"), [c[1:] for c in BROKEN_LOGS], ids=[c[0] for c in BROKEN_LOGS])
def test_a_log_that_does_not_fit(
    change: Callable[[pl.DataFrame], pl.DataFrame],
    options: tuple[str, ...],
    says: tuple[str, ...],
    three: Path,
    run: Run,
) -> None:
    change(_log()).write_csv(three / "log.csv")
    _refused(run("diagnose", "log.csv", "--arm", "arm.toml", *options), says)


# What serial arms are not taken by


@pytest.mark.parametrize(
    "words",
    [
        ("diagnose", "log.csv", "--arm", "three.urdf"),
        ("replay", "log.csv", "--arm", "arm.toml", "-o", "out.rrd"),
        ("simulate", "--arm", "arm.toml", "--torque", "seed", "-o", "out.csv"),
    ],
    ids=lambda words: words[0],
)
def test_commands_that_take_no_serial_arms(words: tuple[str, ...], three: Path, run: Run) -> None:
    _log().write_csv(three / "log.csv")
    _refused(run(*words), ())


def test_a_function_that_takes_no_serial_arms(three: Path) -> None:
    from armgap import fit

    arm = Arm.read(three / "arm.toml")
    log = Log.from_frame(_log(), arm=arm)
    with pytest.raises(ArmgapError, match="serial"):
        fit(log, arm)


def test_a_serial_arm_shows_itself(three: Path) -> None:
    text = Arm.read(three / "arm.toml")._repr_markdown_()
    for words in ("lift, shoulder, elbow", "first moment along x of link 2", "rotor inertia at joint 3", "stand still"):
        assert words in text
    assert "<svg" not in Arm.read(three / "arm.toml")._repr_html_()


def test_whatever_is_damaged_is_refused_in_one_line(three: Path) -> None:
    """A character or a stretch of the file changed or gone: read as some arm, or refused as nothing but a complaint of ours."""
    rng = np.random.default_rng(4)
    refused = 0
    for _ in range(400):
        first = int(rng.integers(len(URDF)))
        last = first + int(rng.choice([1, 1, 5, 40]))
        put = "".join(rng.choice(list('<>"=/ 0.-e${}'), int(rng.integers(0, 4))))
        (three / "three.urdf").write_text(URDF[:first] + put + URDF[last:])
        complaint, arm = _read_or_refused(three / "three.urdf")
        if arm is None:
            refused += 1
            assert "\n" not in str(complaint)
            assert getattr(complaint, "remedy", "")
        else:
            assert np.isfinite(arm.theta).all()
            assert np.isfinite(arm.sigma).all()
            assert (arm.sigma > 0).all()
    assert 100 < refused < 400


def _read_or_refused(path: Path) -> tuple[ArmgapError | None, Arm | None]:
    try:
        return None, read_model(path, tip="flange")
    except ArmgapError as error:
        return error, None
