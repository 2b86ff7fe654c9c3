"""Charts: one look for all of them, one meaning per colour, drawn on a transparent ground for light and dark pages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["AFTER", "BEFORE", "FLOOR", "MEASURED", "REFIT", "bars", "lines"]

# Okabe and Ito's colour-blind-safe palette; the greys are readable on white and on near-black.
MEASURED = "#808080"
BEFORE = "#D55E00"
REFIT = "#E69F00"
AFTER = "#0072B2"
FLOOR = "#009E73"
_INK = "#808890"


def figure(title: str, x_label: str, y_label: str, **options: Any) -> Any:
    """Return an empty figure in the common look."""
    from bokeh.plotting import figure as make

    settings: dict[str, Any] = {
        "height": 260,
        "sizing_mode": "stretch_width",
        "tools": "pan,xwheel_zoom,box_zoom,reset,save",
        "toolbar_location": "above",
        "output_backend": "canvas",
    }
    f = make(title=title, **(settings | options))
    f.background_fill_color = f.border_fill_color = None
    f.outline_line_color = None
    f.title.text_color = _INK
    f.title.text_font_size = "14px"
    f.toolbar.logo = None
    for axis, label in ((f.xaxis[0], x_label), (f.yaxis[0], y_label)):
        axis.axis_label = label
        axis.axis_label_text_color = axis.major_label_text_color = _INK
        axis.axis_line_color = axis.major_tick_line_color = _INK
        axis.axis_label_text_font_style = "normal"
        axis.minor_tick_line_color = None
    f.grid.grid_line_color = _INK
    f.grid.grid_line_alpha = 0.2
    return f


def _legend(f: Any) -> None:
    legend = f.legend[0]
    legend.background_fill_alpha = 0.0
    legend.border_line_color = None
    legend.label_text_color = _INK
    legend.click_policy = "hide"
    legend.orientation = "horizontal"
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
    share: Any = None,
    **options: Any,
) -> Any:
    """Curves over a common abscissa.

    Parameters
    ----------
    title, x_label, y_label : str
        Texts.
    x : array_like, shape (n,)
        Abscissa.
    curves : sequence of (label, values, colour)
        Values have shape (n,).
    breaks : sequence of int
        Indices before which a line is lifted.
    levels : sequence of (label, value, colour)
        Horizontal lines.
    share : figure, optional
        Figure whose x range is shared.
    """
    f = figure(title, x_label, y_label, **options)
    if share is not None:
        f.x_range = share.x_range
    gaps = [b for b in breaks if b > 0]
    abscissa = np.insert(np.asarray(x, dtype=float), gaps, np.nan)
    for label, values, colour in curves:
        y = np.insert(np.asarray(values, dtype=float), gaps, np.nan)
        width = 2.5 if colour == MEASURED else 1.3
        f.line(abscissa, y, legend_label=label, color=colour, line_width=width)
    for label, value, colour in levels:
        f.line([abscissa[0], abscissa[-1]], [value, value], legend_label=label, color=colour, line_dash="dashed")
    _legend(f)
    return f


def bars(
    title: str,
    y_label: str,
    groups: Sequence[str],
    series: Sequence[tuple[str, Sequence[float], str]],
    *,
    log: bool = False,
    x_label: str = "",
    **options: Any,
) -> Any:
    """Grouped bars; with `log` the axis is logarithmic and values of zero are left out."""
    from bokeh.models import ColumnDataSource, FactorRange, LabelSet

    factors = [(group, label) for group in groups for label, _, _ in series]
    scale = {"y_axis_type": "log"} if log else {}
    f = figure(title, x_label, y_label, x_range=FactorRange(*factors), **(scale | options))
    positive = [v for _, values, _ in series for v in values if v > 0]
    if positive:
        f.y_range.end = max(positive) * (2.5 if log else 1.15)
    bottom = 0.5 * min(positive) if log and positive else 0.0
    for i, (label, values, colour) in enumerate(series):
        tops = [v if v > 0 or not log else bottom for v in values]
        data = {
            "x": [(group, series[i][0]) for group in groups],
            "top": tops,
            "text": [f"{v:.3g}" for v in values],
        }
        source = ColumnDataSource(data)
        f.vbar("x", top="top", bottom=bottom, width=0.9, color=colour, source=source, legend_label=label)
        labels = LabelSet(x="x", y="top", text="text", source=source, text_align="center", y_offset=2)
        labels.text_color, labels.text_font_size = _INK, "11px"
        f.add_layout(labels)
    f.xaxis.major_label_text_alpha = 0
    f.xaxis.major_label_text_font_size = "0px"
    f.xaxis.major_tick_line_color = None
    f.xaxis.group_text_color = _INK
    f.xgrid.grid_line_color = None
    _legend(f)
    return f
