"""Predicted against measured: window by window, and in free run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from armgap.report import charts
from armgap.report.page import Drawing, Section
from armgap.report.sections.steps import Data, length_unit, steps
from armgap.report.words import millis

__all__ = ["free_run", "predictions"]

#: Digits kept of a drawn curve: below a pixel at any zoom that shows more than noise.
DIGITS = 6


def predictions(data: Data) -> Section | None:
    """Positions and errors on held-out motion, zoomable together."""
    series = data.get("series") or []
    if not series:
        return None
    drawn: list[Drawing] = []
    for s in series:
        position, error = _position(data, s), _error(data, s)
        error.x_range = position.x_range
        drawn += [
            Drawing(f"{s['log']}, joint {s['joint']}: position [{length_unit(data)}]", position),
            Drawing(f"{s['log']}, joint {s['joint']}: measured minus predicted [m{length_unit(data)}]", error),
        ]
    text = (
        "Every window starts from its measured state and runs under the logged torque. Drag over a stretch of time to zoom in, or use Ctrl and the "
        "wheel; position and error move together. A click on a name hides its curve."
    )
    return Section("Predicted against measured, on held-out motion", text=[text], figures=drawn, columns=2)


def _position(data: Data, s: Data) -> Any:
    curves = [("measured", _rounded(s["measured"]), charts.MEASURED)]
    curves += [(label, _rounded(s[key]), colour) for label, key, colour in steps(data)]
    return charts.lines("", "time [s]", "", s["t"], curves, breaks=s["window_start"])


def _error(data: Data, s: Data) -> Any:
    measured = np.asarray(s["measured"])
    curves = [(label, _rounded(1e3 * (measured - np.asarray(s[key]))), colour) for label, key, colour in steps(data)]
    return charts.lines("", "time [s]", "", s["t"], curves, breaks=s["window_start"])


def _rounded(values: Sequence[float] | np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    return np.round(np.asarray(values, dtype=float), DIGITS)


def free_run(data: Data) -> Section:
    """The whole holdout from its first sample."""
    gap, unit = data["gap"], length_unit(data)
    run = gap["free_run"]
    last = "with the causes" if data.get("causes") else "re-estimated"
    text = (
        "Simulated from the first sample of each held-out log to its last, without looking at the measurement again. Errors add up, and where "
        "the motion is sensitive a small one decides the rest; the windows above are the fairer judge. RMS "
        f"{millis(run['before'], unit)} with the arm file, {millis(run['after'], unit)} {last}."
    )
    drawn = [
        Drawing(
            f"{s['log']}, joint {s['joint']} [{unit}]",
            charts.lines(
                "",
                "time [s]",
                "",
                s["t"],
                [
                    ("measured", _rounded(s["measured"]), charts.MEASURED),
                    ("arm file", _rounded(s["before"]), charts.BEFORE),
                    (last, _rounded(s["after"]), charts.AFTER),
                ],
            ),
        )
        for s in data.get("free_run_series") or []
    ]
    return Section("Free run", text=[text], figures=drawn, columns=2)
