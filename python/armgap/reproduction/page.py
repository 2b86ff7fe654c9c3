"""Report of the reproduction of Reyes and Kelly (1997): Table II beside the run, causes of its deviations, Figures 2 to 7."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from armgap.estimation.identification import Identification
from armgap.literals import SCHEMES, Scheme
from armgap.report import charts
from armgap.report.document import Document
from armgap.report.forms.html import page_of
from armgap.report.page import Drawing, Section
from armgap.report.words import SummaryAnswer, unit_text
from armgap.reproduction.experiment import LADDER, PAPER_ESTIMATES, PAPER_MEASURED, Reproduction
from armgap.reproduction.findings import percent

__all__ = ["document", "render", "table_two"]

# Range of charts of estimates, in true values: the first estimates are far off and are cut.
SPAN = 1.6
Curve = tuple[str, Identification, str]


def _names(r: Reproduction) -> list[str]:
    """Return the parameter names of Reyes and Kelly (1997), with the arm's own in brackets where they differ."""
    return [n if n == f"theta{i}" else f"theta{i} {n}" for i, n in enumerate(r.arm.parameter_names, start=1)]


def table_two(r: Reproduction) -> tuple[list[str], list[list[str]]]:
    """Return Table II of Reyes and Kelly (1997) beside the simulated run, as header and rows."""
    header = ["parameter", "Table I", "paper: measured", *(f"{who}: {s}" for s in SCHEMES for who in ("paper", "here"))]
    rows = []
    for i, name in enumerate(_names(r)):
        row = [name, f"{r.arm.theta[i]:.4g}", f"{PAPER_MEASURED[i]:g}"]
        for scheme in SCHEMES:
            value = PAPER_ESTIMATES[scheme][i]
            row += ["no convergence" if value is None else f"{value:g}", f"{r.steps[scheme][0].theta[i]:.3g}"]
        rows.append(row)
    return header, rows


def _ladder(r: Reproduction) -> list[list[str]]:
    return [
        [scheme, label, *(percent(100 * d) for d in r.deviation(scheme, step))]
        for scheme in SCHEMES
        for step, (label, *_) in enumerate(LADDER)
    ]


def _parts(r: Reproduction) -> list[list[str]]:
    return [
        [scheme, part, *(percent(v) for v in values)]
        for scheme in SCHEMES
        for part, values in r.decomposition(scheme).items()
    ]


def _estimates(r: Reproduction, curves: Sequence[Curve], first: int = 0) -> list[Any]:
    """Return charts of estimates over time, one small chart per parameter."""
    thin = slice(None, None, 8)
    figures: list[Any] = []
    names = _names(r)
    for i in range(first, len(r.arm.theta)):
        truth = float(r.arm.theta[i])
        reach = SPAN * abs(truth)
        shown = [
            (label, np.clip(result.history[thin, i], truth - reach, truth + reach), colour)
            for label, result, colour in curves
        ]
        levels = [("true", truth, charts.MEASURED)]
        chart = charts.lines("", "time [s]", "", r.log.t[thin], shown, levels=levels, height=210)
        figures.append(Drawing(f"{names[i]} [{unit_text(r.arm.parameter_units[i])}]", chart))
    return figures


def _response(r: Reproduction, label: str) -> list[Any]:
    thin = slice(None, None, 4)
    return [
        Drawing(
            f"joint {j + 1}, open loop [rad]",
            charts.lines(
                "",
                "time [s]",
                "",
                r.log.t[thin],
                [
                    ("run", r.log.q[thin, j], charts.MEASURED),
                    (label, r.responses[label].q[thin, j], charts.AFTER),
                ],
                height=220,
            ),
        )
        for j in range(r.arm.n_joints)
    ]


def _distance(r: Reproduction, label: str) -> str:
    each = " and ".join(f"{1e3 * x:.0f} mrad" for x in r.misfit(label))
    return f"RMS distance from the run: {each}."


def _responses(r: Reproduction, title: str, label: str) -> Section:
    return Section(title, text=[_distance(r, label)], figures=_response(r, label), columns=2)


def _estimate_section(r: Reproduction, title: str, scheme: Scheme) -> Section:
    return Section(title, figures=_estimates(r, [("estimate", r.steps[scheme][0], charts.AFTER)]), columns=3)


def _drift(r: Reproduction) -> Section:
    curves = [
        ("supplied energy", r.wandering["supplied-energy"][0], charts.BEFORE),
        ("filtered power", r.wandering["filtered-power"][0], charts.AFTER),
    ]
    title = "Figure 5 against Figure 6 under torques that wander slowly: theta5 to theta9"
    return Section(title, figures=_estimates(r, curves, first=4), columns=3)


def _sections(r: Reproduction) -> list[Section]:
    names = _names(r)
    moments = (
        "Table II's measured column follows from Table I digit by digit when first moments are rounded to 0.001 kg m on the way, as "
        "2.175, 1.746 and 0.186; theta1 and theta8 are cut after their last digit, not rounded. The simulated arm takes Table I as it "
        "is, so theta4 and theta5 differ from the measured column by up to 0.002."
    )
    return [
        Section("Table II, beside this run with everything as in the paper", tables=[table_two(r)], notes=[moments]),
        Section("Deviation from the truth, step by step", tables=[(["scheme", "put right", *names], _ladder(r))]),
        Section(
            "What explains Table II's deviation from its measured column",
            tables=[(["scheme", "part", *names], _parts(r))],
        ),
        _responses(r, "Figure 2: the run, and Table I with one Coulomb level", "Table I"),
        _estimate_section(r, "Figure 3: estimates of the filtered dynamic model", "filtered-dynamic"),
        _responses(r, "Figure 4: open loop with the filtered dynamic estimates", "filtered-dynamic"),
        _estimate_section(r, "Figure 5: estimates of the supplied energy model", "supplied-energy"),
        _drift(r),
        _estimate_section(r, "Figure 6: estimates of the filtered power model", "filtered-power"),
        _responses(r, "Figure 7: open loop with the filtered power estimates", "filtered-power"),
    ]


def document(r: Reproduction) -> Document:
    """Return the report of the reproduction as a document."""
    lead = "Reyes and Kelly 1997 on a simulated arm of Table I: asymmetric Coulomb friction, encoder counts, backward differences."
    return Document(
        "The seed reproduced", lead, [SummaryAnswer(title, "", text) for title, text in r.findings()], _sections(r)
    )


def render(r: Reproduction) -> str:
    """Return the report of the reproduction as one HTML page that loads no external files."""
    return page_of(document(r))
