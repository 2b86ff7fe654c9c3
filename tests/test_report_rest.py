"""What a report says of the part of a gap that stays."""

from __future__ import annotations

import copy

import report_cases as cases
from armgap.report.words import answers, verdict
from test_report import with_errors


def test_what_other_values_close_is_said_where_no_cause_is_named() -> None:
    data = with_errors(100.0, 10.0, 0.9, 0.8, 1.0) | {"verdict": "unexplained", "causes": []}
    answer = answers(data)[2]
    assert answer.headline == "By 90\N{NO-BREAK SPACE}% with other values of the arm; the rest stays"
    assert "\N{RIGHTWARDS ARROW}" in answer.detail
    data["gap"] |= {"closed": 0.0, "after": data["gap"]["before"]}
    assert answers(data)[2].headline == "It stays"


def test_a_small_rest_is_said_where_the_arm_file_suffices() -> None:
    data = with_errors(3.0, 3.0, 0.0, 0.0, 1.0) | {"verdict": "none", "causes": []}
    assert "nearly as well as the logs can tell" in verdict(data)
    data["gap"]["after"] = data["gap"]["floor"]
    assert verdict(data) == "The model predicts this arm as well as the logs can tell."


def test_filtered_positions_do_not_show_their_noise() -> None:
    data = with_errors(100.0, 10.0, 0.9, 0.8, 0.1)
    assert "a perfect model would miss by" in answers(data)[2].detail
    data["checks"] = [{"check": "filtered_positions", "severity": "warning", "message": "smooth", "joint": 1}]
    assert "is not known, as the positions are filtered" in answers(data)[2].detail


def test_pushes_act_at_times() -> None:
    data = copy.deepcopy(cases.named().to_dict())
    data["gap"] |= {key: data["gap"][key][:1] for key in ("before", "refit", "after", "floor")}
    assert "acts throughout" in answers(data)[0].detail
    data["causes"] = [data["causes"][0] | {"effect": "external_pulse", "log": {"source": "a", "part": None}}]
    assert "acts at times" in answers(data)[0].detail
