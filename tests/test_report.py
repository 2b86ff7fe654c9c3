"""Reports: what they say, in which form, and that nothing of the input becomes markup."""

from __future__ import annotations

import copy
import html
import json
import re

import numpy as np
import pytest
from bokeh.core.validation.check import check_integrity

import report_cases as cases
from armgap import Arm, Diagnosis, diagnose, simulate
from armgap.errors import OptionError
from armgap.report import check_report, diagnosis_document, diagnosis_report, render_html, summary_table
from armgap.report.advice import next_steps
from armgap.report.sections import SECTIONS
from armgap.report.sections.gap import first_picture
from armgap.report.sections.motion import _whole_run
from armgap.report.words import answers, figure, percent, title, value, variable_text, verdict
from armgap.simulation import Effect

LARGEST_REPORT = 5_000_000  # bytes
EVERY_CASE = pytest.mark.parametrize("case", cases.CASES.values(), ids=cases.CASES)


def texts(data: dict) -> str:
    return " ".join(f"{a.headline} {a.detail}" for a in answers(data))


@EVERY_CASE
def test_the_page_is_one_offline_file_with_the_three_answers(case) -> None:
    page = render_html(case())
    assert len(page.encode()) < LARGEST_REPORT
    assert not re.search(
        r"""(?:src|href|url)\s*[=(]\s*["']?(?:https?:)?//""", re.sub(r"<script.*?</script>", "", page, flags=re.S)
    )
    for answer in answers(case().to_dict()):
        assert html.escape(answer.question) in page
        assert answer.headline in html.unescape(page)


def test_six_joints_and_three_long_logs_stay_below_the_limit() -> None:
    data = copy.deepcopy(cases.named().to_dict())
    length, logs, joints = 2500, 3, 6  # what a diagnosis keeps of a log at most
    for key in ("series", "free_run_series"):
        first = data[key][0]
        stretched = {
            k: (v * length)[:length] if isinstance(v, list) and k != "window_start" else v for k, v in first.items()
        }
        data[key] = [stretched | {"log": f"log {i}", "joint": j + 1} for i in range(logs) for j in range(joints)]
    assert len(render_html(data).encode()) < LARGEST_REPORT


def test_a_free_run_that_runs_away_leaves_the_picture_not_the_scale() -> None:
    series = {"t": [0.0, 1.0, 2.0], "measured": [0.0, 1.0, 0.5], "before": [0.0, 2.0, 90.0], "after": [0.0, 1.0, None]}
    chart = _whole_run(series, "with the causes")
    assert (chart.y_range.start, chart.y_range.end) == (-1.0, 2.0)


@EVERY_CASE
def test_charts_lack_nothing_that_bokeh_looks_for(case) -> None:
    sections = diagnosis_document(case()).sections
    models = [model for s in sections for drawing in s.figures for model in drawing.chart.references()]
    assert models
    found = check_integrity(models)
    assert (found.error, found.warning) == ([], [])


@EVERY_CASE
def test_nothing_of_the_input_becomes_markup(case) -> None:
    data = case().to_dict()
    assert data["arm"]["name"] == data["holdout"][0]["name"] == cases.HOSTILE
    page = render_html(case())
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert" in page
    text = diagnosis_report(case(), "x.md")
    assert "<script>" not in text
    assert "\\<script\\>" in text
    assert case()._repr_html_().count("<script") == 0


def test_every_verdict_answers_in_its_own_words() -> None:
    data = {name: case().to_dict() for name, case in cases.CASES.items()}
    assert {name: d["verdict"] for name, d in data.items()} == {name: name for name in cases.CASES}
    assert "Stribeck friction (stiction), joint 1" in texts(data["effect"])
    assert "No cause" in texts(data["none"])
    assert "None that the library knows" in texts(data["unexplained"])
    assert len({verdict(d) for d in data.values()}) == len(data)


def test_a_serial_arm_without_a_cause_is_told_what_was_not_tested() -> None:
    """A diagnosis of a serial arm lists the effects that were not tested, once each."""
    data = copy.deepcopy(cases.unexplained().to_dict())
    data["arm"]["kind"] = "serial"
    untested = {"status": "undecided", "why": "not tested on serial arms from such logs"}
    data["ruled_out"] = [{"effect": "backlash", "joint": 1, "status": "absent", "why": None}]
    data["ruled_out"] += [{"effect": "external_pulse", "joint": j, **untested} for j in (1, 2)]
    [answer] = [a.detail for a in answers(data) if a.headline == "None that was tested"]
    assert answer.endswith(f"none explains the gap; not tested: {title('external_pulse')}.")
    data["ruled_out"] += [{"effect": "backlash", "joint": 2, **untested}]
    [answer] = [a.detail for a in answers(data) if a.headline == "None that was tested"]
    assert answer.endswith(f"not tested: {title('external_pulse')}, {title('backlash')}.")


def test_what_the_rest_depends_on_is_said_where_no_cause_is_named() -> None:
    data = copy.deepcopy(cases.unexplained().to_dict())
    data["unnamed"] = [{"joint": 1, "variable": "t"}, {"joint": 2, "variable": "dq1"}]
    depends = "What stays depends on time (joint 1), speed of joint 1 (joint 2)."
    assert any(a.detail.endswith(depends) for a in answers(data))
    data["verdict"] = "parameters"
    assert not any(depends in a.detail for a in answers(data))


def test_a_doubtful_cause_is_called_so() -> None:
    data = copy.deepcopy(cases.named().to_dict())
    data["causes"][0]["probability"] = 0.3
    assert "(doubtful)" in texts(data)
    assert "stays unexplained" in verdict(data)


def with_errors(before: float, after: float, closed: float, low: float, unexplained: float) -> dict:
    """The diagnosis with a cause, with errors in floors, shares, and the lower end of the interval of the share closed."""
    data = copy.deepcopy(cases.named().to_dict())
    floor = data["gap"]["floor"]
    errors = {
        "before": [before * f for f in floor],
        "refit": [before * f for f in floor],
        "after": [after * f for f in floor],
    }
    data["gap"] |= errors | {"closed": closed, "closed_ci": [low, max(closed, 0.0)], "unexplained": unexplained}
    return data


def test_a_large_rest_of_the_gap_is_said_first() -> None:
    assert "stays unexplained" in verdict(with_errors(100.0, 60.0, 0.4, 0.2, 0.6))
    assert any(
        "leave 60\N{NO-BREAK SPACE}% of the gap" in step for step in next_steps(with_errors(100.0, 60.0, 0.4, 0.2, 0.6))
    )
    for little in (with_errors(100.0, 10.0, 0.9, 0.8, 0.1), with_errors(3.0, 1.5, 0.75, 0.5, 0.25)):
        assert "unexplained" not in verdict(little)
        assert not any("of the gap of the re-estimated" in step for step in next_steps(little))


def test_a_gap_that_does_not_shrink_is_said_in_words() -> None:
    grown = answers(with_errors(100.0, 286.0, -1.86, -4.0, 1.0))[2]
    assert grown.headline == "The causes do not shrink the gap of the held-out motion"
    assert "closed: below -100\N{NO-BREAK SPACE}% to 0\N{NO-BREAK SPACE}%" in grown.detail
    nothing = answers(with_errors(1.2, 1.3, -0.5, -34225.45, 1.0))[2]
    assert nothing.headline == "The held-out motion shows no gap to close"
    assert "interval" not in nothing.detail


@EVERY_CASE
def test_the_floor_is_not_called_sensor_noise(case) -> None:
    assert "a perfect model would miss by" in texts(case().to_dict())
    for text in (diagnosis_report(case(), "gap.md"), diagnosis_report(case(), "gap.html")):
        assert "sensor noise" not in text


def test_an_axis_has_forces_in_newtons_and_errors_in_millimetres() -> None:
    arm = Arm("slide", "axis", 0.0, 0.004, np.array([2.0, 0.0, 3.0, 4.0]), sigma=np.array([0.2, 0.1, 1.0, 1.0]))
    t = np.arange(1000) * arm.sample_period
    hidden = Effect("stribeck", 1, {"amplitude": 5.0, "velocity": 0.1})
    logs = [
        simulate(arm, t, 25 * np.sin((3 + k) * t) + 10 * np.sin(11 * t + k), effects=[hidden], noise=1e-5)
        for k in (0, 1)
    ]
    diagnosis = diagnose(logs[0], arm, holdout=logs[1])
    text = diagnosis_report(diagnosis, "x.md")
    assert "force missing" in text
    assert "torque missing" not in text
    assert "\N{NO-BREAK SPACE}mm" in answers(diagnosis.to_dict())[2].detail


@pytest.mark.parametrize(
    ("number", "text"), [(136.2, "136"), (99.7, "100"), (1.36, "1.4"), (0.0136, "0.014"), (2.5e7, "2.5e+07")]
)
def test_numbers_are_written_out_unless_they_are_huge(number, text) -> None:
    assert figure(number, 2) == text


@EVERY_CASE
def test_sections_say_what_the_diagnosis_holds(case) -> None:
    data = case().to_dict()
    page = html.unescape(render_html(case()))
    for name, values in data["parameters"]["with_causes"].items():
        assert f"<td>{name}</td>" in page
        assert value(values) in page
    silent = {r["effect"] for r in data["ruled_out"] if r["status"] == "not excited"}
    assert bool(silent) == ("What these logs could not show" in page)
    assert f">All {len(data['ruled_out'])} candidates<" in page
    assert data["version"] in page
    assert str(data["options"]["seed"]) in page
    assert "the inertia matrix is positive definite" in page


def test_evidence_and_look_alikes_stand_in_the_report_of_a_cause() -> None:
    data = copy.deepcopy(cases.named().to_dict())
    assert "The evidence" in render_html(data)
    assert "What looks alike" not in render_html(data)
    data["causes"][0]["equivalents"] = [{"effect": "backlash", "joint": 1, "why": "both act at reversals"}]
    page = render_html(data)
    assert "What looks alike" in page
    assert "both act at reversals" in page


def test_values_that_do_not_exist_are_dashes() -> None:
    """JSON has no NaN: the core writes null."""
    data = copy.deepcopy(cases.named().to_dict())
    data["ranking"][0]["parameters"]["amplitude"] |= {"value": None, "sigma": None}
    data["parameters"]["refit"]["theta1"]["sigma"] = None
    for name in ("x.html", "x.md"):
        assert "–" in diagnosis_report(type(cases.named()).from_dict(data), name)


def test_an_older_diagnosis_without_what_was_added_since_still_has_a_report() -> None:
    """Only what the schema demands."""
    whole = cases.named().to_dict()
    needed = ("schema", "verdict", "gap", "where", "causes", "ruled_out", "parameters")
    least = {key: whole[key] for key in needed}
    assert len([s for s in SECTIONS if s(least) is not None]) >= 5
    assert "Stribeck" in render_html(least)


SIGN = {
    "check": "torque_sign",
    "joint": 1,
    "log": "run 1",
    "severity": "error",
    "message": "with tau1 counted the other way predictions over 0.25 s miss by 2 mrad, as it stands by 400 mrad",
    "remedies": ["--flip tau1", "--flip q1"],
    "remedy": "--flip tau1 or --flip q1",
    "rows": [],
}
SPIKE = SIGN | {
    "check": "spike",
    "severity": "warning",
    "message": f"one row jumps, says {cases.HOSTILE}",
    "remedies": [],
    "remedy": "",
    "rows": [[12, 12], [40, 44]],
}


def contradicted() -> dict:
    """A diagnosis whose input contradicts its arm file."""
    data = copy.deepcopy(cases.none().to_dict())
    return data | {"verdict": "input", "causes": [], "checks": [SPIKE, SIGN]}


def test_a_contradiction_of_the_input_comes_first_with_its_remedy() -> None:
    data = contradicted()
    assert (
        verdict(data)
        == "Logs and arm file contradict each other: torque sign of joint 1. Remedy: --flip tau1 or --flip q1"
    )
    first, which, far = answers(data)
    assert first.headline == "Torque sign of joint 1"
    assert "400 mrad" in first.detail
    assert which.headline == "None is named"
    assert far.headline == "With the remedy applied"
    page = html.unescape(render_html(data))
    assert (
        page.index("Checks of the input") < page.index("What contradicts what?") < page.index("Which effect causes it?")
    )
    assert page.count("<h2>Checks of the input</h2>") == 1
    assert page.index("<td>contradiction</td>") < page.index("<td>warning</td>"), "errors first"
    assert "rows 13, 41 to 45" in page
    assert "<code>--flip tau1</code> or <code>--flip q1</code>" in page
    text = diagnosis_report(Diagnosis.from_dict(data), "x.md")
    assert text.index("Checks of the input") < text.index("What contradicts what?")
    assert "`--flip tau1`" in text
    assert "<script>" not in text
    assert "Remedy: --flip tau1" in Diagnosis.from_dict(data).summary()


def test_a_contradiction_without_details_still_has_its_words() -> None:
    data = contradicted() | {"checks": []}
    assert verdict(data) == "Logs and arm file contradict each other."
    assert "Checks of the input" not in render_html(data)
    assert next_steps(data)


def test_repairs_and_warnings_stand_beside_any_verdict() -> None:
    data = copy.deepcopy(cases.named().to_dict())
    assert "Checks of the input" not in render_html(data)
    data["checks"] = [SPIKE, SPIKE | {"severity": "repaired", "check": "wrapped_positions"}]
    page = render_html(data)
    assert page.index("Where is the gap?") < page.index("<h2>Checks of the input")
    assert page.index("<td>repaired</td>") < page.index("<td>warning</td>")
    assert "wrapped positions" in page


def test_candidates_stand_below_the_causes_with_their_reason() -> None:
    data = copy.deepcopy(cases.named().to_dict())
    assert "not fit for the headline" not in render_html(data)
    data["candidates"] = [
        data["causes"][0] | {"effect": "torque_gain", "probability": 0.1, "why": "no arm has a gain of 20"}
    ]
    page = render_html(data)
    assert page.index("Ranking of causes</h2>") < page.index("Candidates not fit for the headline</h2>")
    assert "no arm has a gain of 20" in page
    assert "no arm has a gain of 20" in diagnosis_report(Diagnosis.from_dict(data), "x.md")


def test_the_place_of_the_gap_is_given_in_the_joints_own_range() -> None:
    data = copy.deepcopy(cases.named().to_dict())
    data["regimes"][0] |= {"variable": "abs(dq1)", "unit": "rad/s", "edges": [0.0, 0.021, 0.532, 4.06]}
    data["where"][0] |= {
        "regime": "medium speed",
        "detail": "abs(dq1) from 0.021 to 0.532 rad/s",
        "range": {"variable": "abs(dq1)", "from": 0.021, "to": 0.532},
    }
    assert answers(data)[0].headline == "Joint 1, at medium speed: 0.021 to 0.53 of at most 4.1 rad/s"
    data["regimes"] = []
    assert answers(data)[0].headline == "Joint 1, at medium speed: 0.021 to 0.53 rad/s"


def test_every_range_of_the_map_has_its_limits() -> None:
    data = cases.named().to_dict()
    [heat] = first_picture(data).heats
    ranged = {label: tiles for label, tiles in heat.rows if "reversal" not in label}
    assert all(re.search(r"\[(rad/s|rad|N\sm|s)\]$", label) for label in ranged)
    for r in data["regimes"]:
        if not r["variable"].startswith("reversal"):
            [tiles] = [
                t
                for label, t in ranged.items()
                if label.startswith(f"joint {r['joint']}: {variable_text(r['variable'])} ")
            ]
            limits = [float(t.low) for t in tiles] + [float(tiles[-1].high)]
            largest = max(map(abs, r["edges"]))
            assert limits == pytest.approx(r["edges"], rel=0.05, abs=1e-4 * largest)
            assert [t.high for t in tiles[:-1]] == [t.low for t in tiles[1:]]


def test_logarithmic_bars_run_over_whole_decades_and_say_so() -> None:
    chart = first_picture(cases.named().to_dict()).figures[0].chart
    assert "log scale" in chart.yaxis[0].axis_label
    for end in (chart.y_range.start, chart.y_range.end):
        assert np.log10(end) == pytest.approx(round(np.log10(end)))
    ticks = chart.yaxis[0].ticker
    assert len(ticks.ticks) >= 2
    assert len(ticks.minor_ticks) == 8 * (len(ticks.ticks) - 1)
    labels = chart.yaxis[0].major_label_overrides
    assert sorted(float(text) for text in labels.values()) == pytest.approx(ticks.ticks)


@EVERY_CASE
def test_every_report_ends_with_what_to_do_next(case) -> None:
    steps = next_steps(case().to_dict())
    assert steps
    assert diagnosis_document(case()).sections[-1].points == steps
    assert "What to do next" in diagnosis_report(case(), "x.md")


def test_what_to_do_next_follows_from_the_verdict_and_the_result() -> None:
    effect, none, unexplained = (copy.deepcopy(case().to_dict()) for case in cases.CASES.values())
    assert "armgap export" in " ".join(next_steps(effect))
    assert "do not tell" not in " ".join(next_steps(effect))
    effect["causes"][0]["equivalents"] = [{"effect": "backlash", "joint": 1, "why": "both act at reversals"}]
    assert "do not tell Stribeck friction (stiction), joint 1, from backlash" in next_steps(effect)[0]
    effect["gap"] |= {"unexplained": 0.5, "after": [9.0 * f for f in effect["gap"]["floor"]]}
    assert "leave 50\N{NO-BREAK SPACE}% of the gap" in next_steps(effect)[-1]
    assert "keep the arm file" in next_steps(none)[0]
    none["ruled_out"][0] |= {"effect": "backlash", "status": "not excited"}
    assert "acklash" in next_steps(none)[-1]
    assert "armgap export" in next_steps(none | {"verdict": "parameters"})[0]
    assert "effects=[...]" in " ".join(next_steps(unexplained))
    assert "`--flip tau1` or `--flip q1`" in next_steps(contradicted())[0]
    none["plausibility"][0] |= {"holds": False}
    assert next_steps(none)[0].startswith("First find out why")


def test_a_gap_that_stays_asks_for_the_measured_torque_or_for_its_use() -> None:
    data = cases.named().to_dict() | {"verdict": "unexplained"}
    assert "in columns `tau_meas1`" in " ".join(next_steps(data | {"chain": []}))
    measured = " ".join(next_steps(data | {"chain": [{"stage": "drive", "joint": 1, "share": 0.2}]}))
    assert "--columns tau1=tau_meas1" in measured
    assert "Log more" not in measured
    serial = data | {"chain": [], "arm": {**data["arm"], "kind": "serial"}}
    assert "in place of the command" in " ".join(next_steps(serial))


def test_an_impossible_arm_is_pointed_out() -> None:
    data = copy.deepcopy(cases.named().to_dict())
    data["plausibility"][0] |= {"holds": False}
    assert "does NOT hold" in render_html(data)
    assert "Not physically possible" in render_html(data)


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.5, "50 %"),
        (0.994, "99.4 %"),
        (0.9988, "99.88 %"),
        (0.99999, "99.99 %"),
        (1.0, "100 %"),
        (-0.001, "0 %"),
        (-0.12, "-12 %"),
    ],
)
def test_a_share_is_never_rounded_up_to_all(share, text) -> None:
    assert percent(share).replace("\N{NO-BREAK SPACE}", " ") == text


@pytest.mark.parametrize(
    ("number", "sigma", "text"),
    [
        (0.901089, 5.9e-5, "0.901089 ± 0.000059 N m"),
        (2.0, 0.1, "2.00 ± 0.10 N m"),
        (1234.5, 30.0, "1234 ± 30 N m"),
        (1.5e-9, 2e-10, "1.5e-09 ± 2e-10 N m"),
        (3.0, None, "3 N m"),
        (3.0, 0.0, "3 N m"),
        (None, None, "– N m"),
    ],
)
def test_a_value_and_its_uncertainty_end_at_the_same_place(number, sigma, text) -> None:
    assert value({"value": number, "sigma": sigma, "unit": "N m"}) == text


def test_markdown_has_tables_that_hold_together() -> None:
    text = diagnosis_report(cases.named(), "x.md")
    rows = [re.sub(r"\\\|", "", line).count("|") for line in text.splitlines() if line.startswith("|")]
    heads = [i for i, line in enumerate(text.splitlines()) if re.fullmatch(r"\|( --- \|)+", line)]
    lines = text.splitlines()
    assert len(heads) >= 6
    for i in heads:
        width = lines[i].count("|")
        assert re.sub(r"\\\|", "", lines[i - 1]).count("|") == width
        for line in lines[i + 1 :]:
            if not line.startswith("|"):
                break
            assert re.sub(r"\\\|", "", line).count("|") == width, line
    assert rows
    assert "█" in text
    assert text.count("<details>") == text.count("</details>")


def test_the_extension_decides() -> None:
    assert diagnosis_report(cases.none(), "a.HTML").lower().startswith("<!doctype html>")
    assert diagnosis_report(cases.none(), "-").lower().startswith("<!doctype html>")
    assert json.loads(diagnosis_report(cases.none(), "a.json")) == cases.none().to_dict()
    check_report(None)


@pytest.mark.parametrize("name", ["report.pdf", "report", "report.html.bak"])
def test_an_unknown_extension_ends_before_any_work(run, tmp_path, name) -> None:
    target = tmp_path / name
    status, out, err = run("diagnose", tmp_path / "none.csv", "--arm", tmp_path / "none.toml", "--report", target)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert ".html, .md or .json" in err
    assert str(target) in err
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(OptionError):
        check_report(target)


@EVERY_CASE
@pytest.mark.parametrize("width", [60, 80, 140])
def test_the_summary_fits_the_terminal(case, width) -> None:
    from io import StringIO

    from rich.console import Console

    out = StringIO()
    Console(file=out, width=width, no_color=True).print(summary_table(case()))
    lines = [line.rstrip() for line in out.getvalue().splitlines()]
    assert max(map(len, lines)) <= width
    assert not any("…" in line for line in lines)
    joined = " ".join(" ".join(lines).split())
    for answer in answers(case().to_dict()):
        assert answer.question in joined
        assert " ".join(answer.headline.split()) in joined


def test_a_document_is_the_same_from_a_result_and_from_its_json() -> None:
    data = json.loads(cases.named().to_json())
    first, second = diagnosis_document(cases.named()), diagnosis_document(data)
    assert first.answers == second.answers
    assert [s.title for s in first.sections] == [s.title for s in second.sections]
