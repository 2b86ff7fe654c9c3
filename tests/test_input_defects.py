"""The catalogue of defects: each changes what it says and nothing else, and its remedies do undo it.

The motions are sines, their torques inverse dynamics written down here, so that "no log tells them apart" is an equation.
"""

from __future__ import annotations

import copy
import json
import math
from functools import cache

import numpy as np
import pytest

from armgap.check import NAMES
from armgap.trial import make_case
from armgap.trial.cases.case import simulated_arm_of
from armgap.trial.cases.key import HiddenEffect
from armgap.trial.simulation.arms import random_arm
from armgap.trial.simulation.plant import Plant
from input_defects.answering import WHOLE, answer, answer_floor
from input_defects.case import Inputs, Table, Truth, toml
from input_defects.defect import ANY
from input_defects.defects import DEFECTS, REPAIRED, chosen
from input_defects.expected import Expected, Option, listed, remedies
from input_defects.floors import contradicts
from input_defects.judging import judged, wrong_effects
from input_defects.making import keep, read
from input_defects.true_floor import Starts, displaced, measured_again, rows_of, run_commands, true_floor

PERIOD = 0.001
THETA = {
    "axis": [12.0, 150.0, 25.0, 18.0],
    "pendulum": [0.3, 8.0, 0.2, 0.9],
    "two-link": [2.4, 0.3, 0.25, 38.0, 6.0, 2.3, 0.2, 5.0, 0.8],
}
#: A remedy leaves this share of the torque at most: positions are differentiated, and friction jumps between samples.
SAME, OTHER = 0.05, 0.3


def torque(kind, theta, q, dq, ddq):
    """Inverse dynamics, shape (n_samples, n_joints)."""
    n = q.shape[1]
    friction = theta[-2 * n : -n] * dq + theta[-n:] * np.sign(dq)
    if kind == "axis":
        return theta[0] * ddq + theta[1] + friction
    if kind == "pendulum":
        return theta[0] * ddq + theta[1] * np.sin(q) + friction
    (q1, q2), (v1, v2), (a1, a2) = q.T, dq.T, ddq.T
    outer, c, s = theta[4] * np.sin(q1 + q2), theta[1] * np.cos(q2), theta[1] * np.sin(q2)
    tau1 = (theta[0] + 2 * c) * a1 + (theta[2] + c) * a2 - s * v2 * (2 * v1 + v2) + theta[3] * np.sin(q1) + outer
    tau2 = (theta[2] + c) * a1 + theta[2] * a2 + s * v1**2 + outer
    return np.column_stack([tau1, tau2]) + friction


def table(kind, seed):
    """Four seconds of sines."""
    n, rng = (2 if kind == "two-link" else 1), np.random.default_rng(seed)
    t = PERIOD * np.arange(4000)
    omega, phase = rng.uniform(2.0, 9.0, (n, 3)), rng.uniform(0, 6.28, (n, 3))
    angle = t[:, None, None] * omega + phase
    q, dq = 0.4 * np.sin(angle).sum(2), 0.4 * (omega * np.cos(angle)).sum(2)
    tau = torque(kind, np.array(THETA[kind]), q, dq, -0.4 * (omega**2 * np.sin(angle)).sum(2))
    return Table(t, q, tau, q, dq)


@cache
def case_of(kind):
    n, theta = (2 if kind == "two-link" else 1), THETA[kind]
    split = len(theta) - 2 * n
    friction = {"viscous": theta[split : split + n], "coulomb": theta[split + n :]}
    friction |= {f"sigma_{k}": [0.2 * x for x in v] for k, v in friction.items()}
    inertial = {"theta": theta[:split], "sigma": [0.05 * x for x in theta[:split]]}
    arm = {"kind": kind, "gravity": 9.81, "sample_period": PERIOD, "inertial": inertial, "friction": friction}
    logs = {"train-1": table(kind, 1)}, {"holdout-1": table(kind, 2)}
    steps = np.full(n, 1e-5)
    return Inputs(*logs, arm), Truth(kind, kind, np.array(theta), steps, np.full(n, 10.0), PERIOD)


def pairs(*beginnings):
    """Kinds of arm and defects that they have."""
    return pytest.mark.parametrize(
        ("kind", "name"), [(kind, d.name) for d in chosen([*beginnings]) for kind in d.kinds]
    )


def spoilt(kind, name, seed=3):
    """The spoilt inputs, what is expected, and the truth."""
    inputs, truth = case_of(kind)
    return *DEFECTS[name].apply(inputs, truth, np.random.default_rng(seed)), truth


def changes(before, after):
    """Which of the inputs differ."""
    found = {"arm"} if toml(before.arm) != toml(after.arm) else set()
    if list(before.logs) != list(after.logs):
        return found | {"holdout"}
    for a, b in zip(before.logs.values(), after.logs.values(), strict=True):
        if len(a.t) != len(b.t):
            found.add("rows")
            a, b = (x.rows(slice(0, min(len(a.t), len(b.t)))) for x in (a, b))
        groups = ("q", "tau") if "rows" in found else ("t", "q", "tau")
        found |= {g for g in groups if not np.array_equal(getattr(a, g), getattr(b, g))}
    return found


def test_every_check_has_a_variant_and_there_are_enough():
    assert len(DEFECTS) >= 40
    # Checks of serial arms alone, in test_serial_logs.py.
    of_serial_arms = {"gravity_direction", "logs_differ"}
    assert set(NAMES) - of_serial_arms <= {d.check for d in DEFECTS.values()}
    assert {d.check for d in DEFECTS.values()} - set(NAMES) == {"arm_file", "other_arm"}
    assert all(set(names) <= set(DEFECTS) for names in REPAIRED.values())


@pairs()
def test_a_defect_changes_what_it_says_and_nothing_else(kind, name):
    inputs, _ = case_of(kind)
    before = copy.deepcopy(inputs)
    after, expected, _ = spoilt(kind, name)
    assert changes(inputs, after) == set(DEFECTS[name].changes)
    assert changes(before, inputs) == set()
    assert all(np.all(np.diff(x.t) > 0) and np.all(np.isfinite(x.q)) for x in after.logs.values())
    assert set(expected.checks) <= {*NAMES, "*"}
    assert Expected.from_dict(expected.to_dict()) == expected


@pairs()
def test_the_same_seed_spoils_alike(kind, name):
    (a, first, _), (b, second, _) = (spoilt(kind, name) for _ in range(2))
    assert first == second
    assert changes(a, b) == set()


def undone(inputs, truth, options):
    """Inputs after a remedy, as the options are described."""
    for option in options:
        inputs = inputs.each(lambda x, o=option: changed(x, truth, o))
        if option == Option("gravity", "reversed"):
            theta = np.array(inputs.arm["inertial"]["theta"])
            theta[[1] if truth.kind != "two-link" else [3, 4]] *= -1
            inputs = inputs.with_arm("inertial", theta=theta)
    return inputs


def changed(x, truth, o):
    """One log after one option."""
    if o.name == "flip":
        return x.with_column(o.target, -x.column(o.target))
    if o.name == "swap":
        group = "tau" if o.target.startswith("tau") else "q"
        return x.changed(**{group: getattr(x, group)[:, ::-1]})
    if o.name in ("absolute", "relative"):
        sign = -1 if o.name == "absolute" else 1
        return x.with_column("q2", x.column("q2") + sign * x.column("q1"))
    if o.name == "zero":
        return x.with_column(o.target, x.column(o.target) + math.radians(o.number))
    if o.name == "factor":
        return x.with_column(o.target, o.number * x.column(o.target))
    if o.name == "units":
        return x.changed(q=x.q / {"deg": 180 / math.pi, "turns": 0.5 / math.pi, "mm": 1e3}[o.word])
    if o == Option("gravity", "compensated"):
        return x.changed(tau=x.tau + truth.gravity(x.q))
    if o.name == "shift":
        moved = np.column_stack([np.interp(x.t, x.t + o.number, column) for column in x.tau.T])
        return x.changed(tau=moved).rows(slice(10, -10))
    return x


def residual(inputs, truth):
    """What inverse dynamics with the arm file's values misses, largest of all joints.

    Mean and deviation of the miss as shares of the torque's deviation, where friction does not jump.
    """
    x, arm = inputs.training["train-1"], inputs.arm
    theta = np.concatenate([arm["inertial"]["theta"], arm["friction"]["viscous"], arm["friction"]["coulomb"]])
    dq = np.gradient(x.q, x.t, axis=0)
    missed = x.tau - torque(truth.kind, theta, x.q, dq, np.gradient(dq, x.t, axis=0))
    sliding = np.all(np.abs(dq) > 0.2 * np.std(dq, axis=0), axis=1)
    sliding[:20] = sliding[-20:] = False
    missed, size = missed[sliding], np.std(x.tau, axis=0)
    return float(np.max((np.abs(np.mean(missed, axis=0)) + np.std(missed, axis=0)) / size))


CONVENTIONS = ("torque_sign", "position_sign", "position_zero", "joint_order", "relative_angle", "gravity")


@pairs(*CONVENTIONS, "torque_unit", "position_unit", "time_shift")
def test_every_expected_remedy_undoes_the_defect(kind, name):
    after, expected, truth = spoilt(kind, name)
    alternatives = [r for text in expected.remedies for r in remedies(text, truth.n_joints)]
    assert alternatives
    for remedy in alternatives:
        assert residual(undone(after, truth, remedy), truth) < SAME


@pairs(*CONVENTIONS)
def test_no_flip_beside_its_remedies_undoes_a_defect_of_convention(kind, name):
    after, expected, truth = spoilt(kind, name)
    n = truth.n_joints
    known = [set(r) for text in (*expected.remedies, *expected.also) for r in remedies(text, n)]
    assert residual(after, truth) > OTHER
    for text in ("--flip q", "--flip tau", *(f"--flip {g}{j + 1}" for g in ("q", "tau") for j in range(n))):
        remedy = remedies(text, n)[0]
        if set(remedy) not in known:
            assert residual(undone(after, truth, remedy), truth) > OTHER


@pytest.mark.parametrize("kind", ANY)
def test_sines_fit_their_own_inverse_dynamics(kind):
    assert residual(*case_of(kind)) < SAME


@pytest.mark.parametrize(("text", "alternatives"), [
    ("--flip tau1 | --flip q1", [(Option("flip", "tau1"),), (Option("flip", "q1"),)]),
    ("--flip tau1,tau2 or --flip q", [(Option("flip", "tau1"), Option("flip", "tau2")), (Option("flip", "q1"), Option("flip", "q2"))]),
    ("--swap q2,q1 --swap tau1,tau2", [(Option("swap", "q1,q2"), Option("swap", "tau1,tau2"))]),
    ("use `--zero q1=-90deg`.", [(Option("zero", "q1", "", -90.0),)]),
    ("--shift tau=-0.005", [(Option("shift", "tau", "", -0.005),)]),
    ("--columns tau1=NAME", [(Option("map", "tau1"),)]),
    ("say what the columns are", []),
])  # fmt: skip
def test_remedies_are_read(text, alternatives):
    assert remedies(text, 2) == alternatives


def test_numbers_agree_to_a_tenth_and_half_turns_either_way():
    wanted = remedies("--factor tau1=12.5", 1)[0]
    assert listed(wanted, remedies("--factor tau1=13.5", 1))
    assert not listed(wanted, remedies("--factor tau1=14", 1))
    assert listed(remedies("--zero q1=180deg", 1)[0], remedies("--zero q1=-180deg", 1))
    assert not listed(remedies("--zero q1=90deg", 1)[0], remedies("--zero q1=-90deg", 1))


def test_a_remedy_may_come_in_parts_but_not_with_more():
    both = remedies("--flip tau1,tau2", 2)[0]
    assert listed(both, remedies("--flip tau1 | --flip tau2", 2))
    assert not listed(remedies("--flip tau1", 2)[0], [both])


def record(verdict="input", checks=(), causes=(), hidden=(), **expected):
    said = Expected(**{"checks": ("torque_sign", "position_sign"), "severities": ("error",), **expected}).to_dict()
    return {
        "verdict": verdict,
        "checks": list(checks),
        "causes": list(causes),
        "hidden": list(hidden),
        "n_joints": 1,
        "expected": said,
    }


def check(name="torque_sign", severity="error", remedy="--flip tau1 | --flip q1", **more):
    return {"check": name, "severity": severity, "remedy": remedy, "log": None, "rows": None, **more}


FLIPS = {"remedies": ("--flip tau1", "--flip q1")}


@pytest.mark.parametrize(("answer", "right", "complete"), [
    (record(checks=[check()], **FLIPS), True, True),
    (record(checks=[check(remedy="--flip tau1")], **FLIPS), True, False),
    (record(checks=[check()], verdict="effect", **FLIPS), False, False),
    (record(checks=[check(), check("joint_order")], **FLIPS), False, False),
    (record(checks=[check(), check("spike", "warning")], **FLIPS), True, True),
    (record(checks=[check(severity="warning")], **FLIPS), False, False),
    (record(verdict="none", verdicts=("none",)), True, True),
    (record(verdict="unexplained", verdicts=("none",)), False, False),
    (record(checks=[check(rows=[[8, 8]], log="a")], rows=(("a", 9, 9),)), True, True),
    (record(checks=[check(rows=[[8, 8]], log="b")], rows=(("a", 9, 9),)), False, False),
    (record(checks=[check(rows=[[2, 3]])], rows=(("a", 9, 9),)), False, False),
])  # fmt: skip
def test_answers_are_judged(answer, right, complete):
    found = judged(answer)
    assert (found.right, found.complete) == (right, complete)


def test_strange_remedies_are_noticed():
    assert judged(record(checks=[check(remedy="--flip tau1 | --flip q1 | --swap q1,q2")], **FLIPS)).strange
    assert not judged(record(checks=[check()], **FLIPS)).strange


def test_wrong_effects_are_those_that_are_not_hidden_nor_alike():
    def cause(effect, joint, probability, *alike):
        return {
            "effect": effect,
            "joint": joint,
            "probability": probability,
            "equivalents": [{"effect": e, "joint": j} for e, j in alike],
        }

    causes = [
        cause("stribeck", 1, 0.9),
        cause("torque_offset", 1, 0.9),
        cause("backlash", 1, 0.4),
        cause("joint_spring", 1, 0.6, ("stribeck", 1)),
    ]
    answer = record(causes=causes, hidden=[("stribeck", 1)])
    assert wrong_effects(answer) == ("torque_offset:1",)
    assert wrong_effects(answer, ("torque_offset",)) == ()


def test_defects_are_chosen_by_the_beginning_of_their_names():
    assert [d.name for d in chosen(["torque_sign:tau"])] == ["torque_sign:tau1", "torque_sign:tau2"]
    assert len(chosen([])) == len(DEFECTS)
    with pytest.raises(ValueError, match="no defect begins with"):
        chosen(["torque_sgn"])


def test_rows_of_windows_follow_from_the_times_of_their_first_samples():
    t = 3.0 + PERIOD * np.arange(1001)
    assert rows_of(t, [PERIOD, 251 * PERIOD, 491 * PERIOD]) == [(0, 250), (250, 490), (490, 1000)]


@pytest.mark.slow
def test_the_true_floor_is_noise_and_the_error_of_the_start(tmp_path):
    keep(make_case(8, model="pendulum", nominal="exact", duration=2.0, style="tracked"), tmp_path / "case")
    case = read(tmp_path / "case")
    assert case.hidden == ()
    np.testing.assert_allclose(case.truth.theta[:2], case.inputs.arm["inertial"]["theta"])
    step, floors = case.truth.step[0], []
    noisy = measured_again(case, 4.0 * case.truth.step, np.random.default_rng(1))
    for log, error in ((case, 0.0), (noisy, 0.0), (case, 0.01)):
        first = np.arange(0, 801, 100)
        starts = {
            name: Starts((t.t[first + 1] - t.t[0]).tolist(), t.q_true[first], t.dq_true[first] + error)
            for name, t in log.inputs.holdout.items()
        }
        floors.append(true_floor(log, starts)["floor"][0])
    rounding = step / math.sqrt(12)
    assert floors[0] == pytest.approx(rounding, rel=0.05)
    assert floors[1] == pytest.approx(math.hypot(4.0 * step, rounding), rel=0.05)
    assert floors[2] > 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("ask", [answer, answer_floor])
def test_records_can_be_written(ask, tmp_path):
    keep(make_case(8, model="pendulum", nominal="exact", duration=2.0, style="tracked"), tmp_path / "case")
    record = ask(str(tmp_path / "case"), WHOLE, 1)
    assert json.loads(json.dumps(record))["verdict"] in ("none", "parameters")


def test_an_arm_that_remembers_goes_on_as_it_was():
    """Friction under load depends on what the engine computed in the step before."""
    hidden = HiddenEffect("load_dependent_friction", 1, {"mu": 0.2})
    rig = simulated_arm_of(random_arm(np.random.default_rng(3), "direct-drive"), [hidden])
    plant, still = Plant(rig.config), np.zeros(2)
    tau = 5.0 * np.random.default_rng(4).standard_normal((120, 2))
    run_commands(plant, rig, tau[:60])
    apart = displaced(plant, rig, still, still, tau[60:])
    np.testing.assert_array_equal(apart, run_commands(plant, rig, tau[60:]))


def test_verdicts_that_contradict_their_tables_are_found():
    gap = {"before": [1e-3, 1e-3], "after": [1e-3, 1e-5], "floor": [1e-4, 1e-5]}
    answer = {"gap": gap, "true": {"floor": [1e-4, 1e-5], "travel": [0.1, 0.1]}}
    assert len(contradicts({**answer, "verdict": "none"})) == 2
    assert len(contradicts({**answer, "verdict": "parameters"})) == 1
    assert contradicts({**answer, "verdict": "unexplained"}) == []
    assert contradicts({**answer, "verdict": "none", "true": {"floor": [1e-4, 1e-5], "travel": [2.0, 2.0]}}) == []
