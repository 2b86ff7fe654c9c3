"""Exported models: links that could be built, and dynamics that are those of armgap."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armgap import Arm, _native, correct, simulate
from armgap.export import ExportError, physical
from armgap.simulation import Effect
from export_cases import SIZES, THETA, found, make_arm, place

EXACT = 1e-9  # relative to the largest torque: rounding of decimal numbers and of two ways to sum
STATES = 40


def torque(
    arm: Arm, theta: np.ndarray, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, tilt: float = 0.0
) -> np.ndarray:
    """Equation of motion as docs/notation.md and Reyes and Kelly (1997) write it."""
    n, b = arm.n_joints, arm.n_inertial
    friction = theta[b : b + n] * dq + theta[b + n :] * np.sign(dq)
    if arm.kind == "axis":
        g = theta[1] * math.cos(tilt) + theta[0] * arm.gravity * math.sin(tilt)
        return theta[0] * ddq + g + friction
    if arm.kind == "pendulum":
        return theta[0] * ddq + theta[1] * np.sin(q + tilt) + friction
    t1, t2, t3, t4, t5 = theta[:5]
    c, s = math.cos(q[1]), math.sin(q[1])
    M = np.array([[t1 + 2 * t2 * c, t3 + t2 * c], [t3 + t2 * c, t3]])
    C = np.array([[-t2 * s * dq[1], -t2 * s * (dq[0] + dq[1])], [t2 * s * dq[0], 0.0]])
    outer = t5 * math.sin(q[0] + q[1] + tilt)
    return M @ ddq + C @ dq + np.array([t4 * math.sin(q[0] + tilt) + outer, outer]) + friction


def states(n: int, seed: int = 3) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Random states that slide: dry friction has its full level."""
    rng = np.random.default_rng(seed)
    speed = rng.uniform(0.5, 3.0, (STATES, n)) * rng.choice([-1, 1], (STATES, n))
    return list(zip(rng.uniform(-3, 3, (STATES, n)), speed, rng.uniform(-5, 5, (STATES, n)), strict=True))


def passive(
    name: str, arm: Arm, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """What an effect does to the equation: base parameters, torque needed besides, tilt; by its equation in the catalogue."""
    theta, extra, p = arm.theta.copy(), np.zeros(arm.n_joints), SIZES[name]
    if name == "payload":
        m, d = p["mass"], p["distance"]
        l1 = 9.81 * theta[1] / theta[4] if arm.kind == "two-link" else 0.0
        theta[: arm.n_inertial] += {
            "axis": np.array([m, m * theta[1] / theta[0]]),
            "pendulum": np.array([m * d * d, 9.81 * m * d]),
            "two-link": m * np.array([l1 * l1 + d * d, l1 * d, d * d, 9.81 * l1, 9.81 * d]),
        }[arm.kind]
    elif name == "rotor_inertia":
        extra[-1] = p["inertia"] * ddq[-1]
    elif name == "joint_spring":
        extra[-1] = p["k"] * (q[-1] - p["q0"])
    elif name == "hardening_spring":
        x = q[-1] - p["q0"]
        extra[-1] = p["k"] * x + p["cubic"] * x**3
    elif name == "quadratic_drag":
        extra[-1] = p["c"] * dq[-1] * abs(dq[-1])
    elif name == "cubic_drag":
        extra[-1] = p["c3"] * dq[-1] ** 3
    elif name == "contact":
        extra[-1] = p["stiffness"] * max(q[-1] - p["position"], 0.0)
    return theta, extra, p.get("angle", 0.0)


def worst(expected: list[np.ndarray], got: list[np.ndarray]) -> float:
    a, b = np.array(expected), np.array(got)
    return float(np.max(np.abs(a - b)) / np.max(np.abs(a)))


@given(
    st.tuples(*[st.floats(0.05, 50)] * 2),
    st.floats(0.05, 2),
    st.tuples(*[st.integers(-1000, 1000).map(lambda mm: mm / 1000)] * 2),
    st.tuples(*[st.floats(1e-3, 5)] * 2),
    st.booleans(),
)
@settings(max_examples=200, deadline=None)
def test_links_of_any_arm_that_can_be_built_have_its_base_parameters(mass, l1, com, inertia, stated) -> None:
    theta = _native.theta_from_links("two-link", 9.81, mass, [l1, 0.0], com, inertia)
    links = physical("two-link", 9.81, theta, mass=mass if stated else None, length=[l1, 0.0])
    assert min(*links.mass, *links.inertia) > 0
    again = _native.theta_from_links("two-link", 9.81, links.mass, [links.length[0], 0.0], links.com, links.inertia)
    assert again == pytest.approx(theta, rel=1e-9, abs=1e-9 * max(theta))


def test_stated_masses_are_kept_where_they_are_possible() -> None:
    theta = _native.theta_from_links("two-link", 9.81, [23.902, 3.88], [0.45, 0.3], [0.091, 0.048], [1.266, 0.093])
    kept = physical("two-link", 9.81, theta, mass=[23.902, 3.88])
    assert (kept.mass, kept.com) == ((23.902, 3.88), (pytest.approx(0.091), pytest.approx(0.048)))
    assert kept.inertia == (pytest.approx(1.266), pytest.approx(0.093))
    other = physical("two-link", 9.81, theta, mass=[23.902, 500.0])
    assert 0.3 < other.mass[1] < 12
    assert any("500 kg is impossible" in choice for choice in other.choices)


@pytest.mark.parametrize(
    ("kind", "theta", "says"),
    [
        ("axis", [-1.0, 0.0], "moving mass"),
        ("pendulum", [0.0, 1.0], "inertia theta1"),
        ("two-link", [0.1, 0.2, 0.1, 1.0, 1.0], "not positive definite"),
        ("two-link", [2.0, 0.1, 0.1, 38.0, -1.8], "imply a link 1 of length -"),
        ("two-link", [2.0, 0.1, 0.1, 38.0, 0.0], "length infinity"),
        ("scara", [1.0], "cannot be exported"),
    ],
)
def test_values_that_no_arm_can_have_are_refused(kind: str, theta: list[float], says: str) -> None:
    with pytest.raises(ExportError, match=says) as caught:
        physical(kind, 9.81, theta)
    assert caught.value.remedy


def test_what_cannot_be_built_can_still_be_written_as_values() -> None:
    arm = make_arm("two-link")
    arm = replace(arm, theta=arm.theta * np.array([1, 1, 1, 1, -1, 1, 1, 1, 1]))
    model = correct(found(arm), arm)
    with pytest.raises(ExportError, match="length -"):
        model.render("mjcf")
    data = json.loads(model.render("json"))
    assert data["links"] is None
    assert any("length -" in note for note in data["notes"])
    assert data["parameters"]["theta5"]["value"] == arm.theta[4]


@pytest.mark.parametrize("kind", THETA)
@pytest.mark.parametrize(
    "name",
    [
        "none",
        "payload",
        "rotor_inertia",
        "joint_spring",
        "hardening_spring",
        "quadratic_drag",
        "cubic_drag",
        "base_tilt",
        "encoder_offset",
        "contact",
    ],
)
def test_mjcf_has_the_dynamics_of_the_model(kind: str, name: str) -> None:
    mj = pytest.importorskip("mujoco")
    arm = make_arm(kind)
    model = mj.MjModel.from_xml_string(
        correct(found(arm, *([] if name == "none" else [place(name, arm)])), arm).render("mjcf")
    )
    data = mj.MjData(model)
    shift = np.zeros(arm.n_joints)
    shift[-1] = SIZES["encoder_offset"]["offset"] if name == "encoder_offset" else 0.0
    expected, got = [], []
    for q, dq, ddq in states(arm.n_joints):
        theta, extra, tilt = (arm.theta, 0.0, 0.0) if name == "none" else passive(name, arm, q, dq, ddq)
        expected.append(torque(arm, theta, q, dq, ddq, tilt) + extra)
        data.qpos[:], data.qvel[:], data.qacc[:] = q + shift, dq, ddq
        mj.mj_inverse(model, data)
        got.append(data.qfrc_inverse.copy())
    assert worst(expected, got) < EXACT


@pytest.mark.parametrize(("position", "stiffness"), [(0.5, -60.0), (-0.5, -60.0), (-0.5, 60.0)])
def test_the_sign_of_a_stops_stiffness_tells_its_side_in_mjcf(position: float, stiffness: float) -> None:
    mj = pytest.importorskip("mujoco")
    arm = make_arm("pendulum")
    stop = ("contact", 1, {"position": position, "stiffness": stiffness, "damping": 0.0})
    model = mj.MjModel.from_xml_string(correct(found(arm, stop), arm).render("mjcf"))
    data = mj.MjData(model)
    side = np.sign(position) * np.sign(stiffness)
    expected, got = [], []
    for q, dq, ddq in states(1):
        push = side * abs(stiffness) * max(side * (q[0] - position), 0.0)
        expected.append(torque(arm, arm.theta, q, dq, ddq, 0.0) + push)
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mj.mj_inverse(model, data)
        got.append(data.qfrc_inverse.copy())
    assert worst(expected, got) < EXACT


def test_a_coupling_of_a_remote_rotor_is_a_rotor_and_theta3() -> None:
    mj = pytest.importorskip("mujoco")
    arm, x = make_arm("two-link"), SIZES["rotor_coupling"]["inertia"]
    with_rotor = correct(found(arm, place("rotor_coupling", arm), ("rotor_inertia", 2, {"inertia": 0.05})), arm)
    model = mj.MjModel.from_xml_string(with_rotor.render("mjcf"))
    data, M = mj.MjData(model), np.zeros((2, 2))
    for q2 in (0.0, 1.0, 2.5):
        data.qpos[:] = 0.3, q2
        mj.mj_forward(model, data)
        mj.mj_fullM(model, data, M)
        t1, t2, t3 = arm.theta[:3]
        coupled = t3 + t2 * math.cos(q2) + x
        assert pytest.approx(np.array([[t1 + 2 * t2 * math.cos(q2), coupled], [coupled, t3 + 0.05]])) == M
    for alone in ({"inertia": 0.02}, {"inertia": -0.2}):  # a negative rotor; a link 2 without inertia
        model = correct(found(arm, ("rotor_coupling", None, alone)), arm)
        assert "no field for rotor_coupling" in model.render("mjcf")
        assert json.loads(model.render("json"))["effects"][0]["fields"]["mjcf"] is None


@pytest.mark.parametrize(
    "name", ["torque_offset", "torque_gain", "torque_saturation", "actuator_lag", "actuator_delay"]
)
def test_mjcf_drives_give_the_torque_of_the_effect(name: str) -> None:
    mj = pytest.importorskip("mujoco")
    arm = make_arm("two-link")
    model = mj.MjModel.from_xml_string(correct(found(arm, place(name, arm)), arm).render("mjcf"))
    data = mj.MjData(model)
    command, got = 3.0, []
    for _ in range(40):
        data.ctrl[1] = command
        mj.mj_step(model, data)
        got.append(float(data.actuator_force[1]))
    t = np.arange(40) * model.opt.timestep
    expected = {
        "torque_offset": np.full(40, command + SIZES["torque_offset"]["offset"]),
        "torque_gain": np.full(40, command * SIZES["torque_gain"]["gain"]),
        "torque_saturation": np.full(40, SIZES["torque_saturation"]["level"]),
        "actuator_lag": command * (1 - np.exp(-t / SIZES["actuator_lag"]["time_constant"])),
        "actuator_delay": np.where(t > SIZES["actuator_delay"]["delay"] - 1e-9, command, 0.0),
    }[name]
    assert got == pytest.approx(expected.tolist(), abs=1e-12)


def test_mjcf_holds_a_joint_that_friction_holds() -> None:
    """The figure of docs/how-to/export.md: one second at 95 % of the Coulomb level."""
    mj = pytest.importorskip("mujoco")
    arm = make_arm("two-link")
    model = mj.MjModel.from_xml_string(correct(found(arm), arm).render("mjcf"))
    data = mj.MjData(model)
    data.ctrl[:] = 0.95 * arm.theta[7:]
    while data.time < 1:
        mj.mj_step(model, data)
    assert np.all(np.abs(data.qpos) < 1e-6)


def test_mjcf_moves_as_armgap_simulates() -> None:
    """All that both know at once, without dry friction, which MuJoCo softens."""
    mj = pytest.importorskip("mujoco")
    arm = make_arm("two-link")
    arm = replace(arm, theta=np.r_[arm.theta[:7], 0.0, 0.0])
    names = ["payload", "rotor_inertia", "joint_spring", "quadratic_drag", "torque_offset", "torque_gain", "base_tilt"]
    causes = [place(name, arm) for name in names]
    t = np.arange(101) * arm.sample_period
    tau = np.column_stack([8 * np.sin(9 * t + 1), 1.5 * np.cos(14 * t)])
    start = np.array([0.3, -0.2])
    placed = [Effect(*cause) for cause in causes]
    log = simulate(arm, t, tau, q0=start, effects=placed, encoder=False)
    root = ET.fromstring(correct(found(arm, *causes), arm).render("mjcf"))
    option = root.find("option")
    assert option is not None
    option.set("integrator", "RK4")
    model = mj.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    data = mj.MjData(model)
    data.qpos[:], rows = start, []
    steps = round(arm.sample_period / model.opt.timestep)
    for k in range(len(t)):
        rows.append(data.qpos.copy())
        data.ctrl[:] = tau[k]
        mj.mj_step(model, data, steps)
    assert np.max(np.abs(np.array(rows) - log.q)) < 1e-6


@pytest.mark.parametrize("kind", THETA)
@pytest.mark.parametrize("name", ["none", "payload", "base_tilt", "encoder_offset", "rotor_inertia"])
def test_urdf_has_the_rigid_dynamics_of_the_model(kind: str, name: str) -> None:
    pin = pytest.importorskip("pinocchio")
    arm = make_arm(kind)
    cause = [] if name == "none" else [(name, 1 if name == "rotor_inertia" else place(name, arm)[1], SIZES[name])]
    model = pin.buildModelFromXML(correct(found(arm, *cause), arm).render("urdf"))
    data = model.createData()
    shift = np.zeros(arm.n_joints)
    shift[-1] = SIZES["encoder_offset"]["offset"] if name == "encoder_offset" else 0.0
    expected, got = [], []
    for q, dq, ddq in states(arm.n_joints):
        theta, extra, tilt = (
            passive(name, arm, q, dq, ddq) if cause and name != "rotor_inertia" else (arm.theta, 0.0, 0.0)
        )
        rigid = (
            torque(arm, theta, q, dq, ddq, tilt)
            + extra
            - torque(arm, np.r_[0 * theta[: arm.n_inertial], theta[arm.n_inertial :]], q, dq, ddq)
        )
        if name == "rotor_inertia" and cause:
            rigid[0] += SIZES[name]["inertia"] * ddq[0]
        expected.append(rigid)
        x = q + shift
        turned = x if kind == "axis" else np.ravel(np.column_stack([np.cos(x), np.sin(x)]))
        got.append(pin.rnea(model, data, turned, dq, ddq).copy())
    assert worst(expected, got) < EXACT
    n, b = arm.n_joints, arm.n_inertial
    assert model.damping == pytest.approx(arm.theta[b : b + n])
    assert model.friction == pytest.approx(arm.theta[b + n :])


def test_two_springs_of_one_joint_add_up() -> None:
    arm, q = make_arm("pendulum"), np.linspace(-2, 2, 9)
    linear, hard = SIZES["joint_spring"], SIZES["hardening_spring"]
    wanted = -linear["k"] * (q - linear["q0"]) - hard["k"] * (q - hard["q0"]) - hard["cubic"] * (q - hard["q0"]) ** 3
    for order in (("joint_spring", "hardening_spring"), ("hardening_spring", "joint_spring")):
        [j] = correct(found(arm, *(place(name, arm) for name in order)), arm).joints
        assert j.offset - j.stiffness * (q - j.rest) - j.cubic * (q - j.rest) ** 3 == pytest.approx(wanted)
