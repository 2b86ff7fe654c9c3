"""A diagnosis in a notebook: card, plots, table."""

from __future__ import annotations

import sys

import pytest

import report_cases as cases
from armgap import Diagnosis, Log
from armgap.errors import OptionError
from armgap.report.forms.notebook import PlotLibraryMissingError
from armgap.report.words import figure


@pytest.fixture
def axes():
    """A picture that is drawn and thrown away."""
    figure = pytest.importorskip("matplotlib.figure", reason="matplotlib is not installed").Figure()
    return figure.subplots()


def test_the_card_has_the_three_answers_and_no_markup_of_the_input() -> None:
    card = cases.named()._repr_html_()
    assert card.count("<dt") == 3
    assert "Stribeck friction" in card
    assert "script" not in card


@pytest.mark.parametrize("case", cases.CASES.values(), ids=cases.CASES)
@pytest.mark.parametrize("finding", ["gap", "where", "ranking", "prediction", "error"])
def test_every_finding_is_drawn(case, finding, axes) -> None:
    ax = case().plot(finding, ax=axes)
    assert ax is axes
    ax.figure.canvas.draw()
    assert ax.lines or ax.patches or ax.images or not case().extra["ranking"]


def test_a_cause_is_drawn_as_its_law_through_the_data(axes) -> None:
    diagnosis = cases.named()
    ax = diagnosis.plot(diagnosis.causes[0], ax=axes)
    ax.figure.canvas.draw()
    law = next(line for line in ax.lines if line.get_label() == "fitted law")
    assert list(law.get_ydata()) == diagnosis.to_dict()["laws"][0]["bins"]["law"]
    assert "dq1" in ax.get_xlabel()


def test_the_error_is_the_difference_of_the_curves(axes) -> None:
    series = cases.named().to_dict()["series"][0]
    cases.named().plot("error", ax=axes)
    after = axes.lines[-1].get_ydata()
    assert after[0] == pytest.approx(1e3 * (series["measured"][0] - series["after"][0]))


def test_what_does_not_exist_is_refused(axes) -> None:
    with pytest.raises(OptionError, match="no finding `speed`"):
        cases.named().plot("speed", ax=axes)
    with pytest.raises(OptionError, match="joint 7"):
        cases.named().plot("prediction", joint=7, ax=axes)
    with pytest.raises(OptionError, match="no evidence"):
        cases.none().plot(cases.named().causes[0], ax=axes)


def test_without_matplotlib_plots_say_what_to_install(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(PlotLibraryMissingError, match=r"pip install 'armgap\[notebook\]'"):
        cases.named().plot()
    assert cases.named().to_polars().height


@pytest.mark.parametrize("case", cases.CASES.values(), ids=cases.CASES)
def test_the_table_has_every_candidate_once(case) -> None:
    diagnosis: Diagnosis = case()
    table = diagnosis.to_polars()
    places = set(table.select("effect", "joint").iter_rows())
    expected = {(x.effect, x.joint) for x in (*diagnosis.causes, *diagnosis.ruled_out)}
    assert places == expected
    rows = sum(len(c.parameters) for c in diagnosis.causes) + len(diagnosis.ruled_out)
    assert table.height == rows
    named = table.filter(status="named")
    assert set(named["effect"]) == {c.effect for c in diagnosis.causes}
    assert named["value"].null_count() == 0


def test_an_arm_shows_its_conventions_and_parameters_and_no_markup_of_its_name() -> None:
    shown = cases.ARM._repr_html_()
    assert "<svg" in shown
    assert "gravity torque of the level link" in shown
    assert "0.600 ± 0.060 N m" in shown
    assert "<script" not in shown
    text = cases.ARM._repr_markdown_()
    assert "| theta2 | gravity torque of the level link | 0.600 ± 0.060 N m |" in text
    assert "\\<script" in text
    assert "hangs straight down" in text


def test_a_log_shows_its_columns_with_their_ranges() -> None:
    log = cases.swing(1, name=cases.HOSTILE)
    named = Log.from_frame(
        log.to_polars().rename({"q1": "<b>"}), columns={"q1": "<b>"}, arm=cases.ARM, name=cases.HOSTILE
    )
    shown, text = named._repr_html_(), named._repr_markdown_()
    assert f"{cases.SAMPLES} samples over 5.996 s, 250 Hz" in shown
    assert "&lt;b&gt;" in shown
    assert "<b>" not in shown
    assert "<script" not in shown
    assert "\\<script" in text
    assert f"| q1 | \\<b\\> | {figure(log.q.min())} to {figure(log.q.max())} | rad |" in text
