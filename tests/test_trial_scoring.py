"""Scoring of answers: what counts as right, calibration, sizes, bounds, visibility, and the gap against the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="MuJoCo is missing: pip install 'armgap[trial]'")

from armgap import effects
from armgap.diagnosis.result import GapAtHorizon
from armgap.errors import OptionError
from armgap.trial import make_case
from armgap.trial.answers import AbsentEffect, Answer, NamedCause, Size, read_answer
from armgap.trial.cases.case import simulated_arm_of
from armgap.trial.cases.key import HiddenEffect, Key
from armgap.trial.cases.visibility import MULTIPLE, VISIBLE_SIGMAS, visibility
from armgap.trial.cases.windows import Mechanism, cut, misses, refit
from armgap.trial.effects import REGISTRY
from armgap.trial.scoring import score_case
from armgap.trial.scoring.calibration import calibrate, wilson
from armgap.trial.scoring.case_score import GROUPS
from armgap.trial.scoring.closing import HISTORY, closing
from armgap.trial.scoring.sizes import MAIN, VECTOR, bound_scores, size_scores
from armgap.trial.simulation.arms import AXIS, PENDULUM, TrialArm
from armgap.trial.simulation.excitation import draw_excitation
from armgap.trial.simulation.simulated_arm import Trace, run

STRIBECK = HiddenEffect("stribeck", 2, {"amplitude": 0.5, "velocity": 0.1})
DRAG = HiddenEffect("quadratic_drag", 1, {"c": 0.2})
TILT = HiddenEffect("base_tilt", None, {"angle": 0.1})
UNKNOWN = HiddenEffect("speed_ripple", 1, {"amplitude": 1.0, "n": 8.0}, family="outside")


def key(*hidden: HiddenEffect, nominal: str = "off", visible: bool = True) -> Key:
    details = {"model": "geared", "motions": {"train-1": "paper"}, "visible": visible, "visibility": {}}
    return Key(hidden, nominal, (1.0,), details, "00")


def answer(*named: NamedCause, **others: object) -> Answer:
    return replace(Answer("armgap", "effect" if named else "none", tuple(named)), **others)  # type: ignore[arg-type]


def named(effect: str, joint: int | None, p: float = 0.95, *alike: tuple[str, int | None]) -> NamedCause:
    return NamedCause(effect, joint, p, {}, alike)


@pytest.mark.parametrize(("truth", "named_causes", "group", "right"), [
    (key(STRIBECK), [named("stribeck", 2)], "one effect", True),
    (key(STRIBECK), [named("stribeck", 1)], "one effect", False),
    (key(STRIBECK), [named("quadratic_drag", 2), named("stribeck", 2)], "one effect", False),
    (key(STRIBECK), [], "one effect", False),
    (key(TILT), [named("encoder_offset", 1)], "one effect", True),
    (key(TILT), [named("encoder_offset", 2)], "one effect", False),
    (key(STRIBECK, DRAG), [named("quadratic_drag", 1)], "two effects", True),
    (key(STRIBECK, DRAG), [named("payload", None), named("stribeck", 2)], "two effects", False),
    (key(STRIBECK, visible=False), [], "not visible", True),
    (key(STRIBECK, visible=False), [named("stribeck", 2)], "not visible", True),
    (key(STRIBECK, visible=False), [named("stribeck", 1)], "not visible", False),
    (key(nominal="exact"), [], "no effect", True),
    (key(nominal="exact"), [named("payload", None, 0.1)], "no effect", False),
    (key(nominal="off"), [], "parameters only", True),
    (key(nominal="off"), [named("payload", None)], "parameters only", False),
    (key(UNKNOWN), [], "outside the library", True),
    (key(UNKNOWN), [named("torque_ripple", 1)], "outside the library", False),
])  # fmt: skip
def test_what_counts_as_right(truth, named_causes, group, right):
    score = score_case("case", answer(*named_causes), truth)
    assert (score.group, score.right) == (group, right)


def test_every_group_is_scored_above():
    cases = test_what_counts_as_right.pytestmark[0].args[1]
    assert {group for _, _, group, _ in cases} == set(GROUPS)


def test_extra_causes_look_alikes_and_failures():
    score = score_case(
        "case", answer(named("payload", None, 0.9, ("stribeck", 2)), named("stribeck", 2)), key(STRIBECK)
    )
    assert (score.right, score.listed, score.extra, score.found, score.matches) == (False, True, 1, 1, (False, True))
    nothing = score_case("case", answer(error="took longer than 1 s"), key(nominal="exact"))
    assert not nothing.right


def test_perfect_probabilities_are_calibrated():
    claims = [(p, i < round(100 * p)) for p in (0.2, 0.6, 0.95) for i in range(100)]
    made = calibrate(claims)
    assert made.ece == pytest.approx(0.0, abs=1e-12)
    assert made.brier == pytest.approx(np.mean([p * (1 - p) for p in (0.2, 0.6, 0.95)]))
    assert sum(b.count for b in made.bins) == 300
    assert calibrate([(1.0, False)]).ece == 1.0
    assert calibrate([]).brier is None


@pytest.mark.parametrize(("right", "of"), [(0, 5), (5, 5), (30, 60), (0, 0)])
def test_interval_of_a_share_holds_the_share(right, of):
    low, high = wilson(right, of)
    assert 0.0 <= low <= (right / of if of else 0.5) <= high <= 1.0
    assert low < high


def test_sizes_and_intervals():
    stated = NamedCause("stribeck", 2, 0.9, {"amplitude": Size(0.55, 0.02), "velocity": Size(0.1, 0.01)})
    [score] = size_scores(answer(stated), key(STRIBECK))
    assert (round(score.error, 9), score.covered) == (0.1, False)
    gain = HiddenEffect("torque_gain", 1, {"gain": 0.8})
    [score] = size_scores(answer(NamedCause("torque_gain", 1, 0.9, {"gain": Size(0.81, 0.01)})), key(gain))
    assert (round(score.error, 9), score.covered) == (0.05, True)  # of the 0.2 that are missing
    vector = HiddenEffect("encoder_eccentricity", 1, {"a": 0.03, "b": 0.04})
    sizes = {"a": Size(0.03, 0.001), "b": Size(0.045, 0.001)}
    [score] = size_scores(answer(NamedCause("encoder_eccentricity", 1, 0.9, sizes)), key(vector))
    assert (round(score.error, 9), score.covered) == (0.1, False)
    coupling = HiddenEffect(
        "rotor_coupling", None, {"inertia": 0.001, "gear": -6.0}
    )  # told as what it adds off the diagonal
    [score] = size_scores(
        answer(NamedCause("rotor_coupling", None, 0.9, {"inertia": Size(-0.006, 1e-4)})), key(coupling)
    )
    assert (round(score.error, 9), score.covered) == (0.0, True)
    assert size_scores(answer(named("encoder_offset", 1)), key(TILT)) == []


def test_every_effect_of_the_library_has_a_size_to_judge():
    library = {e["name"] for e in effects()}
    assert library <= REGISTRY.keys()
    assert library == MAIN.keys() | VECTOR.keys()
    for name, main in MAIN.items():
        [known] = [e for e in effects() if e["name"] == name]
        assert main in {p["name"] for p in known["parameters"]}


def test_bounds_of_what_is_called_absent():
    limits = (AbsentEffect("quadratic_drag", 1, "c", 0.3), AbsentEffect("stribeck", 2, "amplitude", 0.2))
    held, broken = bound_scores(answer(limits=limits), key(DRAG, STRIBECK))
    assert (held.holds, broken.holds) == (True, False)
    assert bound_scores(answer(named("stribeck", 2), limits=limits), key(STRIBECK)) == []


def test_answer_reads_back_and_a_damaged_one_is_refused(tmp_path):
    full = Answer(
        "armgap",
        "effect",
        (NamedCause("payload", None, 0.5, {"mass": Size(1.0)}, (("torque_gain", 1),)),),
        (AbsentEffect("backlash", 1, "gap", 1e-3),),
        GapAtHorizon(0.25, (1.0,), (0.5,), (0.1,), (0.05,)),
        (1.0, 2.0),
    )
    path = tmp_path / "case-0000.json"
    path.write_text(full.to_json())
    assert read_answer(path) == full
    for text in ("{}", "[", full.to_json().replace("probability", "chance")):
        path.write_text(text)
        with pytest.raises(OptionError, match=r"case-0000\.json.*run again"):
            read_answer(path)


def moved(arm: TrialArm, *hidden: HiddenEffect, seconds: float = 3.0) -> dict[str, Trace]:
    rng = np.random.default_rng(2)
    motions = {name: draw_excitation(rng, arm, "tracked", 1.0) for name in ("train-1", "holdout-1")}
    return {name: run(simulated_arm_of(arm, hidden, name), m.source(arm), seconds) for name, m in motions.items()}


@pytest.fixture(scope="module")
def pendulum() -> dict[str, Trace]:
    return moved(PENDULUM)


def test_refit_finds_the_arm_that_the_engine_moved(pendulum):
    log = pendulum["train-1"]
    truth, windows = np.array(PENDULUM.theta), cut(log.t, log.q, log.tau)
    m = Mechanism("pendulum", PENDULUM.gravity, PENDULUM.length)
    noise = np.array([3 * PENDULUM.step[0]])
    found = refit(m, 1.1 * truth, 0.2 * truth, windows, noise)
    np.testing.assert_allclose(found, truth, rtol=5e-3)
    assert np.median(np.abs(misses(m, truth, windows))) < 5 * PENDULUM.step[0]


def test_what_re_estimation_swallows_is_seen_by_the_parameters_only():
    """A torque offset on an axis is its weight; rotor inertia of a pendulum is its inertia."""
    for arm, small, large in (
        (AXIS, HiddenEffect("torque_offset", 1, {"offset": 1.0}), HiddenEffect("torque_offset", 1, {"offset": 20.0})),
        (
            PENDULUM,
            HiddenEffect("rotor_inertia", 1, {"inertia": 0.01}),
            HiddenEffect("rotor_inertia", 1, {"inertia": 0.2}),
        ),
    ):
        plain = moved(arm)
        faint, clear = (visibility(arm, plain, moved(arm, h)) for h in (small, large))
        assert not faint.visible
        assert clear.visible
        assert clear.above_floor < MULTIPLE
        assert clear.moved > VISIBLE_SIGMAS > faint.moved


def test_what_re_estimation_leaves_is_seen_by_the_predictions(pendulum):
    seen = [
        visibility(PENDULUM, pendulum, moved(PENDULUM, HiddenEffect("quadratic_drag", 1, {"c": c})))
        for c in (1e-6, 0.3)
    ]
    assert [v.visible for v in seen] == [False, True]
    assert seen[0].above_floor == pytest.approx(1.0, abs=0.2)
    assert seen[1].above_floor > MULTIPLE


@pytest.mark.parametrize(("log", "seen"), [("train-1", True), ("holdout-1", False)])
def test_a_push_is_looked_for_in_training(log, seen, pendulum):
    push = HiddenEffect("external_pulse", 1, {"time": 1.5, "duration": 0.1, "impulse": 0.05}, log=log)
    assert visibility(PENDULUM, pendulum, moved(PENDULUM, push), everywhere=False).visible is seen


@pytest.mark.parametrize("wanted", [("stribeck", 1), ("encoder_offset", 1), ("encoder_eccentricity", 1)])
def test_the_truth_closes_all_of_the_gap_and_the_arm_file_none(wanted, tmp_path):
    """armgap's own form of an effect at its true size predicts the engine's motion to the noise."""
    case = make_case(4, [wanted], model="pendulum", size=0.5, duration=3.0, style="tracked", sample_period=0.0025)
    case.write(tmp_path)
    hidden = case.key.effects[0]
    sizes = {k: Size(v) for k, v in hidden.parameters.items()}
    truth = closing(tmp_path, answer(NamedCause(hidden.effect, 1, 1.0, sizes), theta=case.key.theta), case.key)
    nominal = tuple(float(x) for x in _stated(case.arm_file))
    none = closing(tmp_path, answer(theta=nominal), case.key)
    assert truth is not None
    assert none is not None
    assert (truth.closed, none.closed) == (1.0, 0.0)
    assert truth.best[0] < 0.05 * truth.before[0]


def test_effects_with_a_state_are_not_compared(tmp_path):
    assert {"actuator_delay", "presliding"} <= HISTORY
    assert closing(tmp_path, answer(theta=(1.0,)), key(HiddenEffect("presliding", 1, {}))) is None
    assert closing(tmp_path, answer(), key(STRIBECK)) is None  # a method that gives no model


def _stated(arm_file: str) -> np.ndarray:
    import tomllib

    data = tomllib.loads(arm_file)
    return np.array(data["inertial"]["theta"] + data["friction"]["viscous"] + data["friction"]["coulomb"])
