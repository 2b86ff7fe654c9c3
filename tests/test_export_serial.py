"""Exported serial arms: dynamics that are those found, by engines that are not armgap's; links that are bodies; the user's own files."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from armgap import Arm, correct, read_model
from armgap.arm.description.edit import XmlText
from armgap.arm.description.xml import parse
from armgap.arm.rigid_body import about_com, rotation_between, rpy_matrix, rpy_of
from armgap.errors import ArmgapError, ModelFileError
from armgap.export import CorrectedSerial, ExportError, into_description, randomization
from armgap.export.chain.bodies import BODY_TOLERANCE
from export_cases import found, make_arm
from serial_export_cases import (
    CAUSES,
    CHAIN,
    COULOMB,
    PAYLOAD,
    ROTOR,
    SPRING,
    TILT,
    URDF,
    VISCOUS,
    by_pinocchio,
    configuration,
    described_arm,
    diagnosed,
    expected,
    states,
)

Run = Callable[..., tuple[int, str, str]]

#: Relative to the largest torque: rounding of decimal numbers and of two ways to sum.
EXACT = 1e-9
#: The same of numbers that MuJoCo has written with six digits.
SIX_DIGITS = 3e-5


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    return described_arm(tmp_path_factory.mktemp("described"))


def worst(case: str, torque: Callable[..., np.ndarray]) -> float:
    """Largest difference of a torque from the expected one, relative to the largest torque."""
    wanted = np.array([expected(CAUSES[case], *state) for state in states()])
    got = np.array([torque(*state) for state in states()])
    return float(np.max(np.abs(got - wanted)) / np.max(np.abs(wanted)))


def by_mujoco(text: str, **files: bytes) -> Callable[..., np.ndarray]:
    """Inverse dynamics of an MJCF model, joints in the order of the chain."""
    mj = pytest.importorskip("mujoco")
    model = mj.MjModel.from_xml_string(text, files or None)
    model.opt.disableflags |= mj.mjtDisableBit.mjDSBL_LIMIT | mj.mjtDisableBit.mjDSBL_CONTACT
    data = mj.MjData(model)
    at = [int(model.joint(name).qposadr[0]) for name in CHAIN]
    dof = [int(model.joint(name).dofadr[0]) for name in CHAIN]

    def torque(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        data.qpos[at], data.qvel[dof], data.qacc[dof] = q, dq, ddq
        mj.mj_inverse(model, data)
        return np.array(data.qfrc_inverse[dof])

    return torque


def by_urdf(text: str, rotor: np.ndarray) -> Callable[..., np.ndarray]:
    """Torques of a URDF by Pinocchio with its own friction, and rotor inertias, which it has no field for."""
    pin = pytest.importorskip("pinocchio")
    model = by_pinocchio(text)
    data = model.createData()

    def torque(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        rigid = pin.rnea(model, data, configuration(model, q), dq, ddq)
        return np.array(rigid + model.damping * dq + model.friction * np.sign(dq) + rotor * ddq)

    return torque


def armature(model: CorrectedSerial) -> np.ndarray:
    return np.array([joint.armature for joint in model.joints])


@pytest.mark.parametrize("case", CAUSES)
def test_files_have_the_dynamics_found(arm: Arm, case: str) -> None:
    model = correct(diagnosed(arm, case=case), arm)
    assert worst(case, by_mujoco(model.render("mjcf"))) < EXACT
    assert worst(case, by_urdf(model.render("urdf"), armature(model))) < EXACT


@pytest.mark.parametrize("case", CAUSES)
def test_a_user_s_own_urdf_has_the_dynamics_found(arm: Arm, case: str, tmp_path: Path) -> None:
    path = tmp_path / "own.urdf"
    path.write_text(URDF)
    model = correct(diagnosed(arm, case=case), arm)
    written = into_description(model, path)
    assert worst(case, by_urdf(written.content.decode(), armature(model))) < EXACT
    assert any("rotor inertia" in line for line in written.remarks)


#: Descriptions of the package example-robot-data, and the tips of those with several branches.
DESCRIPTIONS = [
    ("ur_description/urdf/ur5_gripper.urdf", None),
    ("panda_description/urdf/panda.urdf", "panda_hand"),
    ("so_arm_description/urdf/so101.urdf", None),
    ("xarm_description/urdf/xarm7.urdf", None),
    ("kinova_description/robots/kinova.urdf", "j2s6s200_end_effector"),
    ("z1_description/urdf/z1.urdf", None),
]


@pytest.mark.parametrize(("file", "tip"), DESCRIPTIONS, ids=[Path(f).stem for f, _ in DESCRIPTIONS])
def test_published_urdfs_take_a_payload(file: str, tip: str | None) -> None:
    """Torques of the whole robot, all its joints moving, are those of Pinocchio with the payload added to its own model."""
    pin = pytest.importorskip("pinocchio")
    try:
        package = metadata.distribution("example-robot-data")
    except metadata.PackageNotFoundError:
        pytest.skip("the package example-robot-data is not installed (extra dev)")
    path = Path(str(package.locate_file("cmeel.prefix/share/example-robot-data/robots"))) / file
    real = read_model(path, tip=tip)
    assert real.chain is not None
    written = into_description(correct(found(real, ("payload", None, PAYLOAD)), real), path)
    wanted, got = pin.buildModelFromUrdf(str(path)), pin.buildModelFromXML(written.content.decode())
    com = np.array([PAYLOAD["com_x"], PAYLOAD["com_y"], PAYLOAD["com_z"]])
    wanted.inertias[wanted.getJointId(real.chain.joint_names[-1])] += pin.Inertia(
        PAYLOAD["mass"], com, np.zeros((3, 3))
    )
    rng = np.random.default_rng(1)
    for _ in range(5):
        q = pin.integrate(wanted, pin.neutral(wanted), rng.uniform(-1, 1, wanted.nv))
        dq, ddq = rng.uniform(-2, 2, (2, wanted.nv))
        a, b = (pin.rnea(m, m.createData(), q, dq, ddq) for m in (wanted, got))
        assert np.max(np.abs(a - b)) < EXACT * np.max(np.abs(a))


def test_frozen_joints_stay_where_they_stood(tmp_path: Path) -> None:
    pin = pytest.importorskip("pinocchio")
    path = tmp_path / "own.urdf"
    path.write_text(URDF)
    two = read_model(path, frozen={"lift": 0.5})
    assert two.n_joints == 2
    model = correct(found(two, ("payload", None, PAYLOAD), ("base_tilt", None, TILT)), two)
    with pytest.raises(ModelFileError, match="and the frozen joints' positions"):
        into_description(model, path)
    got = by_pinocchio(into_description(model, path, frozen={"lift": 0.5}).content.decode())
    for q, dq, ddq in states():
        q, dq, ddq = (np.array([x[0], still, x[2]]) for x, still in ((q, 0.5), (dq, 0.0), (ddq, 0.0)))
        wanted = expected(CAUSES["payload"] + CAUSES["base_tilt"], q, dq, ddq)
        mechanical = wanted - VISCOUS * dq - COULOMB * np.sign(dq) - ROTOR * ddq
        tau = pin.rnea(got, got.createData(), configuration(got, q), dq, ddq)
        assert tau[[0, 2]] == pytest.approx(mechanical[[0, 2]], rel=EXACT, abs=1e-6)


def test_a_link_without_inertia_becomes_a_body(arm: Arm) -> None:
    mj = pytest.importorskip("mujoco")
    theta = arm.theta.copy()
    theta[10:20] = 0.0
    bare = replace(arm, theta=theta)
    model = correct(found(bare), bare)
    assert isinstance(model, CorrectedSerial)
    assert all(is_body(ten) for ten in model.bodies.inertial)
    assert mj.MjModel.from_xml_string(model.render("mjcf")).nv == 3


def test_text_is_changed_where_it_is_to_be() -> None:
    data = b"""<a k="1>" j='x="2"'><b/><c  x='3' /><d>t<d/></d></a>"""
    root = parse(data, Path("x"))
    text = XmlText(data, Path("x"))
    text.set(root, {"j": "5", "new": '"<'})
    b, c, d = root.children
    text.add(b, "<e/>")
    text.set(c, {"x": "4", "y": "6"})
    text.replace(d, "<f/>")
    changed = ET.fromstring(text.render())
    assert changed.attrib == {"k": "1>", "j": "5", "new": '"<'}
    assert [(e.tag, e.attrib) for e in changed] == [("b", {}), ("c", {"x": "4", "y": "6"}), ("f", {})]
    assert [e.tag for e in changed[0]] == ["e"]
    assert XmlText(data, Path("x")).render() == data
    with pytest.raises(ModelFileError, match="store it as UTF-8"):
        XmlText("<a/>".encode("utf-16"), Path("x"))


def own_mjcf() -> str:
    """The described arm as MuJoCo reads it, in degrees, with inertias from shapes, a servo and a motor."""
    mj = pytest.importorskip("mujoco")
    bare = "\n".join(line for line in URDF.splitlines() if "mesh" not in line)
    compiler = '<mujoco><compiler fusestatic="false" discardvisual="true" balanceinertia="false"/></mujoco>'
    spec = mj.MjSpec.from_string(bare.replace("</robot>", f"{compiler}</robot>"))
    spec.compile()
    root = ET.fromstring(spec.to_xml())
    actuator = ET.SubElement(root, "actuator")
    ET.SubElement(actuator, "position", name="servo", joint="lift", kp="300", kv="20")
    ET.SubElement(actuator, "motor", name="screw", joint="slide", gear="4", ctrlrange="-50 50")
    root.insert(0, ET.Comment(" a comment of the user "))
    return ET.tostring(root, encoding="unicode")


@pytest.mark.parametrize("case", CAUSES)
def test_a_user_s_own_mjcf_has_the_dynamics_found(arm: Arm, case: str, tmp_path: Path) -> None:
    path = tmp_path / "own.xml"
    path.write_text(own_mjcf())
    written = into_description(correct(diagnosed(arm, case=case), arm), path)
    assert worst(case, by_mujoco(written.content.decode())) < SIX_DIGITS
    assert b"a comment of the user" in written.content


def test_a_user_s_own_urdf_keeps_everything_else(arm: Arm, tmp_path: Path) -> None:
    path = tmp_path / "own.urdf"
    path.write_bytes(b"\xef\xbb\xbf" + URDF.replace("\n", "\r\n").encode())
    written = into_description(correct(diagnosed(arm, case="payload"), arm), path)
    text = written.content.decode("utf-8-sig")
    changed = ("flange",)
    for line in URDF.splitlines():
        inertial = any(word in line for word in ("inertia", "<mass", 'origin xyz="0.01', "dynamics"))
        assert inertial or line in text, f"gone: {line}"
    before, after = ET.fromstring(URDF), ET.fromstring(text)
    for old, new in zip(before.iter("link"), after.iter("link"), strict=True):
        same = ET.tostring(old).strip() == ET.tostring(new).strip().replace(b"\r", b"")
        assert same == (old.get("name") not in changed), old.get("name")
    assert 'drake:note="kept > here"' in text
    assert written.names_files
    comments = [line.strip() for line in text.splitlines() if "<!--" in line]
    assert comments[1].startswith("<!-- described: re-estimated values")
    dynamics = {joint.get("name"): joint.find("dynamics") for joint in after.iter("joint")}
    for name, viscous, coulomb in zip(CHAIN, VISCOUS, COULOMB, strict=True):
        assert float(dynamics[name].get("damping")) == viscous  # type: ignore[union-attr, arg-type]
        assert float(dynamics[name].get("friction")) == coulomb  # type: ignore[union-attr, arg-type]


def test_drives_of_a_user_s_own_mjcf(arm: Arm, tmp_path: Path) -> None:
    mj = pytest.importorskip("mujoco")
    path = tmp_path / "own.xml"
    path.write_text(own_mjcf())
    causes = [
        ("torque_gain", 2, {"gain": 0.9}),
        ("torque_offset", 2, {"offset": 1.5}),
        ("torque_saturation", 3, {"level": 60.0}),
        ("torque_offset", 1, {"offset": 1.0}),
        ("joint_spring", 2, SPRING),
        ("stribeck", 1, {"amplitude": 0.5, "velocity": 0.1}),
    ]
    written = into_description(correct(found(arm, *causes), arm), path)
    assert any("no actuator of joint `turn`" in line for line in written.remarks)
    assert any("no field for stribeck of joint 1" in line for line in written.remarks)
    forces, springs = [], []
    for text in (path.read_text(), written.content.decode()):
        model = mj.MjModel.from_xml_string(text)
        data = mj.MjData(model)
        data.qpos[1], data.qvel[1] = 0.4, 0.2
        data.ctrl[:] = 0.5, 40.0
        mj.mj_forward(model, data)
        forces.append(data.qfrc_actuator.copy())
        springs.append(data.qfrc_passive[1] + model.dof_damping[1] * 0.2)
    assert forces[1][1] == pytest.approx(0.9 * forces[0][1] + 1.5)
    assert (forces[0][2], forces[1][2]) == (pytest.approx(160.0), pytest.approx(60.0))
    assert springs[1] - springs[0] == pytest.approx(-SPRING["k"] * (0.4 - SPRING["q0"]))


def null_space(scale: np.ndarray) -> np.ndarray:
    """Changes of the links' numbers, in these units, that no motion shows, by Pinocchio's regressor."""
    pin = pytest.importorskip("pinocchio")
    model = by_pinocchio(URDF)
    data = model.createData()
    rows = [
        pin.computeJointTorqueRegressor(model, data, configuration(model, q), dq, ddq).copy() for q, dq, ddq in states()
    ]
    _, s, directions = np.linalg.svd(np.concatenate(rows) * scale)
    return np.array(directions[np.sum(s > 1e-9 * s[0]) :])


def is_body(ten: np.ndarray) -> bool:
    """Whether principal moments about the centre of mass are positive and keep the triangle inequality."""
    mass, _, inertia = about_com(ten)
    moments = np.linalg.eigvalsh(inertia)
    return bool(mass > 0 and moments[0] > 0 and moments[0] + moments[1] > moments[2])


def test_links_that_no_body_has_become_bodies_with_the_same_torques(arm: Arm) -> None:
    scale = arm.sigma[:30]
    unseen = null_space(scale)
    assert len(unseen) >= 12
    rng = np.random.default_rng(2)
    for _ in range(4):
        theta = arm.theta.copy()
        theta[:30] += scale * (5.0 * rng.standard_normal(len(unseen)) @ unseen)
        assert not all(is_body(ten) for ten in theta[:30].reshape(3, 10))
        model = correct(diagnosed(arm, theta), arm)
        assert isinstance(model, CorrectedSerial)
        assert all(is_body(ten) for ten in model.bodies.inertial)
        assert worst("none", by_mujoco(model.render("mjcf"))) < BODY_TOLERANCE
        # The nominal links have these torques and are bodies: none are nearer to them.
        assert model.bodies.inertial.ravel() == pytest.approx(arm.theta[:30], abs=1e-2 * np.max(scale))
        data = json.loads(model.render("json"))
        assert data["projected"]["links"]
        assert max(data["projected"]["torque_error"]) < BODY_TOLERANCE
        assert any("nearest bodies" in line and "same torques" in line for line in model.remarks("mjcf"))
        assert not any("nearest bodies" in line for line in model.remarks("toml"))


def test_torques_that_no_bodies_have_are_missed_by_a_stated_amount(arm: Arm) -> None:
    theta = arm.theta.copy()
    theta[30], theta[9] = 1e-3, -0.05  # less inertia about the first joint than none
    model = correct(diagnosed(arm, theta), arm)
    assert isinstance(model, CorrectedSerial)
    assert all(is_body(ten) for ten in model.bodies.inertial)
    assert not model.bodies.same_torques
    assert "no bodies have their torques" in model.render("mjcf")
    pin = pytest.importorskip("pinocchio")
    nominal = by_pinocchio(URDF)
    data, squares, changes = nominal.createData(), np.zeros(3), np.zeros(3)
    change = model.bodies.inertial.ravel() - theta[:30]
    for q, dq, ddq in states(8):
        regressor = pin.computeJointTorqueRegressor(nominal, data, configuration(nominal, q), dq, ddq)
        squares += (regressor @ theta[:30] + theta[30:33] * ddq) ** 2
        changes += (regressor @ change + (model.bodies.rotor - theta[30:33]) * ddq) ** 2
    # Of other states than those that the figure is from.
    assert model.bodies.torque_error == pytest.approx(np.sqrt(changes / squares), rel=1.0, abs=1e-3)


def test_an_arm_file_reads_back_as_the_arm_found(arm: Arm, tmp_path: Path) -> None:
    model = correct(diagnosed(arm, case="all"), arm)
    path = tmp_path / "corrected.toml"
    path.write_text(model.render("toml"))
    again = Arm.read(path)
    assert again.theta == pytest.approx(model.nominal().theta, rel=1e-12, abs=1e-15)
    assert again.theta[30] == ROTOR[0] + 0.1
    assert again.chain is not None
    assert again.chain.gravity == pytest.approx(model.chain.gravity)  # type: ignore[attr-defined]
    assert "--effect encoder_offset:1:offset=-0.2" in path.read_text()


def test_limits_that_the_logs_exceed_are_left_out(arm: Arm) -> None:
    mj = pytest.importorskip("mujoco")
    data = diagnosed(arm).to_dict()
    t = np.arange(200) * 0.01
    data["series"] = [
        {"log": "a", "joint": j, "t": t.tolist(), "measured": (size * np.sin(t)).tolist(), "window_start": [0]}
        for j, size in ((1, 2.7), (2, 9.0), (3, 0.2))
    ]
    model = correct(type(diagnosed(arm)).from_dict(data), arm)
    compiled = mj.MjModel.from_xml_string(model.render("mjcf"))
    assert compiled.jnt_limited.tolist() == [0, 0, 1]
    assert compiled.jnt_range[2] == pytest.approx([-0.3, 0.3])
    assert any("beyond the limits of position of turn" in line for line in model.remarks("mjcf"))


def test_randomisation_follows_what_is_known(arm: Arm, tmp_path: Path) -> None:
    """Torques of drawn models scatter as those of the estimate that the standard deviations come from, not as of independent values."""
    pin = pytest.importorskip("pinocchio")
    nominal = by_pinocchio(URDF)
    data = nominal.createData()
    rows = np.array([
        np.hstack([pin.computeJointTorqueRegressor(nominal, data, configuration(nominal, q), dq, ddq), np.diag(ddq)])
        for q, dq, ddq in states()
    ])  # fmt: skip
    size = np.sqrt(np.mean((rows @ arm.theta[:33]) ** 2, axis=0))
    stacked = (rows / size[:, None]).reshape(-1, 33)
    noise = 0.01
    known = np.linalg.inv(stacked.T @ stacked / noise**2 + np.diag(arm.sigma[:33] ** -2.0))
    told = diagnosed(arm).to_dict()
    for name, variance in zip(arm.parameter_names, np.diag(known), strict=False):
        told["parameters"]["with_causes"][name]["sigma"] = float(np.sqrt(variance))
    model = correct(type(diagnosed(arm)).from_dict(told), arm)
    spread = json.loads(randomization(model, draws=30))
    masses = [q for q in spread["quantities"] if q.get("link") and q["quantity"] == "mass"]
    assert [q["sd"] for q in masses] == pytest.approx(np.sqrt(np.diag(known)[:30:10]))
    assert all(q["low"] <= q["nominal"] <= q["high"] for q in spread["quantities"])
    drawn = []
    for draw in spread["draws"]:
        links = [
            np.array([link[k] for k in ("mass", "com_x", "com_y", "com_z", "ixx", "ixy", "ixz", "iyy", "iyz", "izz")])
            for link in draw["links"]
        ]
        ten = [
            pin.Inertia(x[0], x[1:4], np.array([[x[4], x[5], x[6]], [x[5], x[7], x[8]], [x[6], x[8], x[9]]]))
            for x in links
        ]
        drawn.append(np.concatenate([*(i.toDynamicParameters() for i in ten), [j["armature"] for j in draw["joints"]]]))
        assert all(is_body(i.toDynamicParameters()) for i in ten)
    scatter = np.std(np.array(drawn) @ stacked.T, axis=0)
    wanted = np.sqrt(np.einsum("ij,jk,ik->i", stacked, known, stacked))
    independent = np.sqrt(stacked**2 @ np.diag(known))
    assert 0.5 < np.sqrt(np.mean(scatter**2) / np.mean(wanted**2)) < 1.5
    assert np.sqrt(np.mean(independent**2) / np.mean(wanted**2)) > 5.0
    planar = make_arm("pendulum")
    assert json.loads(randomization(correct(found(planar), planar)))["quantities"][0]["parameter"] == "theta1"


@pytest.mark.parametrize(
    ("start", "end"), [((0, 0, 1), (0, 0, -1)), ((1, 0, 0), (1, 0, 0)), ((0.6, 0.8, 0), (0, 0.6, -0.8))]
)
def test_rotations_between_directions(start: tuple[float, ...], end: tuple[float, ...]) -> None:
    a, b = np.array(start, dtype=float), np.array(end, dtype=float)
    rotation = rotation_between(a, b)
    assert rotation @ a == pytest.approx(b, abs=1e-15)
    assert rotation.T @ rotation == pytest.approx(np.eye(3), abs=1e-15)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert rpy_matrix(rpy_of(rotation)) == pytest.approx(rotation, abs=1e-15)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2, 0.3, -3.0])
def test_angles_of_a_rotation_give_it_back(pitch: float) -> None:
    rotation = rpy_matrix([0.4, pitch, -1.2])
    assert rpy_matrix(rpy_of(rotation)) == pytest.approx(rotation, abs=1e-15)


@pytest.mark.parametrize(
    ("change", "options", "says"),
    [
        (("name=\"lift\"", "name=\"raise\""), [], "no moving joint `lift`"),
        (("xyz=\"0.05 0 0.1\"", "xyz=\"0.05 0 0.11\""), [], "`joint lift`, row 33: lies elsewhere than in the arm file"),
        (("<robot", "<sdf"), [], "begins with <sdf>"),
        (None, ["-o", "new.xml"], "is URDF, the output is to be MJCF"),
        (None, ["--freeze", "lift"], "no joint and position"),
        (None, ["--keep-lengths"], "lengths of serial arms are always kept"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line_and_nothing_written(
    run: Run, arm: Arm, tmp_path: Path, change, options, says, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own.urdf").write_text(URDF if change is None else URDF.replace(*change))
    Path("arm.toml").write_text(arm.to_toml())
    Path("d.json").write_text(diagnosed(arm).to_json())
    before = sorted(tmp_path.rglob("*"))
    output = [] if "-o" in options else ["-o", "new.urdf"]
    status, out, err = run("export", "d.json", "--arm", "arm.toml", "--model", "own.urdf", *output, *options)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert says in err
    assert sorted(tmp_path.rglob("*")) == before


def test_a_planar_arm_has_no_description(run: Run, tmp_path: Path) -> None:
    arm = make_arm("pendulum")
    (tmp_path / "own.urdf").write_text(URDF)
    with pytest.raises(ExportError, match="have no description"):
        into_description(correct(found(arm), arm), tmp_path / "own.urdf")


def test_the_command_writes_model_and_ranges(run: Run, arm: Arm, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot").mkdir()
    Path("robot/own.urdf").write_text(URDF)
    Path("arm.toml").write_text(arm.to_toml())
    Path("d.json").write_text(diagnosed(arm, case="payload").to_json())
    status, out, err = run(
        "export",
        "d.json",
        "--arm",
        "arm.toml",
        "--model",
        "robot/own.urdf",
        "-o",
        "new.urdf",
        "--randomization",
        "ranges.json",
    )
    assert (status, out) == (0, "")
    assert "keep it in the folder of the model" in err
    assert by_pinocchio(Path("new.urdf").read_text()).nv == 3
    assert json.loads(Path("ranges.json").read_text())["schema"] == "armgap.randomization/1"
    assert run("export", "d.json", "--arm", "arm.toml", "-o", "x.xml", "--freeze", "a=1")[0] == 2


def test_a_body_that_is_shared_by_two_joints_is_refused(arm: Arm, tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    path = tmp_path / "shared.xml"
    path.write_text(
        '<mujoco><worldbody><body name="b"><joint name="a" axis="0 0 1"/><joint name="c" axis="0 1 0"/>'
        '<inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.1 0.1"/></body></worldbody></mujoco>'
    )
    shared = read_model(path, trust="cad", sample_period=0.002)
    shared = replace(shared, theta=np.r_[shared.theta[:20], 0.1, 0.1, 0, 0, 0, 0])
    with pytest.raises(ArmgapError, match="more than one joint"):
        into_description(correct(found(shared), shared), path)
