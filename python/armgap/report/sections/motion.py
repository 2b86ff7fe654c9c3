"""Report sections on predicted and measured positions: window by window, and in free run."""

from __future__ import annotations

from typing import Any

import numpy as np

from armgap.literals import joint_units
from armgap.report import charts
from armgap.report.page import Drawing, Section, Table
from armgap.report.sections.model_labels import Data, joint_unit, model_labels
from armgap.report.words import each_joint, figure

__all__ = ["free_run", "horizons", "predictions"]

_ARROW = " \N{RIGHTWARDS ARROW} "
#: Distance beyond the range of measured positions up to which a free run is drawn, as a multiple of that range.
_DRAWN_RANGE_MARGIN = 1.0


def predictions(data: Data) -> Section | None:
    """Return the section with predicted and measured positions and their errors on the holdout."""
    series = data.get("series") or []
    if not series:
        return None
    drawn: list[Drawing] = []
    for s in series:
        position, error = _position(data, s), _error(data, s)
        error.x_range = position.x_range
        drawn += [
            Drawing(f"{s['log']}, joint {s['joint']}: position [{joint_unit(data, s['joint'])}]", position),
            Drawing(
                f"{s['log']}, joint {s['joint']}: measured minus predicted [m{joint_unit(data, s['joint'])}]", error
            ),
        ]
    text = (
        "Every window starts from its measured state and runs under the logged torque. Drag over a stretch of time to zoom in, or use Ctrl and the "
        "wheel; position and error move together. A click on a name hides its curve."
    )
    return Section("Predicted against measured, on held-out motion", text=[text], figures=drawn, columns=2)


def _position(data: Data, s: Data) -> Any:
    curves = [("measured", s["measured"], charts.MEASURED)]
    curves += [(label, s[key], colour) for label, key, colour in model_labels(data)]
    return charts.lines("", "time [s]", "", s["t"], curves, breaks=s["window_start"])


def _error(data: Data, s: Data) -> Any:
    measured, *predicted = (
        np.asarray(s[key], dtype=float) for key in ("measured", *(k for _, k, _ in model_labels(data)))
    )
    curves = [
        (label, 1e3 * (measured - values), colour)
        for (label, _, colour), values in zip(model_labels(data), predicted, strict=True)
    ]
    return charts.lines("", "time [s]", "", s["t"], curves, breaks=s["window_start"])


def horizons(data: Data) -> Section | None:
    """Return the section with the gap at several prediction horizons."""
    gap, units = data["gap"], joint_units(data)
    every = sorted([gap, *gap.get("horizons", [])], key=lambda h: float(h["horizon_s"]))
    if len(every) < 2:
        return None
    header = ("horizon [s]", _ARROW.join(label for label, _, _ in model_labels(data)), "measurement alone")
    rows = [
        (
            figure(h["horizon_s"]),
            each_joint(*(h[key] for _, key, _ in model_labels(data)), units=units),
            each_joint(h["floor"], units=units),
        )
        for h in every
    ]
    text = (
        "RMS position error per joint when every prediction starts from a measured state and runs that long. What the measurement "
        "alone leaves grows with the horizon, because the start's velocity is measured too."
    )
    return Section("How far, at several horizons", text=[text], tables=[Table(header, rows)])


def free_run(data: Data) -> Section:
    """Return the section with a free run over the whole holdout from its first sample."""
    gap, units = data["gap"], joint_units(data)
    run = gap["free_run"]
    last = "with the causes" if data.get("causes") else "re-estimated"
    text = (
        "Simulated from the first sample of each held-out log to its last, without looking at the measurement again. Errors add up, and where "
        "the motion is sensitive a small one decides the rest; the windows above are the fairer judge. "
        f"{each_joint(run['before'], run['after'], units=units)} (RMS error with the arm file → {last})."
    )
    drawn = [
        Drawing(f"{s['log']}, joint {s['joint']} [{joint_unit(data, s['joint'])}]", _whole_run(s, last))
        for s in data.get("free_run_series") or []
    ]
    return Section("Free run", text=[text], figures=drawn, columns=2)


def _whole_run(s: Data, last: str) -> Any:
    """Return a chart of a free run; a diverging curve does not change the scale."""
    curves = [
        ("measured", s["measured"], charts.MEASURED),
        ("arm file", s["before"], charts.BEFORE),
        (last, s["after"], charts.AFTER),
    ]
    low, high = min(s["measured"]), max(s["measured"])
    reach = (high - low) or 1.0
    chart = charts.lines("", "time [s]", "", s["t"], curves)
    chart.y_range.bounds = (low - _DRAWN_RANGE_MARGIN * reach, high + _DRAWN_RANGE_MARGIN * reach)
    values = [v for key in ("before", "after") for v in s[key] if v is not None]
    if min(values) < low - _DRAWN_RANGE_MARGIN * reach or max(values) > high + _DRAWN_RANGE_MARGIN * reach:
        chart.y_range.start, chart.y_range.end = chart.y_range.bounds
    return chart
