"""Actuators of MJCF models: an arm file's controller makes MuJoCo's torques, and what it has no place for is said."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from armgap import Arm, read_model

Run = Callable[..., tuple[int, str, str]]

mujoco = pytest.importorskip("mujoco", reason="the extra trial is not installed")


def two_joints(actuators: str, joint: str = "", body: str = "", further: str = "") -> str:
    """Return an MJCF model of two hinges with attributes of its first joint and of both bodies."""
    shape = '<geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.04"/>'
    return f"""<mujoco model="m"><compiler angle="radian"/>
<worldbody><body name="a" {body}>{shape}<joint name="j1" axis="0 1 0" {joint}/>
<body name="b" pos="0 0 0.3" {body}>{shape}<joint name="j2" axis="0 1 0"/></body></body></worldbody>
{further}<actuator>{actuators}</actuator></mujoco>"""


SECOND = '<position joint="j2" kp="40" kv="1"/>'


def read(folder: Path, text: str) -> Arm:
    path = folder / "model.xml"
    path.write_text(text)
    return read_model(path)


def said(arm: Arm, *words: str) -> bool:
    """Whether one of the arm's notes has all words."""
    return any(all(word in note for word in words) for note in arm.notes)


#: Actuators of joint 1, and the factor and offset that make its `q_ref` of its command.
LAWS = {
    "plain": ('<position joint="j1" kp="50" kv="2"/>', 1.0, 0.0),
    "beside a velocity actuator": ('<position joint="j1" kp="50" kv="2"/><velocity joint="j1" kv="3"/>', 1.0, 0.0),
    "gears": ('<position joint="j1" kp="50" kv="1" gear="-3"/><velocity joint="j1" kv="3" gear="2"/>', -1 / 3, 0.0),
    "constant": ('<general joint="j1" gainprm="50" biastype="affine" biasprm="3 -50 -2"/>', 1.0, 0.06),
    "gain": ('<general joint="j1" gainprm="20" biastype="affine" biasprm="0 -50 -2"/>', 0.4, 0.0),
    "in the parent's frame": ('<position jointinparent="j1" kp="50" kv="2"/>', 1.0, 0.0),
}


@pytest.mark.parametrize("law", LAWS)
def test_the_controller_makes_mujoco_s_torque(law: str, tmp_path: Path) -> None:
    actuators, factor, offset = LAWS[law]
    text = two_joints(actuators + SECOND)
    arm = read(tmp_path, text)
    assert arm.controller is not None
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(1)
    for _ in range(5):
        q, dq, command = rng.uniform(-1, 1, (3, 2))
        # Velocity actuators, between the two position actuators, have the command 0.
        data.qpos[:], data.qvel[:], data.ctrl[:], data.ctrl[0], data.ctrl[-1] = q, dq, 0.0, *command
        mujoco.mj_forward(model, data)
        q_ref = command * [factor, 1.0] + [offset, 0.0]
        torque = arm.controller.kp * (q_ref - q) - arm.controller.kd * dq
        np.testing.assert_allclose(torque, data.qfrc_actuator, rtol=1e-12)
    assert said(arm, "q_ref is not", "`j1`") == (factor != 1.0 or offset != 0.0)
    assert said(arm, "velocity actuators", "kd_on", "`j1`") == ("<velocity" in actuators)


def test_actuators_rotor_and_damping_are_the_joint_s(tmp_path: Path) -> None:
    text = two_joints('<motor joint="j1" gear="3" armature="0.2" damping="0.5"/>', 'armature="0.1" damping="0.4"')
    arm = read(tmp_path, text)
    np.testing.assert_allclose(arm.theta[20:24], [0.1 + 9 * 0.2, 0.0, 0.4 + 9 * 0.5, 0.0])


def test_torque_limits_are_the_controller_s(tmp_path: Path) -> None:
    """With them on all joints the controller saturates as MuJoCo's actuators do; on some, that is said."""
    limit = '<position joint="j1" kp="50" gear="2" forcerange="-4 4"/>'
    some = read(tmp_path, two_joints(limit + SECOND))
    assert some.torque_limit is None
    assert said(some, "torque limits are no part of the controller", "`j1`")
    every = read(tmp_path, two_joints(limit + '<position joint="j2" kp="9" forcerange="-3 3"/>'))
    assert every.torque_limit is not None
    assert every.torque_limit.tolist() == [8.0, 3.0]
    motors = read(tmp_path, two_joints('<motor joint="j1" ctrlrange="-1 1"/><motor joint="j1" ctrlrange="-2 2"/>'))
    assert motors.chain is not None
    assert motors.chain.effort.tolist() == [3.0, np.inf]


#: What an arm file cannot hold: the model, and the words of the note.
SAID = {
    "filter": (two_joints('<position joint="j1" kp="50" timeconst="0.1"/>' + SECOND), ["activation", "`j1`", "0.1 s"]),
    "integrator": (two_joints('<intvelocity joint="j1" kp="5" actrange="-1 1"/>' + SECOND), ["activation", "integral"]),
    "delay": (two_joints('<position joint="j1" kp="5" delay="0.01" nsample="9"/>' + SECOND), ["late", "0.01 s"]),
    "limited commands": (
        two_joints('<position joint="j1" kp="50" ctrlrange="-1 2"/>' + SECOND),
        ["commands are limited", "`j1`", "-1 to 2"],
    ),
    "uneven limits": (two_joints('<position joint="j1" kp="50" forcerange="-9 7"/>' + SECOND), ["differ", "-9 to 7"]),
    "one without": (two_joints(SECOND), ["position actuators are left out", "`j1`"]),
    "velocity alone": (two_joints('<velocity name="v" joint="j1" kv="5"/>' + SECOND), ["velocity actuators", "`v`"]),
    "motor beside": (
        two_joints('<position joint="j1" kp="5"/><motor name="m" joint="j1"/>' + SECOND),
        ["other actuators beside", "`m`"],
    ),
    "two servos": (
        two_joints('<position joint="j1" kp="5"/><position joint="j1" kp="6"/>' + SECOND),
        ["several position actuators", "`j1`"],
    ),
    "damper": (two_joints('<damper joint="j1" kv="2" ctrlrange="0 1"/>'), ["no motors and no servos", "`j1`"]),
    "spring": (two_joints("", 'stiffness="3" springref="0.2"'), ["springs", "`j1`", "3 about 0.2"]),
    "quadratic damping": (two_joints("", 'damping="1 0.5 0.2"'), ["not proportional to the speed", "`j1`", "0.5, 0.2"]),
    "gravity compensation": (two_joints("", body='gravcomp="1"'), ["gravcomp", "left out", "`a`, `b`"]),
    "part of the weight": (
        two_joints('<position joint="j1" kp="5"/>' + SECOND, body='gravcomp="0.5"'),
        ["gravcomp", "position actuators are left out"],
    ),
    "tendon": (
        two_joints(
            '<motor name="pull" tendon="t"/>',
            further='<tendon><fixed name="t"><joint joint="j1" coef="1"/></fixed></tendon>',
        ),
        ["no single joint", "`pull`"],
    ),
    "medium": (two_joints("", further='<option density="1.2"/>'), ["medium"]),
}


@pytest.mark.parametrize("case", SAID)
def test_what_has_no_place_is_said(case: str, tmp_path: Path) -> None:
    text, words = SAID[case]
    arm = read(tmp_path, text)
    assert said(arm, *words), arm.notes
    plain = read(tmp_path, two_joints(LAWS["plain"][0] + SECOND))
    assert plain.notes == ("position actuators are taken as a PD controller",)


def test_notes_are_printed_and_stand_in_the_arm_file(tmp_path: Path, run: Run) -> None:
    model, file = tmp_path / "model.xml", tmp_path / "arm.toml"
    model.write_text(two_joints("", 'damping="1 0.5"'))
    status, out, _ = run("model", str(model), "-o", str(file))
    assert status == 0
    assert "not proportional" in " ".join(out.split())
    assert "# damping that is not proportional" in file.read_text()


def test_weight_that_the_servos_do_not_carry_is_left_out(tmp_path: Path) -> None:
    """Gravity compensation of all links beside position actuators is an arm without weight."""
    servos = '<position joint="j1" kp="50"/>' + SECOND
    arm = read(tmp_path, two_joints(servos, body='gravcomp="1"'))
    assert arm.controller is not None
    assert arm.chain is not None
    assert not arm.chain.gravity.any()
    assert said(arm, "gravity is 0", "gravcomp")
    heavy = read(tmp_path, two_joints(servos))
    assert heavy.chain is not None
    assert heavy.chain.gravity.tolist() == [0.0, 0.0, -9.81]
    off = read(tmp_path, two_joints(servos, further='<option><flag gravity="disable"/></option>'))
    assert off.chain is not None
    assert not off.chain.gravity.any()
