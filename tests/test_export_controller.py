"""Exports of a diagnosis that names settings of the position controller: gains are corrected where a format has them, and said where it has not."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armgap import Arm, Diagnosis, correct, read_model
from armgap.export import ExportError, into_description
from export_cases import found
from test_commanded import ARM, arm_of

Run = Callable[..., tuple[int, str, str]]

#: Two hinges, the first with a geared position actuator and a velocity actuator, the second with a servo of a damping ratio.
MODEL = """\
<mujoco model="servos"><compiler angle="radian"/><option timestep="0.002"/>
<worldbody><body name="a"><geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.04"/><joint name="j1" axis="0 1 0" damping="0.3 0.2"/>
<body name="b" pos="0 0 0.3"><geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.04"/><joint name="j2" axis="0 1 0" damping="0.2"/>
</body></body></worldbody>
<actuator><position name="p1" joint="j1" kp="50" kv="1" gear="2"/><velocity name="v1" joint="j1" kv="3"/>
<position name="p2" jointinparent="j2" kp="40" dampratio="1" armature="0.1" damping="0.05"/></actuator></mujoco>
"""
GAIN = ("controller_gain", 1, {"gain": 0.7})
DAMPING = ("controller_damping", 1, {"kd_difference": 1.4})
LATE = ("reference_delay", 2, {"delay": 0.0061})


def commanded(folder: Path, *causes: Any) -> tuple[Arm, Diagnosis]:
    arm = arm_of(folder)
    return arm, found(arm, *causes)


def test_an_arm_file_has_the_corrected_gains(tmp_path: Path) -> None:
    arm, diagnosis = commanded(tmp_path, GAIN, DAMPING)
    model = correct(diagnosis, arm)
    assert model.remarks("toml") == ()
    again = arm_of(tmp_path, model.render("toml"))
    assert again.controller is not None
    np.testing.assert_allclose(again.controller.kp, [42.0, 30.0])
    np.testing.assert_allclose(again.controller.kd, [3.4, 1.0])
    data = json.loads(model.render("json"))
    assert data["controller"]["kp"] == again.controller.kp.tolist()
    assert [effect["fields"]["toml"] for effect in data["effects"]] == ["controller.kp", "controller.kd"]


def test_a_derivative_gain_is_not_negative(tmp_path: Path) -> None:
    arm, diagnosis = commanded(tmp_path, ("controller_damping", 2, {"kd_difference": -1.5}))
    model = correct(diagnosis, arm)
    assert any("kd of joint 2 would be -0.5" in line for line in model.remarks("toml"))
    again = arm_of(tmp_path, model.render("toml"))
    assert again.controller is not None
    assert again.controller.kd.tolist() == [2.0, 0.0]


@pytest.mark.parametrize(("form", "why"), [("mjcf", "its actuators are motors"), ("urdf", "URDF holds no controller")])
def test_formats_without_a_controller_say_so(form: str, why: str, tmp_path: Path) -> None:
    arm, diagnosis = commanded(tmp_path, GAIN)
    text = correct(diagnosis, arm).render(form)
    assert why in text
    assert "no field for controller_gain of joint 1 (gain 0.7): set kp = 42 in your own controller" in text
    plain = replace(arm, controller=None)
    assert "controller" not in correct(found(plain), plain).render(form)


def test_a_gain_without_a_controller_is_refused(tmp_path: Path) -> None:
    arm = arm_of(tmp_path, ARM)
    with pytest.raises(ExportError, match=r"no \[controller\].*give the arm file of the diagnosis"):
        correct(found(arm, GAIN), arm)


def test_estimated_gains_are_mentioned(tmp_path: Path) -> None:
    arm, diagnosis = commanded(tmp_path, GAIN)
    note = "gains of the controller, estimated (stated): kp1 55 ± 1 (60)"
    told = Diagnosis.from_dict(diagnosis.to_dict() | {"notes": [note, "another note"]})
    said = correct(told, arm).remarks("toml")
    assert said == (f"{note}; those stated are kept",)


def test_commands_in_an_arm_file_are_accepted(tmp_path: Path, run: Run) -> None:
    """Settings of the controller are no effects of `armgap simulate`; what is written of the others runs as it stands."""
    arm, diagnosis = commanded(tmp_path, GAIN, LATE, ("stribeck", 1, {"amplitude": 0.5, "velocity": 0.2}))
    text = correct(diagnosis, arm).render("toml")
    (tmp_path / "THIS.toml").write_text(text)
    [command] = [line for line in text.splitlines() if line.startswith("# armgap simulate")]
    words = [str(tmp_path / w) if w in ("THIS.toml", "OUT.parquet") else w for w in shlex.split(command)[2:]]
    words = ["seed" if word == "LOG" else word for word in words]
    status, _, err = run(*words, "--duration", "0.1", "--quiet")
    assert (status, err) == (0, "")
    arm, diagnosis = commanded(tmp_path, GAIN, LATE)
    assert "armgap simulate" not in correct(diagnosis, arm).render("toml")
    assert "no field for reference_delay of joint 2 (delay 0.0061): delay the reference" in text


def compiled(text: str | bytes) -> Any:
    mujoco = pytest.importorskip("mujoco")
    return mujoco.MjModel.from_xml_string(text.decode() if isinstance(text, bytes) else text)


def gains(model: Any) -> tuple[list[float], list[float]]:
    """Position and derivative gains of the two joints."""
    square = model.actuator_gear[:, 0] ** 2
    kp, kd = -model.actuator_biasprm[:, 1] * square, -model.actuator_biasprm[:, 2] * square
    return [kp[0], kp[2]], [kd[0] + kd[1], kd[2]]


def test_actuators_of_a_user_s_own_mjcf_take_the_gains(tmp_path: Path) -> None:
    path = tmp_path / "own.xml"
    path.write_text(MODEL)
    before = compiled(MODEL)
    arm = read_model(path)
    assert arm.controller is not None
    np.testing.assert_allclose(gains(before)[0], arm.controller.kp)
    np.testing.assert_allclose(gains(before)[1], arm.controller.kd)
    np.testing.assert_allclose(arm.controller.kp, [200.0, 40.0])

    same = compiled(into_description(correct(found(arm), arm), path).content)
    np.testing.assert_allclose(gains(same)[0], gains(before)[0], rtol=1e-5)
    np.testing.assert_allclose(gains(same)[1], gains(before)[1], rtol=1e-5)

    written = into_description(correct(found(arm, GAIN, DAMPING, LATE), arm), path)
    after = compiled(written.content)
    np.testing.assert_allclose(gains(after)[0], [140.0, 40.0], rtol=1e-5)
    np.testing.assert_allclose(gains(after)[1], [7.0 + 1.4, arm.controller.kd[1]], rtol=1e-5)
    # References keep their scale: a command means the same position.
    np.testing.assert_allclose(after.actuator_gainprm[0, 0], -after.actuator_biasprm[0, 1])
    np.testing.assert_allclose(after.actuator_gainprm[1, 0], -after.actuator_biasprm[1, 2])
    np.testing.assert_allclose(after.actuator_delay, [0.0, 0.0, 0.006])
    assert not any("no field" in line or "controller" in line for line in written.remarks)
    assert any("reference of joint `j2` is late by 0.006 s" in line for line in written.remarks)


def test_a_joint_s_own_damping_is_not_counted_twice(tmp_path: Path) -> None:
    """Armature and damping of an actuator are in the joint's values, and further coefficients of damping stay."""
    path = tmp_path / "own.xml"
    path.write_text(MODEL)
    arm = read_model(path)
    written = into_description(correct(found(arm), arm), path)
    before, after = compiled(MODEL), compiled(written.content)
    assert after.dof_damping[1] + after.actuator_damping[2] == pytest.approx(0.25)
    assert after.dof_armature[1] + after.actuator_armature[2] == pytest.approx(0.1)
    np.testing.assert_allclose(after.dof_dampingpoly, before.dof_dampingpoly)
    assert any("`j1` keeps its further coefficients of damping" in line for line in written.remarks)


def test_a_model_without_position_actuators_says_so(tmp_path: Path) -> None:
    path = tmp_path / "own.xml"
    path.write_text(MODEL)
    arm = read_model(path)
    path.write_text(MODEL.replace('<position name="p1" joint="j1" kp="50" kv="1" gear="2"/>', '<motor joint="j1"/>'))
    written = into_description(correct(found(arm, GAIN), arm), path)
    assert any("no position actuator of joint `j1`: controller_gain is not in" in line for line in written.remarks)
    assert b"controller_gain is not in the file (kp 140" in written.content
