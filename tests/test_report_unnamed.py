"""Reports of what the residual torque that stays depends on."""

from __future__ import annotations

import copy

import pytest

import report_cases as cases
from armgap import Diagnosis
from armgap.report import charts, diagnosis_report, render_html


def test_what_the_rest_depends_on_is_drawn_and_read_back() -> None:
    data = copy.deepcopy(cases.named().to_dict())
    assert "What the rest depends on" not in render_html(data)
    law = {"x": [-0.4, 0.1, 0.6], "torque": [-1.25, 0.5, 0.75], "sigma": [0.1, 0.2, 0.3]}
    data["unnamed"] = [{"joint": 1, "variable": "ddq1", "unit": "rad/s^2", "share": 0.6, "law": law}]
    [found] = Diagnosis.from_dict(data).unnamed
    assert (found.joint, found.variable, found.share, found.law.torque) == (1, "ddq1", 0.6, (-1.25, 0.5, 0.75))
    page = render_html(data)
    assert page.index("The evidence") < page.index("What the rest depends on</h2>")
    assert "acceleration of joint 1" in page
    assert "1.25" in diagnosis_report(Diagnosis.from_dict(data), "x.md")


def test_a_table_over_two_variables_is_drawn_and_read_back() -> None:
    data = copy.deepcopy(cases.named().to_dict())
    law = {"x": [-0.4, 0.6], "torque": [-0.25, 0.25], "sigma": [0.1, 0.2]}
    grid = {
        "variable": "dq1", "unit": "rad/s", "x": [-0.4, 0.6], "y": [-3.0, 0.0, 2.0],
        "torque": [[-1.75, 0.5, 0.25], [0.5, 0.0, -0.5]], "sigma": [[0.1] * 3, [0.2] * 3],
    }  # fmt: skip
    data["unnamed"] = [{"joint": 2, "variable": "q2", "unit": "rad", "share": 0.6, "law": law, "grid": grid}]
    [found] = Diagnosis.from_dict(data).unnamed
    assert found.grid is not None
    assert (found.variable, found.grid.variable, found.grid.torque[0]) == ("q2", "dq1", (-1.75, 0.5, 0.25))
    assert Diagnosis.from_dict(data).to_dict() == data
    page, text = render_html(data), diagnosis_report(Diagnosis.from_dict(data), "x.md")
    assert all("position of joint 2 and speed of joint 1" in shown for shown in (page, text)), text[:3000]
    assert "1.75" in text
    chart = charts.dependence(data["unnamed"][0], "N m")
    [cells] = [r.data_source.data for r in chart.renderers]
    assert cells["torque"] == [-1.75, 0.5, 0.25, 0.5, 0.0, -0.5]
    # Cells meet halfway between the means, and reach as far beyond the outer ones.
    assert [*cells["left"][::3], cells["right"][-1]] == pytest.approx([-0.9, 0.1, 1.1])
    assert [*cells["bottom"][:3], cells["top"][2]] == pytest.approx([-4.5, -1.5, 1.0, 3.0])
