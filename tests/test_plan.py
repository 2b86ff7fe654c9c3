"""The next experiment: motions within limits, evidence by its laws, what no motion tells, bad inputs."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import armgap
from armgap import Arm, Diagnosis, plan, simulate
from armgap.arm import MotionLimits
from armgap.errors import ArmFileError, ArmgapError, OptionError
from armgap.evidence.hypothesis import EffectInstance
from armgap.planning import criterion, search
from armgap.planning.criterion import HypothesisPair, PredictedMotion, Rest, Setting
from armgap.planning.dynamics import inverse_dynamics
from armgap.planning.limits import MARGIN, TORQUE_MARGIN, limits_of
from armgap.planning.motion import Motion, build, named
from armgap.planning.open_questions.questions import asked, known_model, open_questions
from armgap.planning.outcome import settled
from armgap.simulation import Effect
from conftest import TABLE_ONE

LIMITS = """
[limits]
position_min = [-1.5, -2.0]
position_max = [1.2, 2.0]
speed = [3.0, 5.0]
acceleration = [20.0, 60.0]
"""
CONTROLLER = """
[controller]
kind = "pd"
kp = [400.0, 30.0]
kd = [40.0, 3.0]
kd_on = "error"
"""
DURATION = 3.0
DERIVATIVE = 1e-3  # of the largest value: differences over a millisecond, of motions below 10 Hz
OPEN_LOOP = 5e-3  # rad: a second without feedback, under torques held over samples of 2.5 ms
FIRST_ORDER = 0.05  # of evidence: effects of this size bend the motion by as much
UNSETTLED = 0.05


@pytest.fixture(scope="module")
def limited(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    path = tmp_path_factory.mktemp("limited") / "arm.toml"
    path.write_text(TABLE_ONE + LIMITS + CONTROLLER)
    return Arm.read(path)


def slow_log(arm: Arm, *effects: Effect, seconds: float = 3.0) -> armgap.Log:
    """A small and slow motion."""
    t = arm.sample_period * np.arange(round(seconds / arm.sample_period))
    size = np.array([25.0, 3.0])[: arm.n_joints]
    tau = size * np.sin(2 * np.pi * 0.6 * t[:, None] + np.arange(arm.n_joints))
    return simulate(arm, t, tau, effects=effects, name="slow")


@pytest.fixture(scope="module")
def diagnosis(limited: Arm) -> Diagnosis:
    return armgap.diagnose(slow_log(limited), limited)


@pytest.fixture
def brief(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compare six motions only: these tests are about what a plan is, not about the best of them."""
    monkeypatch.setattr(search, "GENERATIONS", 0)
    monkeypatch.setattr(search, "POPULATION", 6)
    monkeypatch.setattr(search, "_POSE_PAIRS", ((0.3, 0.7),))


def predicted_motion(diagnosis: Diagnosis, arm: Arm, motion: Motion) -> PredictedMotion:
    model, _ = known_model(diagnosis.to_dict(), arm)
    return PredictedMotion(Setting.of(diagnosis.to_dict(), model), motion)


def usual(arm: Arm, name: str = "fast multisine", duration: float = DURATION) -> Motion:
    assert arm.limits is not None
    return build(named(name, arm.n_joints), np.zeros(arm.n_joints), arm.limits, duration, arm.sample_period)


# Motions


def test_velocities_and_accelerations_are_derivatives(limited):
    motion = usual(limited)
    t = np.arange(0.0, motion.duration, 1e-3)
    q, dq, ddq = motion.at(t)
    for value, rate in ((q, dq), (dq, ddq)):
        difference = (value[2:] - value[:-2]) / 2e-3
        assert np.max(np.abs(difference - rate[1:-1])) < 20 * DERIVATIVE * np.max(np.abs(rate))


def test_the_torque_of_a_motion_makes_that_motion(limited, diagnosis):
    """The simulator, told nothing but the feed-forward torque, follows the reference."""
    model, _ = known_model(diagnosis.to_dict(), limited)
    motion = usual(limited)
    h = limited.sample_period
    t = h * np.arange(round(1.0 / h))
    tau = inverse_dynamics(model, *motion.at(t + 0.5 * h))
    arm = replace(limited, theta=np.array(model.theta))
    moved = simulate(arm, t, tau, encoder=False)
    reference = motion.at(t)[0]
    assert np.max(np.abs(moved.q - reference)) < OPEN_LOOP
    assert np.max(np.abs(reference)) > 20 * OPEN_LOOP


# Evidence


def test_evidence_grows_with_excitation(limited, diagnosis):
    effect = EffectInstance("quadratic_drag", 2, {"c": 0.02})
    pair = HypothesisPair(((1.0, (effect,)),), ())
    whole = usual(limited)
    found = [predicted_motion(diagnosis, limited, whole.scaled(s)).outcome(pair).expected for s in (0.2, 0.5, 1.0)]
    assert 0 <= found[0] < found[1] < found[2]


def test_evidence_grows_with_the_square_of_a_small_effect(limited, diagnosis):
    motion = predicted_motion(diagnosis, limited, usual(limited))
    sizes = (0.005, 0.01)
    found = [
        motion.outcome(HypothesisPair(((1.0, (EffectInstance("quadratic_drag", 1, {"c": c}),)),), ())).expected
        for c in sizes
    ]
    assert found[1] / found[0] == pytest.approx(4.0, rel=FIRST_ORDER)


def test_fitting_the_rival_takes_evidence_away(limited, diagnosis):
    outcome = predicted_motion(diagnosis, limited, usual(limited)).outcome(
        HypothesisPair(((1.0, (EffectInstance("rotor_inertia", 2, {"inertia": 0.002}),)),), ())
    )
    assert np.all(outcome.fitted < outcome.plain)
    assert np.all(outcome.fitted >= 0)


def test_an_effect_that_is_a_parameter_of_the_arm_is_no_evidence_unless_that_is_trusted(limited, diagnosis):
    """A rotor inertia of joint 1 is theta1."""
    effect = EffectInstance("rotor_inertia", 1, {"inertia": 0.05})
    pair = HypothesisPair(((1.0, (effect,)),), ())
    found = []
    for trust in (100.0, 1e-4):
        arm = replace(limited, sigma=trust * np.abs(limited.theta))
        found.append(predicted_motion(diagnosis, arm, usual(arm)).outcome(pair))
    assert found[0].expected < 1e-3 * found[1].expected
    assert found[1].settled(7.0) > 0.9


@pytest.mark.parametrize(("expected", "probability"), [(0.0, 0.0), (7.0, 0.5), (200.0, 1.0)])
def test_a_log_likelihood_ratio_decides_as_a_normal_number_of_twice_its_mean(expected, probability):
    assert settled(expected, 7.0) == pytest.approx(probability, abs=1e-9)


# What no motion tells


@pytest.mark.usefixtures("brief")
def test_no_motion_tells_a_tilted_base_from_an_encoder_offset(limited):
    found = armgap.diagnose(slow_log(limited, Effect("base_tilt", None, {"angle": 0.15})), limited)
    pair = {("base_tilt", None), ("encoder_offset", 1)}
    cause = next(c for c in found.causes if (c.effect, c.joint) in pair)
    other = next(e for e in cause.equivalents if (e.effect, e.joint) in pair)
    assert not other.motion_separates
    questions, remarks = open_questions(found.to_dict())
    assert not any({q.place, q.rival} == pair for q in questions)
    assert any("a level on the base separates them; no motion is planned" in r for r in remarks)
    for wanted in ([], ["base_tilt"]):
        made = plan(found, limited, questions=wanted, duration=DURATION)
        assert not any({(q.effect, q.joint), (q.against, q.against_joint)} == pair for q in made.questions)


@pytest.mark.parametrize(("trust", "low", "high"), [(100.0, 0.0, UNSETTLED), (1e-4, 0.9, 1.0)])
def test_a_torque_gain_needs_a_trusted_mass(limited, diagnosis, trust, low, high):
    """Gains of all torques scale all parameters: only the prior tells."""
    arm = replace(limited, sigma=trust * np.abs(limited.theta))
    gains = tuple(EffectInstance("torque_gain", j, {"gain": 1.02}) for j in (1, 2))
    outcome = predicted_motion(diagnosis, arm, usual(arm)).outcome(HypothesisPair(((1.0, gains),), ()))
    assert low <= outcome.settled(7.0) <= high


def test_trust_that_the_diagnosed_logs_have_used_up_promises_nothing(limited, diagnosis):
    arm = replace(limited, sigma=1e-4 * np.abs(limited.theta))
    gains = tuple(EffectInstance("torque_gain", j, {"gain": 1.02}) for j in (1, 2))
    model, _ = known_model(diagnosis.to_dict(), arm)
    setting = Setting.of(diagnosis.to_dict(), model)
    assert np.all(setting.unknown <= 1.0)
    assert np.all(setting.unknown >= 0.0)
    pair = HypothesisPair(((1.0, gains),), ())
    new, used = (
        PredictedMotion(replace(setting, unknown=share * np.ones(len(arm.theta))), usual(arm)).outcome(pair)
        for share in (1.0, 0.0)
    )
    assert new.prior[0] > 100.0
    assert used.prior[0] == 0.0
    assert new.expected == pytest.approx(used.expected + new.prior[0])


def test_a_gap_that_the_effect_explains_is_no_discrepancy(limited, diagnosis):
    motion = predicted_motion(diagnosis, limited, usual(limited))
    drag = EffectInstance("quadratic_drag", 1, {"c": 0.2})
    floor = np.array(diagnosis.gap.floor)
    left, explained = (
        motion.outcome(HypothesisPair(((1.0, (drag,)),), (), rest=Rest.of(gap * floor, floor))) for gap in (30.0, 1.0)
    )
    assert explained.expected > 10.0 * left.expected
    assert explained.above[0] > left.above[0]


# Plans


@pytest.mark.usefixtures("brief")
def test_a_plan_keeps_its_limits_and_rests_at_both_ends(limited, diagnosis, tmp_path):
    made = plan(diagnosis, limited, questions=["quadratic_drag:1", "backlash:2"], duration=DURATION)
    limits = limited.limits
    assert limits is not None
    assert limited.torque_limit is not None
    made.write(tmp_path / "experiment.csv")
    table = pl.read_csv(tmp_path / "experiment.csv")
    assert table.columns == ["t", "q_ref1", "q_ref2", "dq_ref1", "dq_ref2", "tau_ff1", "tau_ff2"]
    t, q, dq, tau = (table.select(f"^{name}[0-9]*$").to_numpy() for name in ("t", "q_ref", "dq_ref", "tau_ff"))
    np.testing.assert_allclose(np.diff(t[:, 0]), limited.sample_period, rtol=1e-9)
    assert t[-1, 0] == pytest.approx(DURATION)
    assert np.all(q >= limits.position_min)
    assert np.all(q <= limits.position_max)
    assert np.all(np.abs(dq) <= limits.speed)
    assert np.all(np.abs(np.diff(dq, axis=0)) <= limits.acceleration * limited.sample_period)
    assert np.all(np.abs(tau) <= limited.torque_limit)
    assert np.all(q[[0, -1]] == 0)
    assert np.all(dq[[0, -1]] == 0)
    assert np.ptp(q, axis=0).min() > 0.1


@pytest.mark.usefixtures("brief")
def test_the_same_seed_gives_the_same_bytes(limited, diagnosis, tmp_path, run):
    (tmp_path / "d.json").write_text(diagnosis.to_json())
    outputs = []
    for name in ("a", "b"):
        status, out, err = run(
            "plan", tmp_path / "d.json", "--arm", limited.path, "--for", "stribeck:2", "--duration", DURATION,
            "-o", tmp_path / f"{name}.csv", "--json", tmp_path / f"{name}.json", "--report", tmp_path / f"{name}.md",
        )  # fmt: skip
        assert (status, err) == (0, "")
        assert "Stribeck" in out
        outputs.append([(tmp_path / f"{name}.{ending}").read_bytes() for ending in ("csv", "json", "md")])
    assert outputs[0] == outputs[1]
    data = json.loads(outputs[0][1])
    assert data["schema"] == "armgap.plan/1"
    question = data["questions"][0]
    assert (question["effect"], question["joint"], question["against"]) == ("stribeck", 2, {"effect": "none"})
    assert question["expected_log_likelihood_ratio"] > 0
    assert 0 <= question["settled"] <= 1
    assert data["limits"]["speed"] == [3.0, 5.0]
    page = (tmp_path / "a.md").read_text()
    assert "What the motion is for" in page
    assert "Limits" in page


@pytest.mark.usefixtures("brief")
def test_without_limits_the_logs_give_them_and_it_is_said(limited, diagnosis):
    bare = replace(limited, limits=None)
    made = plan(diagnosis, bare, questions=["quadratic_drag:1"], duration=DURATION)
    log = slow_log(limited)
    assert made.limits.source == "logs"
    assert any("no [limits]" in note for note in made.notes)
    # The map of a diagnosis leaves out what windows do not cover, the ends of the log.
    assert np.all(made.q_ref.min(axis=0) >= log.q.min(axis=0) - 0.01)
    assert np.all(made.q_ref.max(axis=0) <= log.q.max(axis=0) + 0.01)


@pytest.mark.usefixtures("brief")
def test_at_most_five_open_questions_and_the_others_are_named(limited, diagnosis):
    data = diagnosis.to_dict()
    entries = [dict(r, status="undecided") if r.get("bound") else r for r in data["ruled_out"]]
    many = Diagnosis.from_dict(data | {"ruled_out": entries})
    made = plan(many, limited, duration=2.0)
    assert len(made.questions) <= 10
    assert len({(q.effect, q.joint) for q in made.questions}) == 5
    asked_for = {f"{q.effect}:{q.joint}" if q.joint else q.effect for q in made.questions}
    assert made.left_out
    assert asked_for.isdisjoint({text.split(" against ")[0] for text in made.left_out})


def test_torque_margin_and_margin_leave_room_for_a_controller():
    assert TORQUE_MARGIN < 1
    assert MARGIN < 1
    assert criterion.TRAINED < 1


# Arm files


def test_limits_and_controller_are_read_and_written(limited, tmp_path):
    limits, controller = limited.limits, limited.controller
    assert limits is not None
    assert controller is not None
    assert limits.position_max.tolist() == [1.2, 2.0]
    assert (controller.kp.tolist(), controller.kd_on) == ([400.0, 30.0], "error")
    copy = tmp_path / "copy.toml"
    copy.write_text(limited.to_toml())
    again = Arm.read(copy)
    assert again.to_toml() == limited.to_toml()
    assert again.limits is not None
    assert again.limits.acceleration.tolist() == [20.0, 60.0]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            ("position_max = [1.2, 2.0]", "position_max = [-1.6, 2.0]"),
            ("limits.position_max", "not above position_min"),
        ),
        (("speed = [3.0, 5.0]", "speed = [3.0]"), ("limits.speed", "needs a list of 2")),
        (("speed = [3.0, 5.0]", "speed = [3.0, -5.0]"), ("limits.speed", "above 0")),
        (("acceleration = [20.0, 60.0]\n", ""), ("limits.acceleration", "is missing")),
        (("acceleration =", "accelaration ="), ("limits.accelaration", "did you mean `acceleration`")),
        (('kind = "pd"', 'kind = "pid"'), ("controller.kind", "pid")),
        (("kp = [400.0, 30.0]\n", ""), ("controller.kp", "is missing")),
        (('kd_on = "error"', 'kd_on = "velocity"'), ("controller.kd_on", "measurement")),
    ],
)
def test_bad_limits_are_refused_in_one_line(change, says, tmp_path):
    path = tmp_path / "arm.toml"
    text = TABLE_ONE + LIMITS + CONTROLLER
    assert change[0] in text
    head, tail = text[: len(TABLE_ONE)], text[len(TABLE_ONE) :]
    path.write_text(head + tail.replace(*change))
    with pytest.raises(ArmFileError) as caught:
        Arm.read(path)
    assert "\n" not in str(caught.value)
    assert all(word in str(caught.value) for word in (*says, "arm.toml"))


# Bad inputs


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"questions": ["backlash"]}, ("names no joint", "backlash:J")),
        ({"questions": ["backlash:3"]}, ("names no joint", "1 to 2")),
        ({"questions": ["slack:1"]}, ("is not an effect",)),
        ({"questions": ["Backlash 2"]}, ("EFFECT:JOINT",)),
        ({"questions": ["payload:1"]}, ("whole arm",)),
        ({"questions": ["external_pulse:1"]}, ("outside the arm",)),
        ({"duration": 1.0}, ("1 s", "2 to 120")),
        ({"duration": float("nan")}, ("nan",)),
        ({"seed": -1}, ("-1",)),
    ],
)
def test_impossible_options_are_refused_in_one_line(arguments, says, limited, diagnosis):
    with pytest.raises(OptionError) as caught:
        plan(diagnosis, limited, **arguments)
    assert "\n" not in str(caught.value)
    assert all(word in str(caught.value) for word in says)


def test_an_unusable_diagnosis_is_refused_in_one_line(limited, diagnosis, pendulum, tmp_path):
    data = diagnosis.to_dict()
    contradicted = Diagnosis.from_dict(data | {"verdict": "input"})
    blind = Diagnosis.from_dict({key: value for key, value in data.items() if key != "series"})
    for given, arm, says in (
        (contradicted, limited, "`input`"),
        (diagnosis, replace(pendulum, limits=limited.limits), "'two-link'"),
        ([diagnosis, diagnosis], limited, "2 diagnoses"),
        (blind, replace(limited, limits=None), "[limits]"),
        (tmp_path / "nowhere.json", limited, "nowhere.json"),
    ):
        with pytest.raises(ArmgapError) as caught:
            plan(given, arm)
        assert "\n" not in str(caught.value)
        assert says in str(caught.value)


def test_the_command_refuses_what_it_cannot_do(limited, diagnosis, tmp_path, run):
    (tmp_path / "d.json").write_text(diagnosis.to_json())
    common = ("--arm", limited.path)
    for words, says in (
        (("plan", tmp_path / "d.json", tmp_path / "d.json", *common, "-o", tmp_path / "x.csv"), "2 diagnoses"),
        (("plan", tmp_path / "d.json", *common, "-o", tmp_path / "x.xlsx"), "ending"),
        (("plan", tmp_path / "d.json", *common, "--for", "slack:1", "-o", tmp_path / "x.csv"), "slack"),
    ):
        status, out, err = run(*words)
        assert (status, out, err.count("\n")) == (2, "", 1)
        assert says in err
        assert not (tmp_path / "x.csv").exists()


def test_what_is_asked_comes_against_absence(limited, diagnosis):
    questions = asked(["backlash:2", "backlash:2"], diagnosis.to_dict(), limited)
    assert [q.text for q in questions] == ["backlash:2 against none"]


@pytest.mark.usefixtures("brief")
def test_an_effect_that_no_log_has_shown_is_asked_about_against_its_imitators(limited, pendulum):
    made = plan(armgap.diagnose([slow_log(limited)], limited), limited, questions=["actuator_lag:1"], duration=DURATION)
    against = {(q.against, q.against_joint) for q in made.questions}
    told = [note for note in made.notes if "actuator_lag:1 against actuator_delay:1" in note]
    assert ("none", None) in against
    assert ("actuator_delay", 1) in against or told
    one = replace(pendulum, limits=MotionLimits(*(np.array([x]) for x in (-1.5, 1.5, 5.0, 40.0))))
    single = plan(armgap.diagnose([slow_log(one)], one), one, questions=["torque_dead_zone:1"], duration=DURATION)
    assert all(q.against not in ("cross_friction", "rotor_coupling") for q in single.questions)


def test_an_effect_that_is_listed_as_anothers_equivalent_is_asked_about_against_that(limited):
    cause = {"effect": "torque_offset", "joint": 1, "parameters": {}, "title": "offset"}
    alike = {"effect": "joint_spring", "joint": 1, "why": "other motions may separate them"}
    data = {"causes": [{**cause, "equivalents": [alike]}], "candidates": [], "ruled_out": []}
    found = asked(["joint_spring:1"], data, limited)
    assert [(q.place, q.rival) for q in found] == [
        (("joint_spring", 1), ("torque_offset", 1)),
        (("joint_spring", 1), ("none", None)),
    ]


def test_an_effect_that_no_motion_separates_from_a_cause_has_the_equivalents_of_that_cause(limited):
    cause = {"effect": "coulomb_asymmetry", "joint": 1, "parameters": {}, "title": "asymmetry"}
    same = {"effect": "joint_spring", "joint": 1, "motion_separates": False}
    other = {"effect": "base_tilt", "joint": None, "motion_separates": True}
    data = {"causes": [{**cause, "equivalents": [same, other]}], "candidates": [], "ruled_out": []}
    found = asked(["joint_spring:1"], data, limited)
    assert [(q.place, q.rival) for q in found] == [
        (("coulomb_asymmetry", 1), ("base_tilt", None)),
        (("joint_spring", 1), ("none", None)),
    ]


def test_home_is_the_pose_nearest_to_zero(limited, diagnosis):
    assert limited.limits is not None
    away = replace(limited.limits, position_min=np.array([0.3, -2.0]))
    assert limits_of(replace(limited, limits=away), diagnosis.to_dict()).home.tolist() == [0.3, 0.0]


def arm_with(tmp_path, text: str) -> Arm:
    path = tmp_path / "arm.toml"
    path.write_text(text)
    return Arm.read(path)


def test_another_arm_of_the_kind_is_refused(diagnosis, tmp_path):
    other = arm_with(tmp_path, (TABLE_ONE + LIMITS).replace("coulomb = [7.6095", "coulomb = [7.7"))
    with pytest.raises(
        OptionError, match=r"`coulomb1`: is 7.7 in the arm file, but the diagnosis was made with 7.6095"
    ):
        plan(diagnosis, other, questions=["backlash:2"], duration=DURATION)


def test_a_motion_at_rest_is_refused_with_the_limit(diagnosis, tmp_path):
    weak = arm_with(tmp_path, (TABLE_ONE + LIMITS).replace("torque_limit = [200.0", "torque_limit = [9.0"))
    with pytest.raises(
        OptionError, match=r"torque_limit of joint 1 is 9, of which a motion may take 80%; .* alone take 7\.6"
    ):
        plan(diagnosis, weak, questions=["backlash:2"], duration=DURATION)


def test_limits_that_leave_hardly_a_motion_end_in_a_plan_or_an_error_in_one_line(diagnosis, tmp_path, brief):
    limits = LIMITS.replace("[-1.5, -2.0]", "[-0.001, -0.001]").replace("[1.2, 2.0]", "[0.001, 0.001]")
    tiny = arm_with(tmp_path, TABLE_ONE + limits)
    assert plan(diagnosis, tiny, questions=["stribeck:1"], duration=2.0).questions


def test_a_usual_motion_that_cannot_be_predicted_names_the_limits(diagnosis, limited, monkeypatch):
    def diverges(self):
        raise ValueError

    monkeypatch.setattr(PredictedMotion, "sensitivities", diverges)
    with pytest.raises(
        OptionError, match=r"cannot be predicted along a motion within these limits.*widen position_min"
    ):
        plan(diagnosis, limited, questions=["backlash:2"], duration=DURATION)


def test_a_plan_names_each_question_with_its_rival(diagnosis, limited, brief):
    made = plan(diagnosis, limited, questions=["torque_ripple:1"], duration=2.0)
    from armgap.planning.page import answers, lead

    sure = answers(made)[1].headline
    assert len(made.questions) > 1
    assert sure.count(" or ") == len(made.questions)
    assert f"of {len(made.questions)} open questions it settles with a probability of 90" in lead(made)
    assert "no motion" not in made.summary()
