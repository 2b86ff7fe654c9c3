"""Evidence: the inertia behind it, the law against the truth, every effect of the library, physical plausibility."""

from __future__ import annotations

import copy

import numpy as np
import pytest

import report_cases as cases
from armgap import effects
from armgap.evidence import laws, plausibility
from armgap.evidence.hypothesis import EffectInstance, Hypothesis, delivered, true_positions
from armgap.evidence.laws import VARIABLES
from armgap.simulation import Effect

#: A window's law is averaged over 16 ms, within which a swing changes its speed.
SMOOTHING = 0.02  # N m
#: Effects that a pendulum has no room for.
NEED_TWO_JOINTS = ("rotor_coupling",)


def with_cause(effect: str, joint: int | None, **parameters: float) -> dict:
    """The data of a diagnosis that names this cause."""
    data = copy.deepcopy(cases.none().to_dict())
    values = {name: {"value": value, "sigma": 0.1, "unit": "1"} for name, value in parameters.items()}
    data["causes"] = [{"effect": effect, "joint": joint, "parameters": values}]
    return data


def test_inertia_of_the_two_link_arm_is_the_papers(arm) -> None:
    """Reyes and Kelly (1997), equation (27): M = [[th1 + 2 th2 cos q2, th3 + th2 cos q2], [., th3]]."""
    th1, th2, th3 = arm.theta[:3]
    q = np.array([0.4, 1.1])
    m12 = th3 + th2 * np.cos(q[1])
    expected = np.array([[th1 + 2 * th2 * np.cos(q[1]), m12], [m12, th3]])
    found = Hypothesis(arm, tuple(arm.theta)).inertia(q[None])[0]
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_delivered_torque_follows_each_law_of_the_command() -> None:
    t = np.arange(200) * 0.002
    tau = np.sin(20 * t)[:, None]
    clipped = delivered(t, tau, [EffectInstance("torque_saturation", 1, {"level": 0.5})])
    np.testing.assert_allclose(clipped[:-1], np.clip(tau, -0.5, 0.5)[:-1], atol=1e-9)
    late = delivered(t, tau, [EffectInstance("actuator_delay", 1, {"delay": 0.004})])
    np.testing.assert_allclose(late[2:-1], tau[:-3], atol=1e-9)
    np.testing.assert_array_equal(delivered(t, tau, []), tau)


def test_true_positions_undo_encoder_errors() -> None:
    q = np.linspace(-3, 3, 500)[:, None]
    shown = q + 0.05 * np.sin(q) + 0.02 * np.cos(q)
    back = true_positions(shown, [EffectInstance("encoder_eccentricity", 1, {"a": 0.05, "b": 0.02})])
    np.testing.assert_allclose(back, q, atol=1e-6)


def test_the_law_runs_through_the_data_and_is_the_hidden_one() -> None:
    [law] = cases.named().to_dict()["laws"]
    assert (law["variable"], law["unit"], law["failed"]) == ("dq1", "rad/s", 0)
    bins = {key: np.array(values) for key, values in law["bins"].items()}
    assert np.mean(np.abs(bins["mean"] - bins["law"]) <= bins["error"]) > 0.7
    hidden = cases.STRIBECK.parameters
    truth = -hidden["amplitude"] * np.exp(-((bins["x"] / hidden["velocity"]) ** 2)) * np.sign(bins["x"])
    away = np.abs(bins["x"]) > 0.2  # nearer to a reversal the average over a window mixes both directions
    np.testing.assert_allclose(bins["law"][away], truth[away], atol=SMOOTHING)
    assert law["explained"] > 0.95


def test_a_law_that_is_wrong_is_seen_to_be() -> None:
    """Drag does not explain what Stribeck friction leaves."""
    data = with_cause("quadratic_drag", 1, c=0.02)
    [law] = laws(data, cases.ARM, [], [cases.swing(3, cases.STRIBECK)])
    assert law["explained"] < 0.5


@pytest.mark.parametrize("entry", effects(), ids=lambda e: e["name"])
def test_every_effect_of_the_library_has_its_picture(entry) -> None:
    values = {p["name"]: float(np.clip(0.1, p["lower"], p["upper"])) for p in entry["parameters"]}
    values |= {"time": 3.0} if "time" in values else {}
    joint = 1 if entry["scope"] == "joint" else None
    [law] = laws(with_cause(entry["name"], joint, **values), cases.ARM, [], [cases.swing(3)])
    assert law["windows"] > 0
    if entry["name"] in NEED_TWO_JOINTS:
        assert "bins" not in law
        return
    assert law["shown_joint"] == 1
    assert all(np.isfinite(values).all() for values in (*law["bins"].values(), *law["points"].values()))
    assert len(law["bins"]["x"]) >= 5


def test_a_push_is_looked_at_in_its_own_log_and_around_its_time() -> None:
    push = Effect("external_pulse", 1, {"impulse": 0.05, "time": 3.0, "duration": 0.1})
    pushed, other = cases.swing(3, push, name="pushed"), cases.swing(4, name="other")
    data = with_cause("external_pulse", 1, **push.parameters)
    data["causes"][0]["log"] = "pushed"
    [law] = laws(data, cases.ARM, [pushed], [other])
    assert min(law["points"]["x"]) > 2.5
    assert max(law["points"]["x"]) < 3.5
    at = int(np.argmax(np.abs(law["bins"]["mean"])))
    assert law["bins"]["x"][at] == pytest.approx(3.0, abs=0.06)
    assert law["explained"] > 0.9
    [elsewhere] = laws(data, cases.ARM, [], [other])
    assert "bins" not in elsewhere


def test_variables_belong_to_effects() -> None:
    assert set(VARIABLES) <= {e["name"] for e in effects()}


def test_no_cause_has_no_law_and_a_log_too_short_says_so() -> None:
    assert cases.none().to_dict()["laws"] == []
    short = cases.swing(3).part(0, 60, "short")
    [law] = laws(with_cause("stribeck", 1, amplitude=0.1, velocity=0.3), cases.ARM, [], [short])
    assert "bins" not in law


def test_possible_values_hold() -> None:
    assert all(check["holds"] for check in cases.named().to_dict()["plausibility"])


@pytest.mark.parametrize(
    ("name", "value", "check"),
    [
        ("theta1", -0.05, "the inertia matrix is positive definite in every pose"),
        ("viscous1", -0.5, "viscous1 is not negative"),
        ("coulomb1", -0.5, "coulomb1 is not negative"),
    ],
)
def test_impossible_values_are_called_so(name, value, check) -> None:
    data = copy.deepcopy(cases.none().to_dict())
    data["parameters"]["with_causes"][name] |= {"value": value, "sigma": 0.01}
    broken = [c["check"] for c in plausibility(data, cases.ARM) if not c["holds"]]
    assert broken == [check]


def test_an_inertia_matrix_that_is_indefinite_in_some_pose_only_is_found(arm) -> None:
    """With theta2 this large the determinant changes sign between q2 = 0 and q2 = pi/2."""
    names = arm.parameter_names
    theta = dict(zip(names, (1.0, 0.5, 0.1, *arm.theta[3:]), strict=True))
    values = {name: {"value": v, "sigma": 0.0, "unit": "1"} for name, v in theta.items()}
    [inertia, *_] = plausibility({"parameters": {"with_causes": values}}, arm)
    assert not inertia["holds"]
    values["theta2"]["value"] = 0.01
    [inertia, *_] = plausibility({"parameters": {"with_causes": values}}, arm)
    assert inertia["holds"]
