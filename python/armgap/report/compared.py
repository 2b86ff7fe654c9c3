"""Report of a comparison of two diagnoses: changes of the gap, the causes and the parameters."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

from armgap.diagnosis.comparison import SHARE, SIGMAS, CauseChange, Comparison
from armgap.diagnosis.result import Value
from armgap.literals import SERIAL
from armgap.report import charts
from armgap.report.conventions import brief, section
from armgap.report.document import Document
from armgap.report.page import Bar, Cell, Drawing, Section, Table
from armgap.report.words import (
    SummaryAnswer,
    each_joint,
    error_text,
    figure,
    milli_unit,
    percent,
    sizes,
    title,
    value,
)
from armgap.several_joints import place_text

if TYPE_CHECKING:
    from rich.console import RenderableType

__all__ = ["comparison_document", "comparison_summary", "lead"]

_MODELS = {"before": "arm file", "refit": "re-estimated", "after": "with causes"}
_COLOURS = (charts.BEFORE, charts.AFTER)
_LEADS = {
    "smaller": "The gap between the arm and its model has shrunk.",
    "larger": "The gap between the arm and its model has grown.",
    "unchanged": "The gap between the arm and its model is about what it was.",
    "none": "There is no gap, neither before nor after.",
}
#: Statuses of causes in the order of the report: causes that are gone or new first.
_ORDER = ("gone", "new", "renamed", "smaller", "larger", "unchanged", "undecided", "unseen")


def comparison_document(c: Comparison) -> Document:
    """Return the report of a comparison as a document."""
    heading = f"Compared: {c.names[0]} and {c.names[1]}"
    conventions = section(c.kind)
    sections = [_gap(c), _causes(c), _parameters(c), *([conventions] if conventions else []), _method(c)]
    return Document(heading, lead(c), answers(c), sections, brief(c.kind))


def lead(c: Comparison) -> str:
    """Return sentences on the causes that are gone, the causes that are new, and the change of the gap."""
    return " ".join([*_went_and_came(c), _LEADS[c.outcome]])


def _went_and_came(c: Comparison) -> list[str]:
    named = {status: [_name(x) for x in _by_status(c) if x.status == status] for status in ("gone", "new")}
    said = {"gone": "Gone", "new": "New"}
    return [f"{said[status]}: {'; '.join(names)}." for status, names in named.items() if names]


def _by_status(c: Comparison) -> list[CauseChange]:
    return sorted(c.causes, key=lambda x: _ORDER.index(x.status))


def answers(c: Comparison) -> list[SummaryAnswer]:
    """Return three answers about two diagnoses: status of each cause, change of the gap, and changed parameters of the arm."""
    return [
        SummaryAnswer("What became of the causes?", *_became(c)),
        SummaryAnswer("Did the gap shrink?", *_shrunk(c)),
        SummaryAnswer("Did the arm's own values change?", *_moved(c)),
    ]


def _shrunk(c: Comparison) -> tuple[str, str]:
    gap = c.gap[0]
    factor = "" if gap.factor is None else f" Above the noise floor it is {_times(gap.factor)}."
    if c.outcome == "none":
        factor = " Both are within what a perfect model would miss by."
    elif gap.factor == 0.0:
        factor = " What is left is within what a perfect model would miss by."
    return (
        each_joint(gap.before, gap.after, units=c.joint_units),
        f"RMS error of the arm file as it is, predicted over {c.horizon_s:g} s on held-out motion.{factor}",
    )


def _times(factor: float) -> str:
    text = figure(factor, 2)
    return "what it was" if text == "1" else f"{text} times what it was"


def _became(c: Comparison) -> tuple[str, str]:
    if not c.causes:
        return "None was named, before or after", ""
    found = _by_status(c)
    headline = "; ".join(f"{_name(x)}: {x.status}" for x in found)
    return headline[:1].upper() + headline[1:], " ".join(f"{_name(x)}: {x.why}." for x in found)


def _moved(c: Comparison) -> tuple[str, str]:
    changed = [p for p in c.parameters if p.changed]
    if not changed:
        return "No", "No parameter moved beyond its uncertainty by an amount that matters."
    text = ", ".join(f"{p.name} {figure(p.before.value)} → {figure(p.after.value)} {p.after.unit}" for p in changed)
    return f"Yes: {', '.join(p.name for p in changed)}", f"{text}."


def _name(cause: CauseChange) -> str:
    return f"{title(cause.effect)}, {place_text(vars(cause))}"


def _gap(c: Comparison) -> Section:
    joints = [f"joint {j + 1}" for j in range(len(c.gap[0].before))]
    drawn = [_bars(c, i, joints) for i in (0, 2)]
    return Section("", figures=drawn)


def _bars(c: Comparison, i: int, joints: list[str]) -> Drawing:
    gap = c.gap[i]
    pair = list(zip(c.names, (gap.before, gap.after), _COLOURS, strict=True))
    series = [(name, [1e3 * v for v in values], colour) for name, values, colour in pair]
    caption = f"{_MODELS[gap.model].capitalize()}: RMS prediction error over {c.horizon_s:g} s [{milli_unit(c.joint_units)}, log scale]"
    top = max((*gap.before, *gap.after), default=0.0) or 1.0
    rows: list[tuple[Cell, ...]] = [
        (joint, name, Bar(values[j] / top, error_text(1e3 * values[j]), colour))
        for j, joint in enumerate(joints)
        for name, values, colour in pair
    ]
    table = Table(("joint", "diagnosis", caption.replace(", log scale", "")), rows)
    return Drawing(
        caption, charts.bars("", f"{milli_unit(c.joint_units)}, log scale", joints, series, log=True, height=260), table
    )


def _causes(c: Comparison) -> Section:
    rows = [(_name(x), x.status, _sizes(x.before), _sizes(x.after), x.why) for x in _by_status(c)]
    text = (
        "Gone: looked for and found absent. Unseen: the later log could not have shown it. Undecided: it leaves a trace, but not on held-out motion. "
        "Renamed: a look-alike is named instead."
    )
    header = ("cause", "status", *c.names, "because")
    return Section(
        "Causes",
        text=[text] if rows else ["Neither diagnosis names a cause."],
        tables=[Table(header, rows)] if rows else [],
    )


def _sizes(parameters: dict[str, Value] | None) -> str:
    return sizes({name: asdict(p) for name, p in (parameters or {}).items()})


def _parameters(c: Comparison) -> Section:
    rows = [
        (
            p.name,
            value(asdict(p.before)),
            value(asdict(p.after)),
            "" if p.sigmas is None else f"{p.sigmas:+.2g}",
            "changed" if p.changed else "",
        )
        for p in c.parameters
    ]
    text = (
        f"Re-estimated together with the causes. A value counts as changed if it moved by more than {SIGMAS:g} standard deviations of the "
        f"difference and by more than {percent(SHARE)}."
    )
    fold = f"All {len(rows)} values" if c.kind == SERIAL else ""
    return Section(
        "The arm's own values",
        text=[text],
        tables=[Table(("parameter", *c.names, "change [sigma]", ""), rows, fold=fold)],
    )


def _method(c: Comparison) -> Section:
    rows = [(c.names[0], c.verdict_before), (c.names[1], c.verdict_after)]
    return Section(
        "About this comparison", tables=[Table(("diagnosis", "verdict"), rows)], notes=[f"Note: {n}." for n in c.notes]
    )


def comparison_summary(c: Comparison) -> RenderableType:
    """Return the three answers and the gap per joint for `rich` to print."""
    from rich import box
    from rich.console import Group
    from rich.table import Table as Grid
    from rich.text import Text

    from armgap.report.forms.terminal import answer_lines

    grid = Grid(
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        title=Text(f"RMS error over {c.horizon_s:g} s [{milli_unit(c.joint_units)}]"),
        title_justify="left",
    )
    for name in ("joint", "model", *c.names):
        grid.add_column(name, justify="left" if name in ("joint", "model") else "right", overflow="fold")
    for j in range(len(c.gap[0].before)):
        for g in c.gap:
            grid.add_row(str(j + 1), _MODELS[g.model], error_text(1e3 * g.before[j]), error_text(1e3 * g.after[j]))
    lines = [line for a in answers(c) for line in answer_lines(a)]
    return Group(Text(lead(c), style="bold reverse"), Text(), *lines, grid)
