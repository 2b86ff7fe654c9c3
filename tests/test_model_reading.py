"""URDF and MJCF as serial arms: against Pinocchio and MuJoCo, through the arm file and back, and what is unusual."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from armgap import Arm, read_model
from armgap.arm.rigid_body import about_com, about_origin, inconsistency, moved, symmetric
from armgap.arm.serial.trust import TRUSTS
from armgap.errors import ModelFileError, OptionError
from three_joints import ARM, LINKS, URDF

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
