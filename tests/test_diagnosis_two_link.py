"""The diagnosis of a two-link arm: its JSON in detail, and the verdict on three known arms."""

from __future__ import annotations

import json

import numpy as np
import pytest

from armgap import Arm, Diagnosis, Log, diagnose, effects, seed_torque, simulate
from armgap.simulation import Effect
from diagnosis_schema.checking import losses, misfits

GAIN = 0.85


@pytest.fixture(scope="module")
def logs(arm: Arm) -> tuple[Log, Log]:
    """Training and holdout under different torques, from an arm whose second motor gives less than it is told."""
    t = np.arange(1600) * arm.sample_period
    hidden = [Effect("torque_gain", 2, {"gain": GAIN})]
    training = simulate(arm, t, seed_torque(t), effects=hidden, name="training")
    other = np.column_stack([45 * np.sin(9 * t) + 20 * np.sin(17 * t), 6 * np.sin(15 * t + 1) + 4 * np.sin(31 * t)])
    return training, simulate(arm, t, other, effects=hidden, name="holdout")


@pytest.fixture(scope="module")
def result(arm: Arm, logs: tuple[Log, Log]) -> Diagnosis:
    return diagnose(logs[0], arm, holdout=logs[1])


def test_json_follows_the_schema(result):
    assert misfits(json.loads(result.to_json())) == []
    assert losses(result.to_json()) == []
    low, high = result.gap.closed_ci
    assert low <= result.gap.closed <= high <= 1
    assert all(place.low < place.high for place in result.where if place.regime != "everywhere")
    assert {out.bound.level for out in result.ruled_out if out.bound} == {0.95}
    assert set(result.parameters) >= {"nominal", "refit", "with_causes"}


def test_where_is_ordered_and_shares_add_up_to_no_more_than_all(result):
    shares = [place.share for place in result.where]
    assert shares == sorted(shares, reverse=True)
    assert sum(shares) <= 1 + 1e-9


def test_every_candidate_is_named_or_ruled_out_or_a_look_alike(result):
    spoken = {(c.effect, c.joint) for c in result.causes}
    spoken |= {(e.effect, e.joint) for c in result.causes for e in c.equivalents}
    spoken |= {(r.effect, r.joint) for r in result.ruled_out}
    for effect in effects():
        places = [None] if effect["scope"] == "arm" else [1, 2]
        for place in places:
            assert (effect["name"], place) in spoken, (effect["name"], place)


def test_the_hidden_effect_is_found_and_sized(result):
    assert result.verdict == "effect"
    cause = result.causes[0]
    named = {(cause.effect, cause.joint), *((e.effect, e.joint) for e in cause.equivalents)}
    assert ("torque_gain", 2) in named
    assert result.gap.closed > 0.8
    if cause.effect == "torque_gain":
        gain = cause.parameters["gain"]
        assert gain.value == pytest.approx(GAIN, abs=max(0.01, 4 * gain.sigma))


def test_dataclasses_say_what_the_json_says(result):
    data = result.to_dict()
    assert result.verdict == data["verdict"]
    assert list(result.gap.before) == data["gap"]["before"]
    assert list(result.gap.free_run_after) == data["gap"]["free_run"]["after"]
    assert [(c.effect, c.joint) for c in result.causes] == [(c["effect"], c["joint"]) for c in data["causes"]]
    assert {k: v.value for k, v in result.parameters["refit"].items()} == {
        k: v["value"] for k, v in data["parameters"]["refit"].items()
    }
    assert "series" in result.extra


def test_an_arm_that_fits_gives_none(arm):
    t = np.arange(1600) * arm.sample_period
    other = np.column_stack([45 * np.sin(9 * t) + 20 * np.sin(17 * t), 6 * np.sin(15 * t + 1) + 4 * np.sin(31 * t)])
    result = diagnose(simulate(arm, t, seed_torque(t)), arm, holdout=simulate(arm, t, other))
    assert result.verdict == "none"
    assert result.causes == ()


def test_wrong_values_give_parameters(arm):
    import dataclasses

    theta = arm.theta.copy()
    theta[3] *= 0.9
    wrong = dataclasses.replace(arm, theta=theta)
    t = np.arange(1600) * arm.sample_period
    other = np.column_stack([45 * np.sin(9 * t) + 20 * np.sin(17 * t), 6 * np.sin(15 * t + 1) + 4 * np.sin(31 * t)])
    result = diagnose(simulate(arm, t, seed_torque(t)), wrong, holdout=simulate(arm, t, other))
    assert result.verdict == "parameters"
    assert result.parameters["refit"]["theta4"].value == pytest.approx(arm.theta[3], rel=0.01)


def hidden_in(arm: Arm, *hidden: Effect, tolerance: float = 1e-9) -> Diagnosis:
    """The diagnosis of this arm with these effects, from two noisy logs."""
    noise = np.random.default_rng(5)
    t = np.arange(1600) * arm.sample_period
    other = np.column_stack([45 * np.sin(9 * t) + 20 * np.sin(17 * t), 6 * np.sin(15 * t + 1) + 4 * np.sin(31 * t)])
    clean = [simulate(arm, t, tau, effects=list(hidden), tolerance=tolerance) for tau in (seed_torque(t), other)]
    training, holdout = (Log(x.name, x.t, x.q + noise.normal(0, 1e-5, x.q.shape), x.tau) for x in clean)
    return diagnose(training, arm, holdout=holdout)


@pytest.mark.slow
def test_a_second_cause_that_is_small_beside_the_first_is_found(arm):
    warmup = Effect("friction_warmup", 1, {"amplitude": 6.0, "time_constant": 1.0})
    result = hidden_in(arm, warmup, Effect("torque_gain", 2, {"gain": 1.02}))
    assert [(c.effect, c.joint) for c in result.causes] == [("friction_warmup", 1), ("torque_gain", 2)]
    assert result.causes[1].parameters["gain"].value == pytest.approx(1.02, abs=1e-3)


@pytest.mark.slow
def test_friction_that_falls_up_to_the_highest_speeds_is_sized(arm):
    result = hidden_in(arm, Effect("stribeck", 2, {"amplitude": 1.5, "velocity": 4.0}))
    assert [(c.effect, c.joint) for c in result.causes] == [("stribeck", 2)]
    assert result.causes[0].parameters["velocity"].value == pytest.approx(4.0, rel=0.01)


@pytest.mark.slow
def test_a_hard_stop_is_no_push(arm):
    stop = Effect("contact", 2, {"position": 0.1, "stiffness": 2000.0, "damping": 2.0})
    result = hidden_in(arm, stop, tolerance=1e-4)
    assert [(c.effect, c.joint) for c in result.causes] == [("contact", 2)]
    assert result.causes[0].probability > 0.9
    assert result.causes[0].parameters["stiffness"].value == pytest.approx(2000.0, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "parameters", "kind"),
    [("quadratic_drag", {"c": 0.05}, "takes"), ("joint_spring", {"k": 4.0, "q0": 0.0}, "both")],
)
def test_a_missing_loss_takes_energy_and_a_missing_spring_gives_it_back(arm, effect, parameters, kind):
    t = np.arange(1600) * arm.sample_period
    log = simulate(arm, t, seed_torque(t), effects=[Effect(effect, 2, parameters)], name="log")
    energy = json.loads(diagnose(log, arm).to_json())["energy"]
    assert [(e["joint"], e["model"]) for e in energy] == [(j, m) for m in ("before", "refit", "after") for j in (1, 2)]
    own = energy[1]
    assert own["kind"] == kind
    assert own["balance"] == pytest.approx(own["power"] / own["exchanged"])
    assert 0 < own["exchanged"] < own["commanded"]
