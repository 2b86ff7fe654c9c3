"""The serial trial's generator agrees with something else, its effects act where its keys say, and easy cases are diagnosed right."""

from __future__ import annotations

import itertools
import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from armgap import _native  # noqa: E402
from armgap.arm import controller  # noqa: E402
from armgap.arm.rigid_body import inconsistency  # noqa: E402
from serial_trial import arms, motion  # noqa: E402
from serial_trial.arms import FAMILIES, STEP, SerialRobot, draw_robot, perturbed  # noqa: E402
from serial_trial.case import (  # noqa: E402
    CLUTTERS,
    LEAST,
    NULLS,
    OFF,
    OUTSIDES,
    TRUST,
    effect_of,
    hidden_effect,
    make_case,
    sigma_of,
)
from serial_trial.effects import BESIDE, EFFECTS, OUTSIDE, Clutter, Effect, Moment, Null  # noqa: E402
from serial_trial.motion import SERVOS, Controller, Reference, Run, draw_controller, draw_reference, simulate, use_of  # noqa: E402
from serial_trial.run import OUTCOMES, ask, is_in_arm, outcome, report  # noqa: E402
from serial_trial.servo import COMMANDED  # noqa: E402
from serial_trial.visibility import MULTIPLE, SIGMAS, links, visibility  # noqa: E402

ROOT = Path(__file__).resolve().parents[1]
#: MuJoCo keeps inertias as principal moments and orientations as quaternions; relative to the largest torque of a joint.
SAME = 1e-6
#: Share of a joint's torque by which sharp friction of MuJoCo, an impedance of 0.9999, misses its Coulomb level while a joint moves.
SHARP = 2e-3
#: Share of the acceleration by which steps of half the length may differ; a torque half a step early or late makes 2e-3 to 5e-3.
CONVERGED = 5e-4
#: Speed [rad/s or m/s] from which a joint moves.
MOVING = 0.02
#: Share of what an effect does by which armgap's simulation may miss it; more of an asymmetry that is rounded at standstill or is not.
AGREE, OTHERWISE = 0.01, {"coulomb_asymmetry": 0.03}
#: Effects of which the torque at another joint may change by more than at their own, relative to that joint's torque: what they change is part
#: of the arm, or of both joints that a cable or a transmission couples.
OF_THE_ARM = {"nominal_link", "cable_spring", "coupled_transmission"}
#: The same, because links move otherwise than motors.
TRANSMISSIONS = {"joint_elasticity", "backlash"}
#: Share of the position error, and of the torque, by which a servo that holds its torque over half a millisecond and reads whole counts differs
#: from one that does not.
SERVO = 0.02
PERIOD, SAMPLES = 0.004, 600


def chain_of(robot: SerialRobot) -> _native.Chain:
    return _native.Chain(list(robot.kinds), robot.rotation, robot.translation, robot.axis, robot.gravity)


def reference_of(robot: SerialRobot, seed: int = 1) -> Reference:
    return draw_reference(robot, SAMPLES, PERIOD, np.random.default_rng(seed))


def moved(robot: SerialRobot, seed: int, effect: Effect | None = None, truth: SerialRobot | None = None) -> Run:
    """A log under PD with gravity, without disturbances."""
    rng = np.random.default_rng(seed)
    reference = draw_reference(robot, SAMPLES, PERIOD, rng)
    by: Controller = draw_controller("pd", robot, reference, PERIOD, rng)
    nothing = np.zeros((SAMPLES, robot.n))
    return simulate(truth or robot, robot, effect or Null(None), reference, by, nothing, PERIOD)


def frictionless(robot: SerialRobot) -> SerialRobot:
    return replace(robot, viscous=np.zeros(robot.n), coulomb=np.zeros(robot.n))


#: The values of an effect as armgap has them.
VALUES = {
    "stribeck": lambda e: {"amplitude": e.amplitude, "velocity": e.velocity},
    "coulomb_asymmetry": lambda e: {"delta": e.delta},
    "viscous_asymmetry": lambda e: {"delta": e.delta},
    "quadratic_drag": lambda e: {"c": e.c},
    "load_dependent_friction": lambda e: {"mu": e.mu},
    "position_dependent_friction": lambda e: {
        "a": e.amplitude * np.cos(e.position), "b": e.amplitude * np.sin(e.position),
    },
    "friction_warmup": lambda e: {"amplitude": e.amplitude, "time_constant": e.time},
    "torque_offset": lambda e: {"offset": e.offset},
    "torque_ripple": lambda e: {"amplitude": e.amplitude, "n": e.n, "phase": e.phase},
    "joint_spring": lambda e: {"k": e.k, "q0": e.q0},
    "contact": lambda e: {
        "position": e.position, "stiffness": e.stiffness * e.side * np.sign(e.position), "damping": e.damping,
    },
    "torque_saturation": lambda e: {"level": e.level},
    "torque_dead_zone": lambda e: {"level": e.level},
    "torque_gain": lambda e: {"gain": e.gain},
    "rotor_inertia": lambda e: {"inertia": e.inertia},
}  # fmt: skip


def missed(robot: SerialRobot, run: Run, effects: list[tuple[str, int, dict[str, float]]]) -> float:
    """How far armgap's simulation of the second joint misses over windows of a fifth of a second from true states, RMS [rad]."""
    chain, errors = chain_of(robot), []
    for first in range(0, SAMPLES - 50, 50):
        part = slice(first, first + 50)
        start = run.true_q[first], run.true_dq[first]
        q, _ = chain.simulate(robot.theta, run.t[part], run.tau[part], *start, effects, 1e-7)
        errors.append(q[:, 1] - run.true_q[part, 1])
    return float(np.sqrt(np.mean(np.square(errors))))


@pytest.fixture(scope="module")
def robot() -> SerialRobot:
    return draw_robot(np.random.default_rng(5), "UR10-like", 4)


@pytest.fixture(scope="module")
def clean(robot) -> Run:
    return moved(robot, 1)


@pytest.mark.parametrize("family", list(FAMILIES))
def test_without_friction_a_log_obeys_the_inverse_dynamics_of_the_chain(family) -> None:
    arm = frictionless(draw_robot(np.random.default_rng(3), family))
    run = moved(arm, 1)
    of_chain = chain_of(arm).inverse_dynamics(arm.theta, run.true_q, run.true_dq, run.true_ddq)
    model = arm.model()
    data = mujoco.MjData(model)
    of_engine = np.empty_like(of_chain)
    for k in range(len(run.t)):
        data.qpos[:], data.qvel[:], data.qacc[:] = run.true_q[k], run.true_dq[k], run.true_ddq[k]
        mujoco.mj_inverse(model, data)
        of_engine[k] = data.qfrc_inverse
    largest = np.max(np.abs(of_engine), axis=0)
    assert np.all(np.abs(of_chain - of_engine) < SAME * largest)
    assert np.all(np.abs(of_chain - run.applied) < SAME * largest), (
        "the torques of the log are not those that moved the arm"
    )


def test_friction_is_viscous_and_sharp(robot, clean) -> None:
    run = clean
    rigid = chain_of(robot).inverse_dynamics(frictionless(robot).theta, run.true_q, run.true_dq, run.true_ddq)
    friction = run.applied - rigid
    law = robot.viscous * run.true_dq + robot.coulomb * np.sign(run.true_dq)
    size = np.sqrt(np.mean(run.applied**2, axis=0))
    # At the sample that follows a reversal the velocity has not the sign that the step ends with.
    going = np.abs(run.true_dq) > MOVING + np.abs(run.true_ddq) * STEP
    assert np.all(going.any(axis=0))
    assert np.all(np.where(going, np.abs(friction - law), 0.0) < SHARP * size)


def test_a_held_torque_moves_the_arm_as_half_the_steps_do(robot, clean, monkeypatch) -> None:
    """Second differences over 16 ms, so that a torque that acts a step early or late would show."""
    by = Controller("open", np.zeros(robot.n), np.zeros(robot.n), clean.tau)
    still = replace(reference_of(robot), q=np.tile(clean.true_q[0], (SAMPLES, 1)))
    nothing = np.zeros((SAMPLES, robot.n))
    coarse = simulate(robot, robot, Null(None), still, by, nothing, PERIOD)
    for module in (arms, motion):
        monkeypatch.setattr(module, "STEP", STEP / 2)
    fine = simulate(robot, robot, Null(None), still, by, nothing, PERIOD)
    bent = [r.true_q[8:] - 2 * r.true_q[4:-4] + r.true_q[:-8] for r in (coarse, fine)]
    assert np.all(np.std(bent[0] - bent[1], axis=0) < CONVERGED * np.std(bent[1], axis=0))


def test_commands_are_held_and_positions_are_counts(robot, clean) -> None:
    run = clean
    counts = run.q / robot.step
    assert np.allclose(counts, np.round(counts), atol=1e-6)
    assert np.all(np.abs(run.q - run.true_q) <= 0.5001 * robot.step)
    assert np.array_equal(run.applied, run.tau)


@pytest.mark.parametrize("kind", list(SERVOS))
def test_a_servo_moves_the_arm_as_position_actuators_of_the_engine_do(robot, kind) -> None:
    rng = np.random.default_rng(3)
    reference = reference_of(robot)
    by = draw_controller(kind, robot, reference, PERIOD, rng)
    run = simulate(robot, robot, Null(None), reference, by, np.zeros((SAMPLES, robot.n)), PERIOD)
    numbers = itertools.count()
    named = re.sub(r"<joint ", lambda _: f'<joint name="j{next(numbers)}" ', robot.mjcf())
    actuators = "".join(
        f'<position joint="j{j}" kp="{by.kp[j]:.17g}" kv="{by.kd[j]:.17g}" forcerange="{-robot.effort[j]:.17g} {robot.effort[j]:.17g}"/>'
        for j in range(robot.n)
    )
    model = mujoco.MjModel.from_xml_string(named.replace("</mujoco>", f"<actuator>{actuators}</actuator></mujoco>"))
    data = mujoco.MjData(model)
    data.qpos[:] = run.true_q[0]
    moved_by_engine = np.empty_like(run.true_q)
    for k in range(SAMPLES):
        moved_by_engine[k] = data.qpos
        data.ctrl[:] = reference.q[k]
        for _ in range(round(PERIOD / STEP)):
            mujoco.mj_step(model, data)
    error = np.std(reference.q - run.true_q, axis=0)
    assert np.all(np.std(moved_by_engine - run.true_q, axis=0) < SERVO * error)
    # The mean torque of the log is that of the stated gains on the mean position and velocity, half a step ago as it is held over steps.
    ago = run.true_q - 0.5 * STEP * run.true_dq
    mean = controller.Controller(by.kp, by.kd).torque(run.t, ago, reference.q, limit=robot.effort)
    size = np.sqrt(np.mean(run.tau**2, axis=0))
    assert np.all(np.std((mean - run.tau)[:-1], axis=0) < SERVO * size)


@pytest.mark.parametrize("name", [name for name in COMMANDED if name not in EFFECTS])
def test_a_setting_of_a_servo_acts_on_its_joint_alone(robot, clean, name) -> None:
    hidden = COMMANDED[name].draw(robot, 2, 0.2, use_of(clean), np.random.default_rng(4))
    kp, kd, reference = np.full(robot.n, 50.0), np.full(robot.n, 5.0), np.zeros(robot.n)
    changed = np.zeros(robot.n)
    for k in range(200):
        reference = reference + 0.01 * (k + 1)
        gains = hidden.gains(kp, kd)
        changed += np.abs(gains[0] - kp) + np.abs(gains[1] - kd) + np.abs(hidden.arriving(reference) - reference)
    assert np.array_equal(np.flatnonzero(changed), [2])


def test_a_late_reference_is_late_by_its_time() -> None:
    late = COMMANDED["reference_delay"](0, 4 * STEP)
    arrived = [float(late.arriving(np.array([float(k)]))[0]) for k in range(10)]
    assert arrived == [0, 0, 0, 0, 0, 1, 2, 3, 4, 5]


def test_a_commanded_case_hides_its_torques() -> None:
    case = make_case(3, 1, "controller_gain", duration=3.0, commanded=True)
    assert case.key["controller"] in SERVOS
    assert not any(log.has_torques for log in (*case.training, *case.holdout))
    assert case.arm.controller is not None
    assert {effect_of(1, i, commanded=True) for i in range(len(COMMANDED))} == set(COMMANDED)


@pytest.mark.parametrize("seed", range(12))
def test_the_truth_is_within_the_prior_and_can_exist(seed) -> None:
    rng = np.random.default_rng(seed)
    arm = draw_robot(rng)
    for trust, shares in TRUST.items():
        truth = perturbed(arm, rng, *(OFF * share for share in shares))
        sigma = sigma_of(arm, trust)
        assert np.all(np.abs(truth.theta - arm.theta) <= sigma)
        assert np.any(np.abs(truth.theta - arm.theta) > 0.2 * sigma)
        assert not any(inconsistency(link.ten) for link in (*arm.links, *truth.links))


#: Classes of all effects by name, with those that the library does not have.
ALL = EFFECTS | {effect.name: effect for effect in OUTSIDE}


@pytest.mark.parametrize("name", [name for name in ALL if name != "friction_jump"])  # it acts after the log's end
def test_an_effect_changes_the_joint_that_it_names(robot, clean, name) -> None:
    rng = np.random.default_rng(2)
    kind = ALL[name]
    hidden = kind.draw(robot, 1 if kind.per_joint else None, 0.2, use_of(clean), rng)
    there = moved(robot, 1, hidden, hidden.changed(hidden.without(robot)))
    bare = hidden.without(robot)
    without = clean if bare is robot else moved(robot, 1, truth=bare)
    differ = np.sqrt(np.mean((there.tau - without.tau) ** 2, axis=0)) / np.sqrt(np.mean(without.tau**2, axis=0))
    if hidden.joint is None:
        assert differ.max() > LEAST
    else:
        assert hidden.joint == 1
        assert differ[1] > 0.3 * LEAST
        if name not in OF_THE_ARM | TRANSMISSIONS:
            assert np.argmax(differ) == 1


@pytest.mark.parametrize("name", [n for n, e in ALL.items() if e.per_joint and n not in OF_THE_ARM])
def test_an_effect_acts_on_its_joint_alone(robot, clean, name) -> None:
    """Every hook of an effect, at states and commands all over, touches no other joint."""
    rng = np.random.default_rng(4)
    hidden = ALL[name].draw(robot, 2, 0.2, use_of(clean), rng)
    hidden.begin(rng.normal(size=robot.n))
    touched = np.zeros(robot.n)
    for _ in range(200):
        q, dq, command, load = rng.normal(size=(4, robot.n))
        command *= 100.0
        now = Moment(float(rng.uniform(0, 10)), q, dq, command, 100.0 * load)
        touched += np.abs(hidden.drive(command) - command) + np.abs(hidden.reading(q) - q)
        for more in (hidden.torque(now), hidden.dry(now)):
            touched += 0.0 if more is None else np.abs(more)
    touched += np.abs(hidden.changed(robot).rotor - robot.rotor) + np.abs(hidden.without(robot).rotor - robot.rotor)
    assert np.array_equal(np.flatnonzero(touched), [2])


def test_clutter_does_what_its_members_do(robot, clean) -> None:
    rng = np.random.default_rng(5)
    members = [
        EFFECTS[name].draw(robot, j, 0.2, use_of(clean), rng) for j, name in enumerate(("torque_gain", "stribeck"))
    ]
    members += [EFFECTS["encoder_offset"].draw(robot, 2, 0.2, use_of(clean), rng)]
    clutter = Clutter(0, members[0], members[1:])
    q, dq, command, load = rng.normal(size=(4, robot.n))
    now = Moment(1.0, q, dq, command, load)
    clutter.begin(command)
    assert np.array_equal(clutter.drive(command), members[0].drive(command))
    assert np.array_equal(clutter.dry(now), members[1].dry(now))
    assert np.array_equal(clutter.reading(q), members[2].reading(q))
    assert clutter.torque(now) is None
    assert clutter.values == members[0].values


def test_a_case_with_clutter_has_other_effects_beside_the_hidden_one() -> None:
    case = make_case(3, CLUTTERS, duration=3.0)
    assert 2 <= len(case.key["beside"]) <= 4
    assert {effect["effect"] for effect in case.key["beside"]} <= {kind.name for kind in BESIDE}
    assert all(1 <= effect["joint"] <= case.key["joints"] for effect in case.key["beside"])
    assert make_case(3, OUTSIDES, duration=3.0).key["outside"]
    assert {effect_of(3, OUTSIDES + i) for i in range(len(OUTSIDE))} == {effect.name for effect in OUTSIDE}


def test_a_name_is_right_if_it_or_a_look_alike_is_hidden_anywhere_in_the_arm() -> None:
    effect = {"effect": "stribeck", "joint": 2, "outside": False, "values": {}}
    drift = {"effect": "torque_drift", "joint": 1, "outside": True, "values": {}}
    record = {"effect": "payload", "joint": None, "outside": False, "values": {}, "beside": [effect, drift]}

    def name(effect: str, joint: int | None, *alike: tuple[str, int]) -> dict[str, object]:
        return {"effect": effect, "joint": joint, "equivalents": [{"effect": e, "joint": j} for e, j in alike]}

    assert is_in_arm(record, name("stribeck", 2))
    assert is_in_arm(record, name("payload", None))
    assert is_in_arm(record, name("presliding", 2, ("stribeck", 2)))
    assert not is_in_arm(record, name("stribeck", 1))
    assert not is_in_arm(record, name("torque_drift", 1))


@pytest.mark.parametrize(("name", "seed"), [*((name, 2) for name in VALUES), ("contact", 1)])
def test_an_effect_moves_the_arm_as_armgap_says(robot, clean, name, seed) -> None:
    hidden = EFFECTS[name].draw(robot, 1, 0.2, use_of(clean), np.random.default_rng(seed))
    bare = hidden.without(robot)
    run = moved(bare, 1, hidden, hidden.changed(bare))
    doing = missed(bare, run, [])
    assert doing > 1e-3, "the effect does nothing here"
    assert missed(bare, run, [(name, 2, VALUES[name](hidden))]) < OTHERWISE.get(name, AGREE) * doing


@pytest.mark.parametrize("family", list(FAMILIES))
def test_the_regressor_of_the_visibility_is_the_inverse_dynamics_of_the_engine(family) -> None:
    random = np.random.default_rng(3)
    arm = draw_robot(random, family)
    q, dq, ddq = random.normal(size=(3, 4, arm.n))
    torque = links(arm, q, dq, ddq) @ arm.theta[: 10 * arm.n] + arm.rotor * ddq
    model = arm.model(friction=False)
    data = mujoco.MjData(model)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], dq[k], ddq[k]
        mujoco.mj_inverse(model, data)
        assert np.allclose(torque[k], data.qfrc_inverse, atol=SAME * np.abs(data.qfrc_inverse).max())


def test_what_parameters_absorb_is_not_visible(robot) -> None:
    # Viscous friction is a parameter, trusted to half of it; a last link of three times its mass is far outside the trust.
    sigma = sigma_of(robot, "published")

    def logs(truth: SerialRobot) -> list[Run]:
        return [moved(robot, seed, truth=truth) for seed in (1, 2, 3)]

    plain = logs(robot)
    absorbed = visibility(robot, sigma, plain, logs(replace(robot, viscous=1.3 * robot.viscous)))
    assert absorbed.above_floor < MULTIPLE
    assert absorbed.moved < SIGMAS
    heavy = robot.with_link(robot.n - 1, robot.links[-1].scaled(3.0))
    assert visibility(robot, sigma, plain, logs(heavy)).moved > SIGMAS


def test_a_case_is_what_its_seed_and_number_say() -> None:
    one, again, other = (make_case(3, n, "joint_spring", duration=3.0) for n in (1, 1, 2))
    assert one.key == again.key != other.key
    assert json.loads(json.dumps(one.key)) == one.key
    assert hidden_effect(one.key).values == one.key["values"]
    for a, b in zip((*one.training, *one.holdout), (*again.training, *again.holdout), strict=True):
        assert np.array_equal(a.q, b.q)
        assert np.array_equal(a.tau, b.tau)
    assert one.key["change"] >= LEAST
    assert len(one.training) == 2
    assert len(one.holdout) == 1


def test_every_effect_comes_once_in_a_round() -> None:
    for seed in (1, 2):
        for begin in (0, len(EFFECTS)):
            assert {effect_of(seed, begin + i) for i in range(len(EFFECTS))} == set(EFFECTS)
    assert [effect_of(1, i) for i in range(26)] != [effect_of(2, i) for i in range(26)]


def record(effect: str, joint: int | None, causes: list[tuple[str, int | None]], **more) -> dict:
    named = [{"effect": e, "joint": j, "probability": 0.9, "equivalents": []} for e, j in causes]
    made = {
        "family": "R-P-R",
        "kinds": "RPR",
        "period": 0.004,
        "controller": "pd",
        "noise": 0.01,
        "change": 0.1,
        "number": 0,
    }
    return {
        "effect": effect, "joint": joint, "joints": 3, "values": {}, "outside": False, "causes": named, "candidates": [], "verdict": "effect",
        "seconds": 1.0, "beside": [], "unnamed": [], **made, **more,
    }  # fmt: skip


def test_answers_are_scored_by_the_first_cause() -> None:
    spring, offset = ("joint_spring", 2), ("torque_offset", 2)
    assert outcome(record(*spring, [spring])) == "right"
    assert outcome(record(*spring, [("joint_spring", 1)])) == "wrong"
    assert outcome(record(*spring, [offset])) == "joint only"
    assert outcome(record(*spring, [offset, spring])) == "later"
    alike = record(*spring, [offset])
    alike["causes"][0]["equivalents"] = [{"effect": "joint_spring", "joint": 2}]
    assert outcome(alike) == "look-alike"
    assert outcome(record(*spring, [])) == "not named"
    assert outcome(record(*spring, [], candidates=[{"effect": "joint_spring", "joint": 2}])) == "candidate"
    assert outcome(record("null", None, [])) == "not named"
    assert outcome(record("null", None, [offset])) == "wrong"
    assert outcome(record("torque_drift", 2, [("friction_warmup", 2)], outside=True)) == "wrong"
    theta = [0.0] * 30 + [1.0, 2.0, 3.0] + [0.0] * 6
    rotor = {"values": {"lacking": False, "inertia": 1.0}, "theta": theta}
    assert outcome(record("rotor_inertia", 2, [], parameters={"rotor2": 1.9}, **rotor)) == "value"
    assert outcome(record("rotor_inertia", 2, [], parameters={"rotor2": 1.0}, **rotor)) == "not named"


def test_effects_of_several_joints_are_scored_by_their_place() -> None:
    cable = record("cable_spring", 2, [("joint_spring", None)])
    assert outcome(cable) == "wrong"
    cable["causes"][0] |= {"joints": [2, 3], "row": [1, 1]}
    assert outcome(cable) == "right"
    difference = record("coupled_transmission", 1, [("coupled_transmission", None)], values={"factor": -1.0})
    difference["causes"][0] |= {"joints": [1, 2], "row": [1, 1]}
    assert outcome(difference) == "wrong"
    difference["causes"][0]["row"] = [1, -1]
    assert outcome(difference) == "right"
    everywhere = record("actuator_delay_all", None, [("actuator_delay", None)])
    everywhere["causes"][0]["joints"] = [1, 2, 3]
    assert outcome(everywhere) == "right"
    lines = report([everywhere | {"outcome": "right"}]).splitlines()
    assert "effects of all joints: 1 of 1 named in one cause of half of the joints or more" in lines


def test_the_report_counts_every_answer() -> None:
    right = record("joint_spring", 2, [("joint_spring", 2)])
    wrong = record("joint_spring", 2, [("torque_offset", 1)])
    null = record("null", None, [("torque_offset", 1)], number=NULLS)
    records = [r | {"outcome": outcome(r)} for r in (right, right, wrong, null)] + [
        {"number": 7, "failed": "ValueError: no"}
    ]
    text = report(records)
    counts = next(line for line in text.splitlines() if line.startswith("joint_spring")).split()[1:]
    assert counts == ["3", *("2" if o == "right" else "1" if o == "wrong" else "-" for o in OUTCOMES)]
    assert "4 answers, 1 failed" in text
    assert "no effect: 1 of 1 with a cause named" in text
    assert "case 7: ValueError: no" in text
    assert "joint_spring:2" in text
    assert "-> wrong: effect [torque_offset:1 0.90] ()" in text


def test_the_command_counts_a_case_that_fails_and_goes_on(tmp_path) -> None:
    file = tmp_path / "answers.jsonl"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    run = subprocess.run(
        [sys.executable, "-m", "tests.serial_trial", "--seed", "1", "--cases", "1", "--nulls", "0", "--timeout", "0.01", "--json", str(file)],
        capture_output=True, text=True, cwd=ROOT, env=environment, check=True,
    )  # fmt: skip
    assert run.stdout.startswith("0 answers, 1 failed")
    assert [json.loads(line)["number"] for line in file.read_text().splitlines()] == [0]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "family", "seed"), [("payload", "R-P-R", 11), ("stribeck", "SO-101-like", 12)])
def test_an_easy_case_is_diagnosed_right(name, family, seed) -> None:
    found = ask(make_case(seed, 0, name, family=family, duration=8.0))
    assert found["outcome"] == "right"
