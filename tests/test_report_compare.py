"""`armgap compare`: gap, causes and parameters of two diagnoses, as before and after a repair."""

from __future__ import annotations

import copy
import json

import pytest

import report_cases as cases
from armgap import Diagnosis
from armgap.diagnosis.comparison import compare, read_diagnosis
from armgap.errors import OptionError
from armgap.report import render_report
from armgap.report.compared import answers, comparison_document, lead


def changed(diagnosis: Diagnosis, change) -> Diagnosis:
    data = copy.deepcopy(diagnosis.to_dict())
    change(data)
    return Diagnosis.from_dict(data)


@pytest.fixture
def files(tmp_path):
    for name, case in (("worn", cases.named), ("repaired", cases.none)):
        (tmp_path / f"{name}.json").write_text(case().to_json())
    return tmp_path / "worn.json", tmp_path / "repaired.json"


def test_a_repair_closes_the_gap_and_its_cause_is_gone() -> None:
    """The arm with Stribeck friction, and the same arm without."""
    result = compare(cases.named(), cases.none())
    assert result.outcome == "smaller"
    [cause] = result.causes
    assert (cause.effect, cause.joint, cause.status) == ("stribeck", 1, "gone")
    assert "amplitude now within" in cause.why
    assert cause.after is None
    assert result.gap[0].factor < 0.1
    assert not any(p.changed for p in result.parameters if p.name in ("theta1", "theta2"))


def test_the_other_way_round_a_cause_is_new_and_the_gap_grows() -> None:
    result = compare(cases.none(), cases.named())
    assert result.outcome == "larger"
    assert [(c.effect, c.status, c.why) for c in result.causes] == [("stribeck", "new", "absent before")]


def test_a_diagnosis_has_not_changed_against_itself() -> None:
    result = compare(cases.named(), cases.named())
    assert result.outcome == "unchanged"
    assert [c.status for c in result.causes] == ["unchanged"]
    assert not any(p.changed for p in result.parameters)
    assert result.gap[0].factor == 1.0


def test_noise_above_the_floor_of_healthy_arms_is_no_gap() -> None:
    """Two diagnoses with verdict `none`, whose errors lie a little and a little more above their floors."""

    def noisy(by: float) -> Diagnosis:
        def errors(data: dict) -> None:
            for model in ("before", "refit", "after"):
                data["gap"][model] = [by * f for f in data["gap"]["floor"]]

        return changed(cases.none(), errors)

    result = compare(noisy(1.2), noisy(1.5))
    assert result.outcome == "none"
    assert [gap.factor for gap in result.gap] == [None] * 3
    assert lead(result) == "There is no gap, neither before nor after."
    assert "within what a perfect model would miss by" in answers(result)[1].detail
    # Nor is what named causes leave within the floor; what they leave beyond is.
    worn = changed(cases.named(), lambda data: data["gap"].update(after=[1.5 * f for f in data["gap"]["floor"]]))
    assert compare(worn, worn).gap[2].factor is None
    poor = changed(cases.named(), lambda data: data["gap"].update(after=[9.0 * f for f in data["gap"]["floor"]]))
    assert compare(worn, poor).gap[2].factor is None
    assert compare(poor, worn).gap[2].factor == 0.0
    assert compare(poor, poor).gap[2].factor == 1.0


def test_a_cause_that_the_later_log_could_not_show_is_not_called_gone() -> None:
    def unexcited(data: dict) -> None:
        entry = next(r for r in data["ruled_out"] if r["effect"] == "stribeck")
        entry |= {"status": "not excited", "bound": None, "why": "it never moved slowly"}

    [cause] = compare(cases.named(), changed(cases.none(), unexcited)).causes
    assert (cause.status, cause.why) == ("unseen", "it never moved slowly")


def test_a_look_alike_named_later_is_the_same_cause_under_another_name() -> None:
    def alike(data: dict) -> None:
        data["causes"][0]["equivalents"] = [{"effect": "backlash", "joint": 1, "why": "both act at reversals"}]

    def other(data: dict) -> None:
        data["causes"][0]["effect"] = "backlash"

    result = compare(changed(cases.named(), alike), changed(cases.named(), other))
    assert [(c.effect, c.status) for c in result.causes] == [("stribeck", "renamed"), ("backlash", "new")]


def test_what_went_and_what_came_is_said_first() -> None:
    """Also where the gap of the arm file stays about what it was, because other values of it are wrong."""

    def as_before(data: dict) -> None:
        data["gap"]["before"] = list(cases.named().to_dict()["gap"]["before"])
        data["verdict"] = "parameters"

    cured = compare(cases.named(), changed(cases.none(), as_before))
    assert cured.outcome == "unchanged"
    assert lead(cured).startswith("Gone: Stribeck friction (stiction), joint 1. The gap")
    assert answers(cured)[0].headline == "Stribeck friction (stiction), joint 1: gone"
    came = compare(cases.none(), cases.named())
    assert lead(came).startswith("New: Stribeck friction (stiction), joint 1. ")
    assert lead(compare(cases.named(), cases.named())).startswith("The gap")


def test_the_report_of_a_comparison_has_the_conventions_of_its_arm() -> None:
    result = compare(cases.named(), cases.none())
    assert result.kind == "pendulum"
    assert any(s.name == "conventions" for s in comparison_document(result).sections)


def test_every_push_of_a_log_is_kept() -> None:
    def pushed(data: dict) -> None:
        push = data["causes"][0] | {"effect": "external_pulse", "log": "run"}
        data["causes"] = [copy.deepcopy(push) for _ in range(3)]
        # What is named is not ruled out.
        data["ruled_out"] = [r for r in data["ruled_out"] if r["effect"] != "external_pulse"]

    def once(data: dict) -> None:
        pushed(data)
        del data["causes"][1:]

    result = compare(changed(cases.named(), pushed), changed(cases.named(), once))
    assert [c.status for c in result.causes] == ["unchanged", "undecided", "undecided"]


@pytest.mark.parametrize(("factor", "status"), [(0.5, "smaller"), (2.0, "larger"), (1.001, "unchanged")])
def test_sizes_are_compared_against_their_uncertainty(factor, status) -> None:
    def resized(data: dict) -> None:
        data["causes"][0]["parameters"]["amplitude"]["value"] *= factor

    assert [c.status for c in compare(cases.named(), changed(cases.named(), resized)).causes] == [status]


def test_a_parameter_counts_as_changed_beyond_its_uncertainty_and_by_an_amount_that_matters() -> None:
    def moved(share: float):
        def change(data: dict) -> None:
            theta = data["parameters"]["with_causes"]["theta1"]
            theta |= {"value": theta["value"] * (1 + share), "sigma": theta["value"] * 1e-4}

        return change

    precise = changed(cases.named(), moved(0.0))

    def names(share: float) -> list[str]:
        result = compare(precise, changed(cases.named(), moved(share)))
        return [p.name for p in result.parameters if p.changed]

    assert names(0.01) == []
    assert names(0.10) == ["theta1"]


def test_nothing_before_and_nothing_after() -> None:
    def at_the_floor(data: dict) -> None:
        data["gap"]["before"] = list(data["gap"]["floor"])

    quiet = changed(cases.none(), at_the_floor)
    assert compare(quiet, quiet).outcome == "none"
    assert compare(quiet, cases.named()).outcome == "larger"


def test_the_command_reports_in_every_form(run, files, tmp_path) -> None:
    for form in ("html", "md", "json"):
        status, out, err = run("compare", *files, "--report", tmp_path / f"out.{form}")
        assert (status, err) == (0, "")
    text = " ".join(out.split())
    for answer in answers(compare(*map(read_diagnosis, files), names=("worn", "repaired"))):
        assert " ".join(answer.headline.split()) in text
    assert "worn" in (tmp_path / "out.md").read_text()
    assert "<canvas" not in (tmp_path / "out.md").read_text()
    assert json.loads((tmp_path / "out.json").read_text())["schema"] == "armgap.diagnosis.comparison/1"
    assert (tmp_path / "out.html").read_text().startswith("<!DOCTYPE html>")


def test_hostile_names_stay_text() -> None:
    result = compare(cases.named(), cases.none(), (f"a {cases.HOSTILE}", f"b {cases.HOSTILE}"))
    for name in ("x.html", "x.md"):
        text = render_report(comparison_document(result), result.to_dict(), name)
        assert "<script>alert" not in text


def test_json_goes_to_standard_output_alone(run, files) -> None:
    status, out, err = run("compare", *files, "--json", "-")
    assert (status, err) == (0, "")
    assert json.loads(out)["outcome"] == "smaller"
    assert run("compare", *files, "--quiet") == (0, "", "")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "cannot be read"),
        ("{", "is not JSON"),
        ("\x00\xff", "is not JSON"),
        ("[]", "schema"),
        ('{"schema": "armgap.trial/1"}', "schema"),
        ('{"schema": "armgap.diagnosis/1"}', "'gap' is missing"),
        (json.dumps(cases.none().to_dict() | {"gap": 3}), "another form"),
    ],
)
def test_what_is_no_diagnosis_is_refused_in_one_line(run, files, tmp_path, text, says) -> None:
    bad = tmp_path / "bad.json"
    if text is not None:
        bad.write_text(text, encoding="latin-1")
    status, out, err = run("compare", files[0], bad, "--report", tmp_path / "out.html")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert says in err
    assert str(bad) in err
    assert not (tmp_path / "out.html").exists()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda d: d["arm"].update(kind="axis"), "different arms"),
        (lambda d: d["gap"].update(horizon_s=0.5), "different horizons"),
    ],
)
def test_what_cannot_be_compared_is_refused(change, says) -> None:
    with pytest.raises(OptionError, match=says):
        compare(cases.named(), changed(cases.none(), change))


def test_other_arm_files_are_noted() -> None:
    def nominal(data: dict) -> None:
        data["parameters"]["nominal"]["theta1"]["value"] *= 1.1

    assert "arm files differ" in compare(cases.named(), changed(cases.none(), nominal)).notes[0]
    assert "arm files differ" not in compare(cases.named(), cases.none()).notes[0]
