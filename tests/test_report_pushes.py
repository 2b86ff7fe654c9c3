"""Pushes in the summary of a report: with their values if there are few, by joint, log and time if there are many."""

from __future__ import annotations

import copy

import report_cases as cases
from armgap.report.words import answers


def test_several_pushes_are_counted_in_the_headline_and_told_apart_in_the_text() -> None:
    data = copy.deepcopy(cases.named().to_dict())
    push = data["causes"][0] | {"effect": "external_pulse"}
    data["causes"] = [push | {"log": "first run"}, push | {"log": "second run"}]
    which = answers(data)[1]
    assert which.headline == "External push, joint 1 (2 times)"
    assert "in first run" in which.detail
    assert "in second run" in which.detail


def test_of_many_pushes_the_summary_gives_places_times_and_probabilities() -> None:
    data = copy.deepcopy(cases.named().to_dict())
    effect = data["causes"][0]
    moment = {"time": {"value": 1.5, "sigma": 0.01, "unit": "s"}}
    push = effect | {"effect": "external_pulse", "log": "run", "probability": 0.6, "parameters": moment}
    data["causes"] = [effect, *[copy.deepcopy(push) for _ in range(3)]]
    which = answers(data)[1]
    assert which.headline.endswith("and external push, joint 1 (3 times)")
    assert which.detail.count("1.50 s (0.60)") == 3
    assert which.detail.startswith("Stribeck friction")
