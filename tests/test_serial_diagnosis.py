"""Diagnosis of serial arms: what is hidden is named, what is not there is not, and input that contradicts the arm file is refused or mended."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armgap import Arm, CustomEffect, Diagnosis, Log, diagnose, simulate
from armgap.check import Corrections
from armgap.check.serial.contradictions import contradictions
from armgap.errors import LogShapeError, OptionError
from armgap.fleet import read_manifest, run_fleet
from armgap.report import diagnosis_document, diagnosis_report
from armgap.simulation import Effect

#: A hanging arm of three joints: the base turns about the vertical, shoulder and elbow about horizontal axes.
THREE = """\
name = "three joints"
kind = "serial"
gravity = [0.0, 0.0, -9.81]
sample_period = 0.004
trust = "published"

[friction]
viscous = [0.8, 0.9, 0.5]
coulomb = [0.9, 1.0, 0.6]

[drive]
rotor_inertia = [0.25, 0.3, 0.12]

[encoder]
counts_per_rev = [1000000, 1000000, 1000000]

[[link]]
joint = "base"
placement = {xyz = [0.0, 0.0, 0.0], rpy = [0.0, 0.0, 0.0]}
mass = 3.0
com = [0.0, 0.02, -0.1]
inertia = {ixx = 0.03, ixy = 0.0, iyy = 0.03, ixz = 0.0, iyz = 0.0, izz = 0.02}

[[link]]
joint = "shoulder"
placement = {xyz = [0.0, 0.1, -0.2], rpy = [1.5707963267948966, 0.0, 0.0]}
mass = 4.0
com = [0.02, -0.2, 0.03]
inertia = {ixx = 0.06, ixy = 0.0, iyy = 0.01, ixz = 0.0, iyz = 0.0, izz = 0.06}

[[link]]
joint = "elbow"
placement = {xyz = [0.0, -0.4, 0.0], rpy = [0.0, 0.0, 0.0]}
mass = 2.0
com = [0.01, -0.15, -0.02]
inertia = {ixx = 0.02, ixy = 0.0, iyy = 0.004, ixz = 0.0, iyz = 0.0, izz = 0.02}
"""
#: Size of the torques [N m].
TORQUE = np.array([4.0, 6.0, 3.0])
PERIOD, SECONDS = 0.004, 8.0
#: A cause of these logs without disturbances is more probable than this.
SURE = 0.8
#: Relative error of an estimated size; encoder steps are the only noise.
CLOSE = 0.1
QUARTER = np.pi / 2


@pytest.fixture(scope="module")
def arm_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("serial") / "arm.toml"
    path.write_text(THREE)
    return path


@pytest.fixture(scope="module")
def arm(arm_path: Path) -> Arm:
    return Arm.read(arm_path)


def torques(seed: int, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Random smooth torques: six sines of 0.1 to 2 Hz per joint."""
    rng = np.random.default_rng(seed)
    t = PERIOD * np.arange(round(seconds / PERIOD))
    rate, phase = rng.uniform(0.6, 12.0, (2, 6, 3))[0], rng.uniform(0, 2 * np.pi, (6, 3))
    tau = np.sin(t[:, None, None] * rate + phase).sum(axis=1) * TORQUE / np.sqrt(6)
    return t, tau * (1 - np.exp(-t / 0.2))[:, None]


def logs(real: Arm, *effects: Effect, seconds: float = SECONDS, seed: int = 0) -> list[Log]:
    """Two training logs and a holdout of an arm with effects."""
    found = []
    for number in range(3):
        t, tau = torques(10 * seed + number, seconds)
        name = f"log-{number}"
        found.append(simulate(real, t, tau, effects=effects, noise=2e-6, seed=number, tolerance=1e-8, name=name))
    return found


def asked(given: list[Log], arm: Arm, **options: object) -> Diagnosis:
    return diagnose(given[:2], arm, holdout=given[2:], **options)


@pytest.fixture(scope="module")
def quiet(arm: Arm) -> list[Log]:
    """Logs of the nominal arm."""
    return logs(arm)


@pytest.fixture(scope="module")
def sticky(arm: Arm) -> list[Log]:
    return logs(arm, Effect("stribeck", 2, {"amplitude": 1.5, "velocity": 0.15}))


@pytest.fixture(scope="module")
def found(sticky: list[Log], arm: Arm) -> Diagnosis:
    return asked(sticky, arm)


def test_the_nominal_arm_has_no_cause(quiet: list[Log], arm: Arm) -> None:
    result = asked(quiet, arm)
    assert result.verdict in ("none", "parameters")
    assert not result.causes
    assert not result.candidates
    assert result.gap.unexplained == 0.0


def test_friction_of_one_joint_is_named_with_its_size(found: Diagnosis) -> None:
    cause = found.causes[0]
    assert (found.verdict, cause.effect, cause.joint) == ("effect", "stribeck", 2)
    assert cause.probability > SURE
    assert cause.parameters["amplitude"].value == pytest.approx(1.5, rel=CLOSE)
    assert cause.parameters["velocity"].value == pytest.approx(0.15, rel=CLOSE)
    assert all(after < before for before, after in zip(found.gap.before, found.gap.after, strict=True))


def test_a_torque_offset_is_named(arm: Arm) -> None:
    result = asked(logs(arm, Effect("torque_offset", 3, {"offset": 0.4})), arm)
    cause = result.causes[0]
    names = [(cause.effect, cause.joint), *((e.effect, e.joint) for e in cause.equivalents)]
    assert ("torque_offset", 3) in names
    assert len(result.causes) == 1


def test_a_payload_is_named(arm: Arm) -> None:
    mass, com = 0.8, np.array([0.0, -0.3, 0.0])
    square = float(com @ com) * np.eye(3) - np.outer(com, com)
    theta = arm.theta.copy()
    theta[20:30] += mass * np.array(
        [1, *com, square[0, 0], square[0, 1], square[1, 1], square[0, 2], square[1, 2], square[2, 2]]
    )
    trusted = replace(arm, sigma=0.2 * arm.sigma)
    result = asked(logs(replace(arm, theta=theta)), trusted)
    cause = result.causes[0]
    assert (cause.effect, cause.joint) == ("payload", None)
    assert cause.parameters["mass"].value == pytest.approx(mass, rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "family"), [(11, "SO-101-like"), (11, "UR10-like")])
def test_a_tilt_of_the_base_is_named(seed: int, family: str) -> None:
    pytest.importorskip("mujoco")
    from serial_trial.case import make_case

    case = make_case(seed, 0, "base_tilt", family=family, duration=8.0)
    cause = diagnose(case.training, case.arm, holdout=case.holdout).causes[0]
    assert (cause.effect, cause.joint) == ("base_tilt", None)
    assert cause.probability > SURE


# Input


def swapped(q: np.ndarray, tau: np.ndarray) -> None:
    q[:, [1, 2]], tau[:, [1, 2]] = q[:, [2, 1]], tau[:, [2, 1]]


def flipped(_: np.ndarray, tau: np.ndarray) -> None:
    tau[:, 1] *= -1


def turned(q: np.ndarray, _: np.ndarray) -> None:
    q[:, 1] += QUARTER


def wrong(given: list[Log], arm: Arm, change: Callable[[np.ndarray, np.ndarray], None]) -> list[Log]:
    """Logs with wrong columns."""
    changed = []
    for log in given:
        q, tau = log.q.copy(), log.tau.copy()
        change(q, tau)
        changed.append(Log.from_arrays(log.t, q, tau, name=log.name, arm=arm))
    return changed


def read(remedy: str) -> Corrections:
    """The corrections that options such as ``--swap q2,q3 --swap tau2,tau3`` ask for."""
    words = remedy.split()
    given: dict[str, list[str]] = {}
    for option, word in zip(words[::2], words[1::2], strict=True):
        given.setdefault(option.removeprefix("--"), []).append(word)
    return Corrections.parse(**given)


@pytest.mark.parametrize(
    ("change", "check", "remedy"),
    [
        (swapped, "joint_order", "--swap q2,q3 --swap tau2,tau3"),
        (flipped, "torque_sign", "--flip tau2"),
        (turned, "position_zero", "--zero q2=-90deg"),
    ],
    ids=["joint_order", "torque_sign", "position_zero"],
)
def test_columns_that_contradict_the_arm_file(
    change: Callable[[np.ndarray, np.ndarray], None], check: str, remedy: str, quiet: list[Log], arm: Arm
) -> None:
    given = wrong(quiet, arm, change)
    result = asked(given, arm)
    assert result.verdict == "input"
    assert not result.causes
    [error] = [c for c in result.checks if c.severity == "error"]
    assert error.check == check
    assert error.remedies[0] == remedy
    mended = asked(given, arm, corrections=read(remedy))
    assert mended.verdict in ("none", "parameters")
    assert not [c for c in mended.checks if c.severity == "error"]


def test_a_sign_has_one_remedy_where_the_arm_is_not_its_mirror_image(arm_path: Path) -> None:
    path = arm_path.with_name("askew.toml")
    path.write_text(THREE.replace("rpy = [1.5707963267948966, 0.0, 0.0]", "rpy = [2.0, 0.4, 0.6]"))
    askew = Arm.read(path)
    _, [error] = contradictions(wrong(logs(askew), askew, flipped), askew)
    assert (error.check, error.remedies) == ("torque_sign", ("--flip tau2",))


def test_a_log_that_is_too_short(arm: Arm) -> None:
    with pytest.raises(LogShapeError, match="less than the horizon") as caught:
        diagnose(logs(arm, seconds=0.6)[0], arm)
    assert "\n" not in str(caught.value)


def test_more_joints_than_seven(arm_path: Path) -> None:
    link = (
        '[[link]]\njoint = "j{}"\nmass = 1.0\ncom = [0.0, 0.1, 0.0]\ninertia = {{ixx = 0.02, iyy = 0.01, izz = 0.02}}\n'
    )
    path = arm_path.with_name("eight.toml")
    path.write_text('kind = "serial"\nsample_period = 0.004\n' + "".join(link.format(j) for j in range(8)))
    eight = Arm.read(path)
    t = PERIOD * np.arange(500)
    q = np.sin(np.outer(t, np.linspace(1.0, 3.0, 8)))
    with pytest.raises(OptionError, match=r"8 joints.*armgap model .*--freeze JOINT=POSITION") as caught:
        diagnose(Log.from_arrays(t, q, q, arm=eight), eight)
    assert "\n" not in str(caught.value)


def test_custom_effects_are_refused(quiet: list[Log], arm: Arm) -> None:
    fan = CustomEffect("fan_drag", 2, lambda t, q, dq, tau: -dq[:, 1])
    with pytest.raises(OptionError, match="serial") as caught:
        diagnose(quiet[0], arm, effects=[fan])
    assert "\n" not in str(caught.value)


# Results


def test_the_result_survives_its_file(found: Diagnosis) -> None:
    again = Diagnosis.from_dict(json.loads(found.to_json()))
    assert again.to_dict() == found.to_dict()
    assert [c.effect for c in again.causes] == [c.effect for c in found.causes]


def test_the_same_seed_gives_the_same_result(found: Diagnosis, sticky: list[Log], arm: Arm) -> None:
    once, twice = ({k: v for k, v in r.to_dict().items() if k != "seconds"} for r in (found, asked(sticky, arm)))
    assert once == twice


def test_pushes_that_do_not_stand_out_are_absent(found: Diagnosis) -> None:
    looked_for = {(r.effect, r.joint): r for r in found.ruled_out if r.effect == "external_pulse"}
    assert len(looked_for) == 3
    why = "no push stands out of what the model lacks in any of these logs"
    assert {(r.status, r.why) for r in looked_for.values()} == {("absent", why)}


def test_a_push_is_named_with_its_log(arm: Arm) -> None:
    push = Effect("external_pulse", 2, {"impulse": 1.2, "time": 4.0, "duration": 0.2})

    def log(number: int, *effects: Effect) -> Log:
        t, tau = torques(number, SECONDS)
        return simulate(arm, t, tau, effects=effects, noise=1e-4, seed=number, tolerance=1e-8, name=f"log-{number}")

    result = asked([log(21, push), log(0), log(1)], arm)
    [cause] = result.causes
    assert (cause.effect, cause.joint, cause.log) == ("external_pulse", 2, "log-21")
    assert cause.parameters["impulse"].value == pytest.approx(1.2, rel=0.2)
    assert cause.parameters["time"].value == pytest.approx(4.0, abs=0.05)


def test_transmissions_are_tested_on_every_joint(found: Diagnosis) -> None:
    tested = [r for r in found.ruled_out if r.effect in ("backlash", "joint_elasticity")]
    assert len(tested) == 6
    assert not any("not tested" in (r.why or "") for r in tested)


def test_the_command_writes_json_and_a_report(
    sticky: list[Log], arm_path: Path, tmp_path: Path, run: Callable[..., tuple[int, str, str]]
) -> None:
    for log in sticky:
        log.write(tmp_path / f"{log.name}.parquet")
    first, second, held = (str(tmp_path / f"{log.name}.parquet") for log in sticky)
    target, page = tmp_path / "gap.json", tmp_path / "gap.html"
    status, out, err = run(
        "diagnose",
        first,
        second,
        "--arm",
        str(arm_path),
        "--holdout",
        held,
        "--json",
        str(target),
        "--report",
        str(page),
    )
    assert (status, err) == (0, "")
    assert "Stribeck" in out
    assert json.loads(target.read_text())["causes"][0]["effect"] == "stribeck"
    assert "Stribeck" in page.read_text()
    status, out, err = run("compare", str(target), str(target))
    assert (status, err) == (0, "")


def test_a_fleet_takes_serial_arms(sticky: list[Log], arm_path: Path, tmp_path: Path) -> None:
    for log in sticky:
        log.write(tmp_path / f"{log.name}.parquet")
    (tmp_path / "arm.toml").write_text(arm_path.read_text())
    rows = "robot,arm,logs,holdout,time\nnorth,arm.toml,log-0.parquet;log-1.parquet,log-2.parquet,2026-01-01\n"
    (tmp_path / "manifest.csv").write_text(rows)
    fleet = run_fleet(read_manifest(tmp_path / "manifest.csv"), tmp_path / "out", workers=1)
    assert fleet.failed.is_empty()
    assert fleet.summary["effect"].to_list()[0] == "stribeck"
    assert (tmp_path / "out" / "index.html").is_file()


# Reports


def test_a_report_has_no_empty_section(found: Diagnosis) -> None:
    document = diagnosis_document(found)
    titles = [section.title for section in document.sections]
    assert not {
        "Ranking of causes",
        "The gap by joint and regime",
        "The evidence: each cause against its own variable",
    } & set(titles)
    for section in document.sections:
        assert any((section.text, section.figures, section.tables, section.points, section.notes)), section.title
        assert all(table.rows for table in section.tables), section.title
    for text in (diagnosis_report(found, "gap.md"), diagnosis_report(found, "gap.html")):
        assert "Stribeck" in text
        assert "armgap export DIAGNOSIS.json" in text
        assert "--model ROBOT.urdf" in text


def test_joints_that_slide_have_their_own_unit(found: Diagnosis) -> None:
    data = found.to_dict()
    data["arm"] = data["arm"] | {"joint_unit": ["rad", "m", "rad"]}
    [far] = [a for a in diagnosis_document(data).answers if a.question == "How far does it shrink?"]
    units = re.findall(r"joint \d: [^;]*?(mrad|mm)", far.detail, re.IGNORECASE)
    assert units == ["mrad", "mm", "mrad"]


def test_friction_of_all_joints_is_one_cause(arm: Arm) -> None:
    """The arm's own law on each joint; another amplitude on each."""
    amplitudes = (1.2, 1.5, 0.8)
    everywhere = [Effect("stribeck", j, {"amplitude": a, "velocity": 0.15}) for j, a in enumerate(amplitudes, 1)]
    cause = asked(logs(arm, *everywhere), arm).causes[0]
    assert (cause.effect, cause.joint, cause.joints) == ("stribeck", None, (1, 2, 3))
    np.testing.assert_allclose(cause.values["amplitude"].value, amplitudes, rtol=0.3)
    assert cause.probability > SURE


def test_one_delay_of_all_joints_is_one_cause(arm: Arm) -> None:
    late = 0.012
    found = asked(logs(arm, *(Effect("actuator_delay", j, {"delay": late}) for j in (1, 2, 3))), arm)
    cause = found.causes[0]
    assert cause.effect in ("actuator_delay", "actuator_lag")
    assert cause.joints == (1, 2, 3)
    assert len(found.causes) == 1


def test_friction_that_would_drive_its_joint_is_a_torque(arm: Arm) -> None:
    # While the joint moves, Coulomb friction that differs by direction is the same torque; 1.5 N m of it would exceed the joint's 1 N m.
    result = asked(logs(arm, Effect("torque_offset", 2, {"offset": 1.5})), arm)
    assert [(c.effect, c.joint) for c in result.causes] == [("torque_offset", 2)]
    assert result.causes[0].parameters["offset"].value == pytest.approx(1.5, rel=CLOSE)
    assert result.gap.unexplained < CLOSE
