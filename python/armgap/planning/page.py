"""Report of a planned experiment, and its summary in a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armgap.planning.open_questions.questions import NONE
from armgap.planning.planning import Plan, PlannedQuestion
from armgap.report import charts
from armgap.report.conventions import brief, section
from armgap.report.document import Document
from armgap.report.page import Bar, Cell, Drawing, Section, Table
from armgap.report.words import SummaryAnswer, figure, percent, title
from armgap.several_joints import joint_text

if TYPE_CHECKING:
    from rich.console import RenderableType

__all__ = ["lines", "plan_document", "plan_summary"]

#: Probability of a decision from which a question counts as one that the motion settles.
SURE = 0.9
#: Number of points to which a long curve in a plan's report is thinned out, roughly.
DRAWN = 2000
_COLOURS = (charts.BEFORE, charts.AFTER, charts.FLOOR, charts.REFIT, charts.MEASURED)
_ORIGINS = {
    "asked": "asked for",
    "equivalents": "these logs do not tell the two apart",
    "candidate": "found, but not fit to be named",
    "undecided": "undecided",
    "not excited": "not excited by these logs",
}


def plan_document(plan: Plan) -> Document:
    """Return the report of a plan as a document."""
    conventions = section(plan.kind)
    sections = [
        _motion(plan),
        _questions(plan),
        _cannot(plan),
        _limits(plan),
        *([conventions] if conventions else []),
        _method(plan),
    ]
    heading = f"Next experiment: {plan.arm}"
    return Document(heading, lead(plan), answers(plan), [s for s in sections if s is not None], brief(plan.kind))


def lead(plan: Plan) -> str:
    """Return a sentence on how many questions the planned motion is expected to settle."""
    sure = sum(q.settled >= SURE for q in plan.questions)
    open_questions = _counted(len(plan.questions), "open question")
    return f"One motion of {figure(plan.duration)} s; {sure} of {open_questions} it settles with a probability of {percent(SURE)} or more."


def answers(plan: Plan) -> list[SummaryAnswer]:
    """Return the summary answers of a plan's report: purpose, expected certainty, and questions that may stay open."""
    best = sorted(plan.questions, key=lambda q: -q.settled)
    settled = [f"{_asked(q)} {percent(q.settled)}" for q in best]
    unsettled = [q for q in best if q.why]
    left = f"Left out: {', '.join(plan.left_out)}." if plan.left_out else ""
    return [
        SummaryAnswer("What is it for?", "; ".join(_asked(q) for q in plan.questions), left),
        SummaryAnswer(
            "How sure will one be?",
            "; ".join(settled),
            "Probability of a decision if the effect is in the arm, mean over the sizes it could have.",
        ),
        SummaryAnswer(
            "What will it not tell?",
            " ".join(_asked(q) for q in unsettled) or "Nothing of what was asked is out of reach",
            " ".join(f"{_asked(q)} {q.why[:1].upper()}{q.why[1:]}." for q in unsettled),
        ),
    ]


def lines(plan: Plan) -> list[str]:
    """Return a plan as text, one line per question."""
    settled = [
        f"{_asked(q)}: expected log-likelihood ratio {figure(q.expected_log_likelihood_ratio)}, settled with probability {figure(q.settled, 2)}"
        f"{f' ({q.why})' if q.why else ''}"
        for q in plan.questions
    ]
    left = [f"left out: {', '.join(plan.left_out)}"] if plan.left_out else []
    return [lead(plan), *settled, *left]


def _asked(q: PlannedQuestion) -> str:
    """Return a question of a plan in words, as ``backlash (joint 2) or none?``."""
    other = "none" if q.against == NONE else f"{title(q.against)} ({joint_text(q.against_joint)})"
    return f"{_short(q)} or {other}?"


def _short(q: PlannedQuestion) -> str:
    return f"{title(q.effect)} ({joint_text(q.joint)})"


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _motion(plan: Plan) -> Section:
    every = max(1, len(plan.t) // DRAWN)
    t = plan.t[::every]
    unit, torque = ("m", "N") if plan.kind == "axis" else ("rad", "N m")
    drawings = []
    for values, what, label in (
        (plan.q_ref, "Reference position", f"position [{unit}]"),
        (plan.dq_ref, "Reference velocity", f"velocity [{unit}/s]"),
        (plan.tau_ff, "Feed-forward torque of the best model", f"torque [{torque}]"),
    ):
        curves = [(f"joint {j + 1}", values[::every, j], _COLOURS[j % len(_COLOURS)]) for j in range(values.shape[1])]
        drawings.append(Drawing(f"{what}.", charts.lines("", "time [s]", label, t, curves), _extremes(values, label)))
    return Section("", figures=drawings)


def _extremes(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]], label: str) -> Table:
    rows = [
        (f"joint {j + 1}", figure(float(values[:, j].min())), figure(float(values[:, j].max())))
        for j in range(values.shape[1])
    ]
    return Table(("", f"least {label}", f"most {label}"), rows)


def _questions(plan: Plan) -> Section:
    rows: list[tuple[Cell, ...]] = [
        (
            _asked(q),
            _ORIGINS[q.origin],
            "" if q.sizes is None else f"{q.sizes[0]} {figure(q.sizes[1])} to {figure(q.sizes[2])}",
            figure(q.expected_log_likelihood_ratio),
            Bar(q.settled, percent(q.settled), charts.AFTER),
        )
        for q in plan.questions
    ]
    text = (
        "The expected log-likelihood ratio is for the effect if it is in the arm, against the other model with all of its values fitted to this "
        f"motion. A decision needs {figure(plan.threshold)}; settled is the probability of that, mean over the sizes in the table."
    )
    header = ("question", "because", "sizes", "expected log-likelihood ratio", "settled")
    return Section("What the motion is for", text=[text], tables=[Table(header, rows)])


def _cannot(plan: Plan) -> Section | None:
    points = [f"{_asked(q)} {q.why[:1].upper()}{q.why[1:]}." for q in plan.questions if q.why]
    left = [f"Not planned for: {', '.join(plan.left_out)}. Ask for one of them with --for."] if plan.left_out else []
    if not points and not left:
        return None
    return Section("What the motion will not tell", points=points, notes=left)


def _limits(plan: Plan) -> Section:
    limits, used = plan.limits.to_dict(), plan.to_dict()["used"]
    unit, torque = ("m", "N") if plan.kind == "axis" else ("rad", "N m")
    rows: list[tuple[Cell, ...]] = []
    for j in range(len(plan.limits.home)):
        for name, of, cell in (
            ("position", f"{unit}", ("position_min", "position_max")),
            ("speed", f"{unit}/s", ("speed",)),
            ("torque", torque, ("torque",)),
        ):
            allowed = (
                " to ".join(figure(limits[key][j]) for key in cell) if limits[cell[0]] is not None else "not limited"
            )
            rows.append(
                (f"joint {j + 1}", f"{name} [{of}]", " to ".join(figure(used[key][j]) for key in cell), allowed)
            )
    source = {"arm file": "Limits are those of the arm file.", "logs": "Limits are what the diagnosed logs covered."}
    start = ", ".join(figure(float(x)) for x in plan.limits.home)
    text = [source[plan.limits.source], f"It begins and ends at rest at {start} {unit}: move the arm there first."]
    return Section("Limits", text=text, tables=[Table(("", "", "used", "limit"), rows)])


def _method(plan: Plan) -> Section:
    text = f"{_counted(plan.evaluations, 'motion')} compared; {figure(plan.duration)} s, {_counted(len(plan.t), 'sample')}."
    return Section("About this plan", text=[text], notes=[f"Note: {note}." for note in plan.notes])


def plan_summary(plan: Plan) -> RenderableType:
    """Return the answers of a plan for `rich` to print."""
    from rich.console import Group
    from rich.text import Text

    from armgap.report.forms.terminal import answer_lines

    printed = [line for a in answers(plan) for line in answer_lines(a)]
    return Group(Text(lead(plan), style="bold reverse"), Text(), *printed)
