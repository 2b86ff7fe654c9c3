"""What a cause may be instead, which no effect of the library is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from armgap import Arm, Log
from armgap.check import Check
from armgap.diagnosis.equivalents import (
    center_of_mass,
    common_gain,
    encoder_scale,
    gear_losses,
    late_positions,
    low_pass,
    torque_loop,
)


def test_a_lag_beside_a_low_pass_may_be_the_low_pass() -> None:
    def lag(joint: int) -> dict[str, object]:
        return {"effect": "actuator_lag", "joint": joint, "probability": 0.98, "equivalents": []}

    filtered = Check("filtered_positions", "warning", "", ("log positions as the encoder gives them",), 1, "run")
    data = {"causes": [lag(1), lag(2)]}
    low_pass(data, [filtered])
    first, second = data["causes"]
    assert (first["probability"], second["probability"]) == (0.49, 0.98)
    assert [e["effect"] for e in first["equivalents"]] == ["filtered_positions"]
    assert not second["equivalents"]


def test_a_delay_beyond_that_of_the_measured_torque_may_be_late_positions() -> None:
    def equivalents(measured: float, effect: str = "actuator_delay", joint: int = 1) -> list[str]:
        name = "delay" if effect == "actuator_delay" else "time_constant"
        cause = {"effect": effect, "joint": joint, "equivalents": [], "parameters": {name: {"value": 0.008}}}
        drive = {
            "stage": "drive",
            "joint": 1,
            "share": 0.0,
            "parameters": {"delay": {"value": measured, "sigma": 0.0002}},
        }
        late_positions({"causes": [cause], "chain": [{"stage": "mechanics", "joint": 1, "share": 1.0}, drive]})
        return [e["effect"] for e in cause["equivalents"]]

    assert equivalents(0.001) == equivalents(0.001, "actuator_lag") == ["late_positions"]
    assert equivalents(0.0075) == equivalents(0.001, joint=2) == []


def test_an_elastic_joint_without_rotor_beside_a_delay_may_be_the_torque_loop() -> None:
    def data(sigma: float, encoder: str, joint: int) -> dict[str, Any]:
        rotor = {"value": 0.01, "sigma": sigma, "unit": "kg m^2"}
        shaft = {"effect": "joint_elasticity", "joint": 1, "probability": 0.9, "equivalents": []}
        shaft |= {"parameters": {"rotor_inertia": rotor}, "sides": {"encoder": encoder}}
        return {"causes": [{"effect": "actuator_delay", "joint": joint, "probability": 0.9}, shaft]}

    found = data(0.02, "link", 1)
    torque_loop(found)
    assert found["causes"][1]["probability"] == pytest.approx(0.45)
    assert [e["effect"] for e in found["causes"][1]["equivalents"]] == ["torque_loop_resonance"]
    for other in (data(0.001, "link", 1), data(0.02, "motor", 1), data(0.02, "link", 2)):
        torque_loop(other)
        assert other["causes"][1]["equivalents"] == []


def test_an_eccentricity_over_a_short_travel_may_be_a_wrong_scale() -> None:
    t = 0.01 * np.arange(1000)

    def of(travel: float) -> list[str]:
        q = travel * np.sin(t)[:, None]
        parameters = {name: {"value": value} for name, value in (("a", 0.03), ("b", 0.01))}
        cause = {
            "effect": "encoder_eccentricity",
            "joint": 1,
            "probability": 0.8,
            "equivalents": [],
            "parameters": parameters,
        }
        data: dict[str, Any] = {"causes": [cause]}
        encoder_scale(data, [Log("run", t, q, 0.0 * q, None)])
        return [entry["effect"] for entry in data["causes"][0]["equivalents"]]

    assert (of(0.7), of(3.0), of(0.0)) == (["encoder_scale"], [], [])


def test_an_encoder_offset_of_the_last_joint_may_be_a_centre_of_mass_beside_the_axis() -> None:
    def said(joint: int, arm: Arm) -> list[str]:
        data: dict[str, Any] = {"causes": [{"effect": "encoder_offset", "joint": joint, "equivalents": []}]}
        center_of_mass(data, arm)
        return [entry["effect"] for entry in data["causes"][0]["equivalents"]]

    theta = [2.35, 0.084, 0.1, 38.5, 1.8, 2.3, 0.2, 7.2, 1.7]
    two = Arm("two", "two-link", 9.81, 0.002, theta, sigma=np.full(9, 0.1))
    axis = Arm("axis", "axis", 0.0, 0.002, [5.0, 0.0, 3.0, 10.0], sigma=np.full(4, 0.1))
    assert (said(1, two), said(2, two), said(1, axis)) == ([], ["center_of_mass"], [])


@pytest.mark.parametrize(
    ("joint", "gain", "alike", "said"),
    [
        (1, 1.163, [], True),
        (2, 1.0 / 1.163, [1], True),
        (2, 1.0 / 1.163, [], False),
        (1, 0.86, [], False),
        (1, 1.4, [], False),
    ],
)
def test_a_gain_beside_a_loss_may_be_a_gear_that_loses_in_both_directions(
    joint: int, gain: float, alike: list[int], *, said: bool
) -> None:
    # Friction of 0.14 times the transmitted torque: a loss of 0.246 while driving, a gain of 1.163.
    loss = {"effect": "gear_efficiency", "joint": 1, "probability": 0.96, "equivalents": []}
    loss |= {"parameters": {"loss": {"value": 0.246}}}
    same = [{"effect": "torque_gain", "joint": other} for other in alike]
    cause = {"effect": "torque_gain", "joint": joint, "probability": 0.9, "equivalents": same}
    cause |= {"parameters": {"gain": {"value": gain}}}
    gear_losses({"causes": [loss, cause]})
    names = [entry["effect"] for entry in cause["equivalents"]]
    assert ("gear_losses" in names, cause["probability"]) == (said, pytest.approx(0.45 if said else 0.9))
    assert loss["probability"] == 0.96


def test_a_payload_that_is_one_factor_of_all_parameters_may_be_the_drives() -> None:
    def data(found: list[float]) -> dict[str, Any]:
        keys = ("theta1", "theta2", "theta4")

        def values(x: list[float]) -> dict[str, Any]:
            return {key: {"value": value, "sigma": 0.03} for key, value in zip(keys, x, strict=True)}

        cause = {"effect": "payload", "joint": None, "probability": 0.98, "equivalents": []}
        parameters = {
            "nominal": values([1.0, 1.0, 1.0]),
            "refit": values(found),
            "with_causes": values([1.01, 0.98, 1.0]),
        }
        return {"causes": [cause], "parameters": parameters}

    scaled, loaded = data([1.18, 1.17, 1.18]), data([1.3, 1.1, 1.2])
    common_gain(scaled)
    common_gain(loaded)
    (one,), (other,) = scaled["causes"], loaded["causes"]
    assert [entry["effect"] for entry in one["equivalents"]] == ["torque_gain"]
    assert (one["probability"], other["probability"], other["equivalents"]) == (0.49, 0.98, [])
