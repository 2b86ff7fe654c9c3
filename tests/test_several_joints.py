"""Causes on several joints at once: read, shown, compared, exported, and counted by fleets."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from armgap import Arm, Diagnosis, correct
from armgap.check.time_shift import causal
from armgap.check.torque_unit import refined
from armgap.diagnosis import Value
from armgap.diagnosis.comparison import compare
from armgap.export.randomization import randomization
from armgap.fleet.manifest import Entry
from armgap.fleet.tables import parameter_rows, summary_rows
from armgap.report import diagnosis_report
from armgap.several_joints import by_joint
from diagnosis_schema.checking import misfits
from serial_export_cases import described_arm, diagnosed

DELAYS = [0.010, 0.012, 0.011]
#: Torques that come late on three joints, and friction on the difference of two joints' motion.
LATE = {
    "effect": "actuator_delay", "title": "actuator delay", "joint": None, "joints": [1, 2, 3], "probability": 0.9, "closed": 0.8,
    "parameters": {"delay": {"value": DELAYS, "sigma": [0.001, 0.001, 0.002], "unit": "s"}},
    "equivalents": [{"effect": "actuator_lag", "joint": None, "joints": [1, 2, 3], "why": "as well", "motion_separates": True}],
}  # fmt: skip
COUPLED = {
    "effect": "coupled_transmission", "title": "transmission that couples two joints", "joint": None, "joints": [1, 2], "row": [1, -1],
    "probability": 0.7, "closed": 0.3,
    "parameters": {
        "inertia": {"value": 0.1, "sigma": 0.02, "unit": "kg m^2"},
        "viscous": {"value": 0.4, "sigma": 0.1, "unit": "N m s/rad"},
        "coulomb": {"value": 0.2, "sigma": 0.1, "unit": "N m"},
    },
    "equivalents": [{"effect": "joint_spring", "joint": None, "joints": [1, 2], "row": [1, -1], "why": "as well", "motion_separates": True}],
}  # fmt: skip


@pytest.fixture
def arm(tmp_path: Path) -> Arm:
    return described_arm(tmp_path)


def diagnosis_of(arm: Arm, *causes: dict[str, Any]) -> Diagnosis:
    data = json.loads(diagnosed(arm, case="none").to_json())
    return Diagnosis.from_dict(data | {"causes": list(causes), "verdict": "effect"})


@pytest.fixture
def found(arm: Arm) -> Diagnosis:
    return diagnosis_of(arm, LATE, COUPLED)


def test_a_cause_on_all_joints_has_a_value_per_joint(found: Diagnosis) -> None:
    cause = found.causes[0]
    assert (cause.joint, cause.joints, cause.row, cause.parameters) == (None, (1, 2, 3), None, {})
    assert cause.values["delay"].value == tuple(DELAYS)
    singles = cause.by_joint()
    assert [(c.joint, c.joints) for c in singles] == [(1, None), (2, None), (3, None)]
    assert singles[1].parameters == {"delay": Value(0.012, 0.001, "s")}
    assert cause.equivalents[0].joints == (1, 2, 3)


def test_a_cause_on_a_row_over_two_joints_keeps_its_values(found: Diagnosis) -> None:
    cause = found.causes[1]
    assert (cause.joint, cause.joints, cause.row) == (None, (1, 2), (1, -1))
    assert cause.parameters["coulomb"] == Value(0.2, 0.1, "N m")
    assert cause.values == {}
    assert cause.by_joint() == (cause,)


def test_both_fit_the_schema(found: Diagnosis) -> None:
    place = "$.causes"
    assert [line for line in misfits(found.to_dict()) if line.startswith(place)] == []
    wrong = found.to_dict() | {"causes": [LATE | {"joints": [0]}]}
    assert [line for line in misfits(wrong) if line.startswith(place)] != []


def test_the_summary_says_where_and_how_much(found: Diagnosis) -> None:
    text = found.summary()
    assert "Actuator delay, joints 1, 2 and 3" in text
    assert "delay 0.0100 ± 0.0010 / 0.0120 ± 0.0010 / 0.0110 ± 0.0020 s" in text
    assert "ransmission that couples two joints, difference of joints 1 and 2" in text
    assert "oint spring, difference of joints 1 and 2" in text


def test_the_report_is_made(found: Diagnosis) -> None:
    page = diagnosis_report(found, "x.md")
    assert "joints 1, 2 and 3" in page
    assert "difference of joints 1 and 2" in page


def test_a_comparison_goes_joint_by_joint(arm: Arm, found: Diagnosis) -> None:
    shorter = [0.010, 0.002, 0.011]
    later = LATE | {"parameters": {"delay": LATE["parameters"]["delay"] | {"value": shorter}}}  # type: ignore[index]
    changes = compare(found, diagnosis_of(arm, later)).causes
    status = {(c.effect, c.joint): c.status for c in changes}
    assert status["actuator_delay", 1] == status["actuator_delay", 3] == "unchanged"
    assert status["actuator_delay", 2] == "smaller"
    assert next(c for c in changes if c.effect == "coupled_transmission").joints == (1, 2)


@pytest.mark.slow
def test_an_export_has_the_delay_of_every_joint(arm: Arm, found: Diagnosis) -> None:
    model = correct(found, arm)
    assert [joint.delay for joint in model.joints] == DELAYS
    assert any("coupled_transmission of difference of joints 1 and 2" in line for line in model.remarks("mjcf"))
    assert "delay" in model.render("mjcf")
    effects = json.loads(model.render("json"))["effects"]
    assert [(e["effect"], e["joint"]) for e in effects[:3]] == [("actuator_delay", j) for j in (1, 2, 3)]
    assert (effects[3]["joints"], effects[3]["row"]) == ([1, 2], [1, -1])
    places = [q for q in json.loads(randomization(model))["quantities"] if q.get("effect") == "actuator_delay"]
    assert [q["joint"] for q in places] == [1, 2, 3]


def test_a_fleet_has_a_row_per_joint(found: Diagnosis) -> None:
    entry = Entry("a", "arm.toml", (), (), "", 1)
    data = found.to_dict() | {"seconds": 1.0}
    data["gap"] = data["gap"] | {"unexplained": 0.1}
    assert [(r["effect"], r["joint"]) for r in summary_rows(entry, data)][:3] == [
        ("actuator_delay", j) for j in (1, 2, 3)
    ]
    of = {r["of"] for r in parameter_rows(entry, data)}
    assert {"actuator_delay:2", "coupled_transmission:1-2"} <= of


def test_checks_of_the_input_see_every_joint() -> None:
    check = causal([LATE], 3, 0.01)
    assert check is not None
    assert check.check == "time_shift"
    gain = LATE | {
        "effect": "torque_gain",
        "parameters": {"gain": {"value": [2.0, 3.0, 1.0], "sigma": [0.1] * 3, "unit": "1"}},
    }
    assert refined({"tau1": 1.0, "tau2": 1.0, "tau3": 1.0}, [gain], 3) == {"tau1": 2.0, "tau2": 3.0, "tau3": 1.0}


def test_what_is_on_one_joint_stays_as_it_is() -> None:
    single = {"effect": "stribeck", "joint": 2, "parameters": {}}
    assert by_joint([single, COUPLED]) == [single, COUPLED]
