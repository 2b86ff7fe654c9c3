"""Conventions: what reports and documents say of zero, signs and gravity is what the simulator does."""

from __future__ import annotations

import copy
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import report_cases as cases
from armgap import Arm, Log, diagnose, simulate
from armgap.arm import kinds
from armgap.report import diagnosis_report, render_html
from armgap.report.conventions import WORDS, brief, section
from armgap.report.sketch import KINDS, panel, sheet

ROOT = Path(__file__).resolve().parents[1]
T = np.arange(50) * 0.002
#: Inertial parameters, then viscous and Coulomb coefficients; of the two links those of Reyes and Kelly's arm.
THETA = {
    "axis": [2.0, 5.0, 0.0, 0.0],
    "pendulum": [0.05, 0.6, 0.0, 0.0],
    "two-link": [2.351, 0.084, 0.102, 38.465, 1.825, 0.0, 0.0, 0.0, 0.0],
}


def moved(kind: str, q0: list[float], tau: list[float], coulomb: list[float] | None = None) -> np.ndarray:
    """How far each joint comes in a tenth of a second from rest [rad or m]."""
    theta = np.array(THETA[kind])
    if coulomb is not None:
        theta[-len(coulomb) :] = coulomb
    arm = Arm("arm", kind, 9.81, 0.002, theta, 0.1 * np.abs(theta) + 0.01)
    log = simulate(arm, T, np.tile(tau, (len(T), 1)), q0=q0)
    return log.q[-1] - log.q[0]


def test_every_kind_has_words_and_a_sketch() -> None:
    assert set(kinds()) == set(WORDS) == set(KINDS)
    assert all(brief(kind) for kind in WORDS)
    assert (brief("six-axis"), section("six-axis")) == ("", None)


@pytest.mark.parametrize("kind", ["pendulum", "two-link"])
def test_at_zero_the_arm_hangs_and_gravity_pulls_it_back_there(kind) -> None:
    n = kinds()[kind]["n_joints"]
    assert moved(kind, [0.0] * n, [0.0] * n) == pytest.approx(0.0, abs=1e-12)
    aside = moved(kind, [0.5, *[0.0] * (n - 1)], [0.0] * n)
    assert aside[0] < -1e-3
    assert moved(kind, [-0.5, *[0.0] * (n - 1)], [0.0] * n) == pytest.approx(-aside)


def test_weight_along_an_axis_pulls_towards_smaller_positions() -> None:
    assert moved("axis", [0.3], [0.0])[0] < -1e-3
    assert moved("axis", [0.3], [5.0])[0] == pytest.approx(0.0, abs=1e-9), "theta2 is the force that holds it"


@pytest.mark.parametrize(("kind", "joint"), [("axis", 0), ("pendulum", 0), ("two-link", 0), ("two-link", 1)])
def test_positive_torque_turns_its_joint_positively(kind, joint) -> None:
    n = kinds()[kind]["n_joints"]
    weight = 5.0 if kind == "axis" else 0.0
    for sign in (1.0, -1.0):
        tau = [weight] * n if kind == "axis" else [0.0] * n
        tau[joint] += sign
        assert sign * moved(kind, [0.0] * n, tau)[joint] > 1e-4


def test_holding_takes_the_torque_that_is_said() -> None:
    q1, q2 = 0.7, 0.9
    assert moved("pendulum", [q1], [0.6 * np.sin(q1)])[0] == pytest.approx(0.0, abs=1e-9)
    outer = 1.825 * np.sin(q1 + q2)
    still = moved("two-link", [q1, q2], [38.465 * np.sin(q1) + outer, outer])
    assert still == pytest.approx(0.0, abs=1e-9)


def test_the_elbow_angle_is_relative_to_link_1() -> None:
    """Link 1 is held level by friction: link 2 rests where it hangs, at -90 degrees of the elbow, and falls from where the arm is straight."""
    held = [1e3, 0.0]
    assert moved("two-link", [np.pi / 2, -np.pi / 2], [0.0, 0.0], held) == pytest.approx(0.0, abs=1e-9)
    assert moved("two-link", [np.pi / 2, 0.0], [0.0, 0.0], held)[1] < -1e-2


def test_the_file_of_the_documents_is_the_drawing_of_the_program() -> None:
    assert (ROOT / "docs" / "conventions.svg").read_text(encoding="utf-8") == sheet(), "run tools/conventions.py"


@pytest.mark.parametrize("svg", [sheet(), *map(panel, KINDS)], ids=["sheet", *KINDS])
def test_a_sketch_is_well_formed_and_follows_light_and_dark(svg) -> None:
    root = ET.fromstring(svg)
    assert root.tag.endswith("svg")
    inside = svg.partition("</style>")[2] or svg
    assert not re.search(r"#[0-9a-fA-F]{3,6}|<script|https?://(?!www.w3.org)", inside), "colours come from the page"
    assert "currentColor" in inside


def test_what_is_drawn_lies_inside_of_its_panel() -> None:
    for kind in KINDS:
        root = ET.fromstring(panel(kind))
        _, _, width, height = map(float, root.attrib["viewBox"].split())
        for node in root.iter():
            for x, y in ((a, b) for a, b in (("x", "y"), ("x1", "y1"), ("x2", "y2"), ("cx", "cy")) if a in node.attrib):
                assert 0 <= float(node.attrib[x]) <= width
                assert 0 <= float(node.attrib[y]) <= height


@pytest.mark.parametrize("document", ["README.md", "docs/tutorial.md", "docs/formats.md", "docs/index.md"])
def test_the_first_documents_show_the_sketch_and_name_the_sign_of_the_torque(document) -> None:
    text = (ROOT / document).read_text()
    assert "conventions.svg)" in text
    assert "ositive torque turns" in " ".join(text.split())


@pytest.mark.slow
def test_a_report_shows_the_kind_in_use_near_its_top() -> None:
    page = render_html(cases.named())
    assert panel("pendulum") in page
    assert panel("two-link") not in page
    assert page.index(brief("pendulum")) < page.index("Where is the gap?")
    assert page.index('id="conventions"') < page.index("<h2>The evidence")
    assert "hangs straight down" in diagnosis_report(cases.named(), "x.md")


def test_columns_and_units_in_use_are_said() -> None:
    arm = cases.ARM
    names = {"t": "stamp [ms]", "q1": "shoulder <b>", "tau1": "cmd"}
    logs = []
    for seed in (1, 2):
        log = cases.swing(seed)
        table = {"stamp [ms]": 1e3 * log.t, "shoulder <b>": np.degrees(log.q[:, 0]), "cmd": 1e3 * log.tau[:, 0]}
        logs.append(
            Log.from_frame(
                pl.DataFrame(table), name=f"run {seed}", columns=names, arm=arm, units={"q": "deg", "tau": "mNm"}
            )
        )
    assert logs[0].units == {"t": "ms", "q1": "deg", "tau1": "mNm"}
    assert logs[0].part(0, 100, "part").units == logs[0].units
    data = diagnose(logs[0], arm, holdout=logs[1], max_causes=1).to_dict()
    given = data["input"]
    assert given["units"] == {"t": "s", "q": "rad", "dq": "rad/s", "tau": "N m"}
    assert [(x["name"], x["set"], x["rows"], x["file"]) for x in given["logs"]] == [
        ("run 1", "training", len(logs[0]), None),
        ("run 2", "holdout", len(logs[1]), None),
    ]
    assert given["logs"][0]["columns"] == names
    [table] = section("pendulum", given["logs"], given["units"]).tables
    assert table.header[2] == "in run 1, run 2"
    assert ("q1", "position of joint 1", "shoulder <b>", "deg", "rad, times 0.01745") in table.rows
    assert ("t", "time", "stamp [ms]", "ms", "s, times 0.001") in table.rows
    assert "shoulder <b>" not in render_html(data)


def test_units_of_a_file_that_nobody_declared() -> None:
    log = Log.from_arrays(T, np.sin(9 * T), np.cos(9 * T))
    assert log.units == {"t": "s", "q1": "rad or m", "tau1": "Nm or N"}
    stamps = pl.DataFrame({"t": pl.Series(range(50)) * 4_000_000, "q1": np.sin(9 * T), "tau1": np.cos(9 * T)})
    assert Log.from_frame(stamps, arm=cases.ARM).units == {"t": "ns", "q1": "rad", "tau1": "Nm"}


def test_logs_with_other_columns_have_a_table_of_their_own() -> None:
    data = copy.deepcopy(cases.named().to_dict())
    own = {"t": "t", "q1": "q1", "tau1": "tau1"}
    units = {"t": "s", "q1": "rad", "tau1": "Nm"}
    logs = [{"name": n, "columns": own | c, "units": units} for n, c in (("a", {}), ("b", {"q1": "x"}), ("c", {}))]
    data["input"] = {"logs": logs, "units": {}}
    heads = [t.header[2] for t in section("pendulum", logs, {}).tables]
    assert heads == ["in a, c", "in b"]
