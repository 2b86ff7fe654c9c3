"""Charts of reports in a common style: each colour has one meaning, and the background is transparent, for light and dark pages.

Texts, axes and grids take their colours from the page's style sheet (``--bk-…`` variables), so that they are readable on dark pages too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armgap.report.symbols import symbol_text
from armgap.report.words import error_text, unit_text

__all__ = ["AFTER", "BEFORE", "FLOOR", "MEASURED", "REFIT", "bars", "law", "lines"]

# Colours of charts: Okabe and Ito's colour-blind-safe palette; the greys are readable on white and on near-black.
MEASURED = "#808080"
BEFORE = "#D55E00"
REFIT = "#E69F00"
AFTER = "#0072B2"
FLOOR = "#009E73"


def figure(title: str, x_label: str, y_label: str, **options: Any) -> Any:
    """Return an empty chart in the common style."""
    from bokeh.plotting import figure as make

    settings: dict[str, Any] = {
        "height": 240,
        "sizing_mode": "stretch_width",
        "tools": "",
        "toolbar_location": "above",
        "output_backend": "canvas",
    }
    settings |= options
    f = make(title=title or None, **settings)
    f.background_fill_color = f.border_fill_color = None
    f.outline_line_color = None
    f.toolbar.logo = None
    if settings["toolbar_location"] is not None:
        _tools(f)
    f.toolbar.autohide = f.toolbar_inner = True
    for axis, label in ((f.xaxis[0], x_label), (f.yaxis[0], y_label)):
        axis.axis_label = label or None
        axis.axis_label_text_font_style = "normal"
        axis.minor_tick_line_color = None
    return f


def _tools(f: Any) -> None:
    """Add the tools of a chart: dragging zooms in; the mouse wheel alone scrolls the page."""
    from bokeh.models import BoxZoomTool, PanTool, ResetTool, SaveTool, WheelZoomTool

    wheel, box = WheelZoomTool(dimensions="width", modifiers="ctrl"), BoxZoomTool(dimensions="width")
    f.add_tools(box, PanTool(dimensions="width"), wheel, ResetTool(), SaveTool())
    f.toolbar.active_drag, f.toolbar.active_scroll = box, wheel


def _legend(f: Any) -> None:
    legend = f.legend[0]
    legend.background_fill_alpha = 0.0
    legend.border_line_color = None
    legend.padding = legend.margin = 0
    legend.spacing = 12
    legend.click_policy = "hide"
    legend.orientation = "horizontal"
    legend.location = "center"
    f.add_layout(legend, "below")


def lines(
    title: str,
    x_label: str,
    y_label: str,
    x: ArrayLike,
    curves: Sequence[tuple[str, ArrayLike, str]],
    *,
    breaks: Sequence[int] = (),
    levels: Sequence[tuple[str, float, str]] = (),
    **options: Any,
) -> Any:
    """Return a chart of curves over a common abscissa.

    Parameters
    ----------
    title, x_label, y_label : str
        Title, and labels of the axes.
    x : array_like, shape (n,)
        Abscissa.
    curves : sequence of (label, values, colour)
        Values have shape (n,).
    breaks : sequence of int
        Indices of the values before which all curves are interrupted.
    levels : sequence of (label, value, colour)
        Horizontal lines.
    """
    f = figure(title, x_label, y_label, **options)
    from bokeh.models import ColumnDataSource

    gaps = [b for b in breaks if b > 0]
    columns = {"x": x} | {f"y{i}": values for i, (_, values, _) in enumerate(curves)}
    source = ColumnDataSource({name: _lifted(values, gaps) for name, values in columns.items()})
    for i, (label, _, colour) in enumerate(curves):
        width = 2.5 if colour == MEASURED else 1.3
        f.line("x", f"y{i}", source=source, legend_label=label, color=colour, line_width=width)
    ends = [float(np.min(np.asarray(x))), float(np.max(np.asarray(x)))]
    for label, value, colour in levels:
        f.line(ends, [value, value], legend_label=label, color=colour, line_dash="dashed")
    _legend(f)
    return f


def _lifted(values: ArrayLike, gaps: Sequence[int]) -> NDArray[np.float32]:
    """Return a column with NaN before each gap, in single precision."""
    return np.insert(np.asarray(values, dtype=np.float32), gaps, np.nan)


def bars(
    title: str,
    y_label: str,
    groups: Sequence[str],
    series: Sequence[tuple[str, Sequence[float], str]],
    *,
    log: bool = False,
    labels: bool = True,
    x_label: str = "",
    **options: Any,
) -> Any:
    """Return a chart of grouped bars; `log`: logarithmic axis over whole decades, without values of zero; `labels`: each bar shows its value."""
    from bokeh.models import ColumnDataSource, FactorRange, LabelSet

    factors = [(group, label) for group in groups for label, _, _ in series]
    scale = {"y_axis_type": "log"} if log else {}
    fixed = {"tools": "", "toolbar_location": None}
    f = figure(title, x_label, y_label, x_range=FactorRange(*factors), **(fixed | scale | options))
    positive = [v for _, values, _ in series for v in values if v > 0]
    bottom = _decades(f, min(positive), max(positive)) if log and positive else 0.0
    if positive and not log:
        f.y_range.end = max(positive) * 1.15
    for i, (label, values, colour) in enumerate(series):
        tops = [v if v > 0 or not log else bottom for v in values]
        data = {
            "x": [(group, series[i][0]) for group in groups],
            "top": tops,
            "text": [error_text(v) for v in values],
        }
        source = ColumnDataSource(data)
        f.vbar("x", top="top", bottom=bottom, width=0.9, color=colour, source=source, legend_label=label)
        if labels:
            mark = LabelSet(x="x", y="top", text="text", source=source, text_align="center", y_offset=2)
            mark.text_font_size = "12px"
            f.add_layout(mark)
    f.xaxis.major_label_text_alpha = 0
    f.xaxis.major_label_text_font_size = "0px"
    f.xaxis.major_tick_in = f.xaxis.major_tick_out = 0
    f.xaxis.separator_line_alpha = 0
    f.xgrid.visible = False
    _legend(f)
    return f


def _decades(f: Any, low: float, high: float) -> float:
    """Set a logarithmic axis to whole decades with ticks at every decade and its parts; return its lower end."""
    from bokeh.models import FixedTicker

    first, last = math.floor(math.log10(0.8 * low)), math.ceil(math.log10(1.6 * high))
    decades = [10.0**k for k in range(first, last + 1)]
    parts = [m * d for d in decades[:-1] for m in range(2, 10)]
    f.y_range.start, f.y_range.end = decades[0], decades[-1]
    f.yaxis.ticker = f.ygrid.ticker = FixedTicker(ticks=decades, minor_ticks=parts)
    f.yaxis.major_label_overrides = {d: f"{d:g}" for d in decades}
    f.yaxis.minor_tick_line_color = MEASURED
    f.ygrid.minor_grid_line_color, f.ygrid.minor_grid_line_alpha = MEASURED, 0.15
    return decades[0]


def law(entry: dict[str, Any]) -> Any:
    """Return a chart of a cause's evidence over its variable: samples, means over ranges with their intervals, and the fitted law.

    Parameters
    ----------
    entry : dict
        One entry of a diagnosis' ``laws``.
    """
    from bokeh.models import ColumnDataSource, Whisker

    bins, points = entry["bins"], entry["points"]
    f = figure("", f"{symbol_text(entry['variable'])} [{unit_text(entry['unit'])}]", "", height=300)
    f.scatter(points["x"], points["y"], size=4, color=MEASURED, alpha=0.45, line_color=None, legend_label="samples")
    ends = {
        "x": bins["x"],
        "low": [m - e for m, e in zip(bins["mean"], bins["error"], strict=True)],
        "high": [m + e for m, e in zip(bins["mean"], bins["error"], strict=True)],
    }
    f.add_layout(Whisker(base="x", lower="low", upper="high", source=ColumnDataSource(ends), line_color=BEFORE))
    f.line(bins["x"], bins["law"], color=AFTER, line_width=2.5, legend_label="fitted law")
    rings = {"size": 8, "color": BEFORE, "fill_color": None, "line_width": 2}
    f.scatter(bins["x"], bins["mean"], legend_label="mean residual torque", **rings)
    _reach(f, [*ends["low"], *ends["high"], *bins["law"]])
    _legend(f)
    return f


def dependence(entry: dict[str, Any], torque_unit: str) -> Any:
    """Return a chart of residual torque that no named effect explains: over one variable with 95 % intervals, over two by colour.

    Parameters
    ----------
    entry : dict
        One entry of a diagnosis' ``unnamed``.
    torque_unit : str
        Unit of the torque.
    """
    from bokeh.models import ColumnDataSource, Whisker

    if entry.get("grid"):
        return _cells(entry, torque_unit)

    law = entry["law"]
    f = figure("", f"{symbol_text(entry['variable'])} [{unit_text(entry['unit'])}]", "", height=300)
    ends = {
        "x": law["x"],
        "low": [y - 1.96 * s for y, s in zip(law["torque"], law["sigma"], strict=True)],
        "high": [y + 1.96 * s for y, s in zip(law["torque"], law["sigma"], strict=True)],
    }
    f.add_layout(Whisker(base="x", lower="low", upper="high", source=ColumnDataSource(ends), line_color=BEFORE))
    f.line(law["x"], law["torque"], color=AFTER, line_width=2.5)
    f.scatter(law["x"], law["torque"], size=8, color=BEFORE, fill_color=None, line_width=2)
    _reach(f, [*ends["low"], *ends["high"]], margin=0.05)
    return f


def _cells(entry: dict[str, Any], torque_unit: str) -> Any:
    """Return a chart of torque over two variables: a cell for each pair of classes, its torque as colour."""
    from bokeh.models import ColorBar, ColumnDataSource, LinearColorMapper
    from bokeh.palettes import interp_palette

    grid = entry["grid"]
    names = [f"{symbol_text(d['variable'])} [{unit_text(d['unit'])}]" for d in (entry, grid)]
    f = figure("", *names, height=300)
    (left, right), (bottom, top) = (_edges(grid[axis]) for axis in ("x", "y"))
    pairs = [(i, k) for i in range(len(left)) for k in range(len(bottom))]
    cells = {
        "left": [left[i] for i, _ in pairs],
        "right": [right[i] for i, _ in pairs],
        "bottom": [bottom[k] for _, k in pairs],
        "top": [top[k] for _, k in pairs],
        "torque": [grid["torque"][i][k] for i, k in pairs],
    }
    most = max(map(abs, cells["torque"])) or 1.0
    colours = LinearColorMapper(interp_palette([AFTER, "#f7f7f7", BEFORE], 101), low=-most, high=most)
    f.quad(
        "left",
        "right",
        "top",
        "bottom",
        source=ColumnDataSource(cells),
        line_color=None,
        color={"field": "torque", "transform": colours},
    )
    f.add_layout(
        ColorBar(color_mapper=colours, title=f"[{torque_unit}]", width=12, background_fill_color=None), "right"
    )
    return f


def _edges(means: Sequence[float]) -> tuple[list[float], list[float]]:
    """Return lower and upper edges of classes: halfway between their means, and as far beyond the outer ones."""
    x = np.asarray(means, dtype=float)
    middle = (x[1:] + x[:-1]) / 2
    first, last = (2 * x[0] - middle[0], 2 * x[-1] - middle[-1]) if len(x) > 1 else (x[0] - 0.5, x[0] + 0.5)
    return [float(first), *middle.tolist()], [*middle.tolist(), float(last)]


def _reach(f: Any, values: Sequence[float], margin: float = 0.5) -> None:
    """Set a chart's y range to the values plus a margin in parts of their span."""
    low, high = min(values), max(values)
    beside = margin * (high - low or 1.0)
    f.y_range.start, f.y_range.end = low - beside, high + beside
