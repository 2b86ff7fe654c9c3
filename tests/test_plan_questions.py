"""Open questions of a plan: sizes from the diagnosis, causes that an effect would replace, effects that imitate it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import armgap
from armgap import Arm, Diagnosis, simulate
from armgap.arm import MotionLimits
from armgap.planning import planning, search
from armgap.planning.criterion import Setting
from armgap.planning.limits import limits_of
from armgap.planning.open_questions.hypotheses import HypothesisBuilder
from armgap.planning.open_questions.questions import Question, asked, known_model
from armgap.planning.planning import scales_of
from armgap.planning.search import Search

Data = dict[str, Any]


def fitted(effect: str, values: Mapping[str, tuple[float, float]]) -> Data:
    """Entry of a diagnosis' ranking for an effect on joint 1: value and standard deviation of each parameter."""
    parameters = {name: {"value": value, "sigma": sigma} for name, (value, sigma) in values.items()}
    return {"effect": effect, "joint": 1, "title": effect, "parameters": parameters, "rms": [1e-3]}


@pytest.fixture(scope="module")
def limited(pendulum: Arm) -> Arm:
    return replace(pendulum, limits=MotionLimits(*(np.array([x]) for x in (-1.5, 1.5, 5.0, 40.0))))


@pytest.fixture(scope="module")
def diagnosis(limited: Arm) -> Diagnosis:
    t = limited.sample_period * np.arange(round(3.0 / limited.sample_period))
    return armgap.diagnose(simulate(limited, t, 0.5 * np.sin(4.0 * t)[:, None], name="slow"), limited)


@pytest.fixture(scope="module")
def builder(limited: Arm, diagnosis: Diagnosis) -> HypothesisBuilder:
    data = diagnosis.to_dict() | {"ranking": []}
    limits = limits_of(limited, data)
    model, _ = known_model(data, limited)
    setting = Setting.of(data, model)
    usual = Search(setting, limits, 3.0).usual()
    return HypothesisBuilder(data, usual, scales_of(limited, data, limits, usual, setting), model.effects)


def sizes(builder: HypothesisBuilder, value: float, sigma: float) -> list[tuple[float, float]]:
    """Weights and sizes of a torque offset in question whose estimate is `value` with standard deviation `sigma`."""
    posed = builder.pose(Question("torque_offset", 1, estimate={"offset": (value, sigma)}))
    assert posed is not None
    return [(weight, effects[-1].parameters["offset"]) for weight, effects in posed.pair.alternatives]


def test_an_estimate_that_differs_from_none_is_the_size(builder):
    found = sizes(builder, -0.3, 0.01)
    assert sum(weight * size for weight, size in found) == pytest.approx(-0.3)
    assert all(abs(size + 0.3) < 0.02 for _, size in found)


def test_an_estimate_that_may_be_none_weighs_sizes_by_their_likelihood(builder):
    flat = sizes(builder, 0.0, 1e6)
    assert all(weight == pytest.approx(1.0 / len(flat)) for weight, _ in flat)
    smallest, largest = min(size for _, size in flat), max(size for _, size in flat)
    doubted = sizes(builder, 0.0, 2.0 * smallest)
    assert [size for _, size in doubted] == [size for _, size in flat]
    by_size = {size: weight for weight, size in doubted}
    assert by_size[smallest] > 100.0 * by_size[largest] > 0.0
    assert sum(by_size.values()) == pytest.approx(1.0)


def test_an_estimate_without_a_known_scatter_is_taken_as_it_is_or_not_at_all(builder, monkeypatch):
    flat = sizes(builder, 0.0, math.inf)
    assert all(weight == pytest.approx(1.0 / len(flat)) for weight, _ in flat)
    cause = fitted("torque_offset", {"offset": (0.1, math.inf)})
    monkeypatch.setitem(builder._data, "causes", [cause])
    assert sizes(builder, 0.1, math.inf) == [(1.0, 0.1)]


def test_a_spring_of_any_stiffness_has_the_torque_that_the_diagnosis_saw(builder):
    posed = builder.pose(Question("joint_spring", 1, estimate={"k": (0.05, 0.4), "q0": (-2.0, 20.0)}))
    assert posed is not None
    springs = [effects[-1].parameters for _, effects in posed.pair.alternatives]
    assert len({spring["k"] for spring in springs}) == len(springs) > 1
    assert all(spring["k"] * spring["q0"] == pytest.approx(-0.1) for spring in springs)


def test_an_effect_in_place_of_a_cause_has_the_size_of_its_fit_and_replaces_the_cause(limited):
    cause = fitted("torque_offset", {"offset": (0.1, 0.01)})
    same = {"effect": "coulomb_asymmetry", "joint": 1, "motion_separates": False}
    ranking = [fitted("coulomb_asymmetry", {"delta": (-0.1, 0.01)}), fitted("quadratic_drag", {"c": (0.2, 0.01)})]
    data = {"causes": [{**cause, "equivalents": [same]}], "candidates": [], "ruled_out": [], "ranking": ranking}
    (place_taken,) = asked(["coulomb_asymmetry:1"], data, limited)
    assert place_taken.estimate == {"delta": (-0.1, 0.01)}
    assert place_taken.replaced == {("torque_offset", 1)}
    (beside,) = asked(["quadratic_drag:1"], data, limited)
    assert beside.estimate is None, "it was fitted without the cause, beside which it would be"
    assert not beside.replaced
    (alone,) = asked(["quadratic_drag:1"], {**data, "causes": []}, limited)
    assert alone.estimate == {"c": (0.2, 0.01)}


def test_neither_model_holds_a_cause_that_is_replaced(builder, monkeypatch):
    offset = armgap.evidence.hypothesis.EffectInstance("torque_offset", 1, {"offset": 0.1})
    monkeypatch.setattr(builder, "_base", (offset,))
    question = Question("quadratic_drag", 1, estimate={"c": (0.2, 0.01)})
    for replaced, kept in ((frozenset(), (offset,)), (frozenset({("torque_offset", 1)}), ())):
        posed = builder.pose(replace(question, replaced=replaced))
        assert posed is not None
        assert posed.pair.rival == kept
        assert all(effects[:-1] == kept for _, effects in posed.pair.alternatives)


def test_a_spring_with_a_far_off_rest_position_imitates_an_offset(builder):
    posed = builder.pose(Question("torque_offset", 1, estimate={"offset": (0.1, 0.01)}))
    assert posed is not None
    target = builder._usual.difference(posed.pair)
    whole, _ = builder._usual.left_of(target)
    (spring,) = builder._imitators.starts(("joint_spring", 1), (), target)
    by_size, _ = builder._usual.left_of(target, builder._usual.change(spring, ()))
    assert by_size > 0.9 * whole
    # Friction that holds and lets go is not linear in an offset: a part is left.
    assert builder._imitators.least_left(("joint_spring", 1), (), target) < 0.2 * whole
    fitted = builder._imitators.best([spring], (), target)
    left, _ = builder._usual.left_of(target - builder._usual.change(fitted, ()))
    assert left < 0.01 * whole
    assert fitted.parameters["k"] * (0.0 - fitted.parameters["q0"]) == pytest.approx(-0.1, rel=0.3)


def test_causes_with_which_the_arm_diverges_are_left_out_and_said(limited, diagnosis, monkeypatch):
    """A drag that is negative beyond the diagnosed speeds speeds the arm up."""
    model, _ = known_model(diagnosis.to_dict(), limited)
    drag = armgap.evidence.hypothesis.EffectInstance("cubic_drag", 1, {"c3": -50.0})
    monkeypatch.setattr(planning, "known_model", lambda *_: (model.only((drag,)), ()))
    monkeypatch.setattr(search, "GENERATIONS", 0)
    made = armgap.plan(diagnosis, limited, questions=["quadratic_drag:1"], duration=2.0)
    assert any("without cubic_drag:1: with the diagnosed values the arm diverges" in note for note in made.notes)
    monkeypatch.setattr(planning, "known_model", lambda *_: (model, ()))
    made = armgap.plan(diagnosis, limited, questions=["quadratic_drag:1"], duration=2.0)
    assert not any("diverges" in note for note in made.notes)
