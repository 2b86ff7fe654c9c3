"""HTML page of inspections that loads no external files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.inspection import words
from armgap.inspection.inspection import Inspection
from armgap.log.conversion.unit_names import si
from armgap.report import charts, page
from armgap.report.conventions import brief, section
from armgap.report.page import Section
from armgap.report.words import SummaryAnswer

__all__ = ["render"]

#: Largest numbers of points of a drawn line and of bars of a histogram: more than a screen resolves.
_POINTS = 1500
_BINS = 60
#: Marks of findings in curves: words, shape and colour by kind of finding.
_MARKS = {"cleaned": ("left out", "inverted_triangle", charts.BEFORE), "gap": ("gap", "triangle", charts.REFIT)}


def render(inspections: Sequence[Inspection]) -> str:
    """Return the HTML page for one inspection or several."""
    single = len(inspections) == 1
    title = f"Log: {inspections[0].log}" if single else f"{len(inspections)} logs"
    lead = "What the log holds, how it was sampled, and what its motion tells."
    pairs = words.overview(inspections[0]) if single else [(found.log, _brief(found)) for found in inspections]
    answers = [SummaryAnswer(question, *_headline(answer)) for question, answer in pairs]
    sections = [part for found in inspections for part in _sections(found, single=single)]
    kind = inspections[0].kind
    conventions = section(kind, [_read(found) for found in inspections], si(inspections[0].rotary))
    if conventions is not None:
        sections.insert(1, conventions)
    return page.render(title, lead, answers, sections, brief=brief(kind))


def _read(found: Inspection) -> dict[str, Any]:
    """Return columns and units of a log in the form of a report's section on conventions."""
    return {"name": found.log, "columns": dict(found.source.columns), "units": dict(found.source.units)}


def _headline(answer: str) -> tuple[str, str]:
    """Split an answer into its first statement and the rest."""
    first, _, rest = answer.partition("; ")
    return first, rest


def _brief(found: Inspection) -> str:
    return "; ".join(f"{question} {answer}" for question, answer in words.overview(found)[1:3])


def _sections(found: Inspection, *, single: bool) -> list[Section]:
    before = "" if single else f"{found.log}: "
    notes = [f"{c.line(found.log)}." for c in found.checks]
    notes += [f"{f.message}." for f in found.findings]
    (_, joints), *parameters = words.grids(found)
    text = [] if single else [f"{question}: {answer}" for question, answer in words.overview(found)]
    return [
        Section(_headed(before, "over time"), figures=_over_time(found)),
        Section(_headed(before, "joints"), text=text, tables=[joints], notes=notes),
        *(Section(_headed(before, "parameters"), text=[f"{title}."], tables=[grid]) for title, grid in parameters),
        Section(_headed(before, "sampling and coverage"), figures=[_periods(found), *_coverage(found)]),
    ]


def _headed(before: str, title: str) -> str:
    return f"{before}{title}" if before else title.capitalize()


def _over_time(found: Inspection) -> list[Any]:
    log = found.source
    figures: list[Any] = []
    length, load = found.units
    for j in range(log.n_joints):
        for name, title, unit, signal in (
            ("q", "position", length, log.q),
            ("q_ref", "reference", length, log.q_ref),
            ("tau", "torque", load, log.tau if log.has_torques else None),
        ):
            if signal is None:
                continue
            name, values = f"{name}{j + 1}", signal[:, j]
            title = f"{title} of joint {j + 1}, {name} [{unit}]"
            t, shown = _envelope(log.t, values)
            options = {"x_range": figures[0].x_range} if figures else {}
            curve = [(name, shown, charts.MEASURED)]
            figures.append(charts.lines(title, "time [s]", "", t, curve, height=180, **options))
            _mark(figures[-1], found, float(values.min()))
    return figures


def _mark(chart: Any, found: Inspection, low: float) -> None:
    """Mark times of rows that were left out, and of gaps, at the height `low` in a chart."""
    for kind, (label, marker, colour) in _MARKS.items():
        times = [t for f in found.findings if f.kind == kind for t in f.times]
        if times:
            chart.scatter(
                times, [low] * len(times), marker=marker, size=9, color=colour, fill_alpha=0.6, legend_label=label
            )


def _envelope(t: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times and values of a curve for drawing: smallest and largest value of each part, so that no peak is lost."""
    rows = len(t) // _POINTS
    if rows < 3:
        return t, values
    cut = rows * (len(t) // rows)
    blocks = values[:cut].reshape(-1, rows)
    shown = np.column_stack([blocks.min(axis=1), blocks.max(axis=1)]).reshape(-1)
    return np.repeat(t[:cut:rows], 2), shown


def _periods(found: Inspection) -> Any:
    steps = np.diff(found.source.t) * 1e3
    low, high = float(steps.min()), float(np.quantile(steps, 0.999))
    edges = np.linspace(low - 1e-6, max(high, low) + 1e-6, _BINS + 1)
    counts, _ = np.histogram(steps, edges)
    middle = (edges[1:] + edges[:-1]) / 2
    return charts.lines(
        "sample periods", "period [ms]", "samples", middle, [("samples", counts, charts.MEASURED)], height=200
    )


def _coverage(found: Inspection) -> list[Any]:
    log = found.source
    stride = max(1, len(log) // (4 * _POINTS))
    length, _ = found.units
    figures = []
    for j in range(log.n_joints):
        speed = np.gradient(log.q[::stride, j], log.t[::stride])
        f = charts.figure(
            f"joint {j + 1}: positions and speeds visited",
            f"position [{length}]",
            f"speed [{length} per s]",
            height=220,
        )
        f.scatter(log.q[::stride, j], speed, size=2, color=charts.AFTER, alpha=0.4)
        figures.append(f)
    return figures
