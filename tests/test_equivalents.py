"""What a cause may be instead, which no effect of the library is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from armgap import Log
from armgap.check import Check
from armgap.diagnosis.equivalents import encoder_scale, low_pass, speed_limit, torque_loop
from armgap.report.pushes import times_of_pushes


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


def test_pushes_where_a_drive_is_at_its_strongest_may_be_its_limit() -> None:
    t = 0.002 * np.arange(4000)
    q, tau = np.sin(2 * np.pi * 0.25 * t), np.where((t > 3.9) & (t < 4.1), 5.0, 0.1)
    log = Log("run", t, q[:, None], tau[:, None], None)

    def pushed(time: float, impulse: float) -> dict[str, Any]:
        values = {"time": time, "duration": 0.1, "impulse": impulse}
        parameters = {name: {"value": value} for name, value in values.items()}
        return {
            "effect": "external_pulse", "joint": 1, "log": "run", "probability": 0.9, "equivalents": [], "parameters": parameters,
        }  # fmt: skip

    for time, impulse, said in ((4.0, -0.2, True), (4.0, 0.2, False), (1.0, -0.2, False)):
        data = {"causes": [pushed(time, impulse)]}
        speed_limit(data, [log])
        assert [e["effect"] for e in data["causes"][0]["equivalents"]] == ["torque_speed_limit"] * said
        assert data["causes"][0]["probability"] == pytest.approx(0.45 if said else 0.9)
    assert "repeat the motion" not in times_of_pushes([pushed(1.0, -0.2)])
    twice = {"causes": [pushed(3.97, -0.2), pushed(4.03, -0.2)]}
    speed_limit(twice, [log])
    assert [c["probability"] for c in twice["causes"]] == pytest.approx([0.225, 0.225])
    assert times_of_pushes(twice["causes"]).endswith(
        "Those on joint 1 look like a torque limit that falls with the speed: repeat the motion, and such a limit comes back."
    )
