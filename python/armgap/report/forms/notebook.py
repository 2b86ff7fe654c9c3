"""A diagnosis in a notebook: a summary card, plots, and a table of candidates.

Plots need matplotlib (``pip install 'armgap[notebook]'``); the card and the table do not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from armgap._renamed import old_names
from armgap.errors import ArmgapError, OptionError
from armgap.literals import SERIAL
from armgap.report import charts, words
from armgap.report.sections.model_labels import joint_unit, model_labels, small_unit, torque_unit
from armgap.several_joints import by_joint

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.axes import Axes

__all__ = ["NotebookDisplay", "PlotLibraryMissingError"]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__)

Data = dict[str, Any]

_OTHER = "of serial arms plot gap, prediction or error"


class PlotLibraryMissingError(ArmgapError, ImportError):
    """Error: plots were requested but matplotlib is not installed."""


class _EffectOnJoint(Protocol):
    """Attributes that causes and equivalent effects share."""

    @property
    def effect(self) -> str: ...
    @property
    def joint(self) -> int | None: ...


class NotebookDisplay:
    """Base class of results with a notebook display, made from the JSON object of `to_dict`."""

    def to_dict(self) -> Data:
        """Return the result as a JSON object."""
        raise NotImplementedError

    def _repr_html_(self) -> str:
        """Return verdict and answers of the result as an HTML card."""
        return card(self.to_dict())

    def plot(
        self, finding: str | _EffectOnJoint = "gap", *, joint: int = 1, log: str | None = None, ax: Axes | None = None
    ) -> Axes:
        """Draw one finding with matplotlib.

        Parameters
        ----------
        finding : {"gap", "where", "ranking", "prediction", "error"} or Cause, default "gap"
            Prediction error by joint, map of the residual torque, ranking of candidates, predicted and measured
            positions, their difference; or a cause, for its evidence.
        joint : int, default 1
            1-based joint of a prediction or an error.
        log : str, optional
            Held-out log of a prediction or an error; by default the first.
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; by default a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        PlotLibraryMissingError
            If matplotlib is not installed.
        OptionError
            If the finding does not exist.
        """
        data = self.to_dict()
        if not isinstance(finding, str):
            return _law(data, finding, _axes(ax))
        if finding in ("prediction", "error"):
            return _curves(data, finding, joint, log, _axes(ax))
        if finding not in _PLOTS:
            known = ", ".join([*_PLOTS, "prediction", "error"])
            raise OptionError(f"there is no finding `{finding}`", remedy=f"ask for one of {known}, or give a cause")
        return _PLOTS[finding](data, _axes(ax))

    def to_polars(self) -> pl.DataFrame:
        """Return every candidate as a row: named causes first, then candidates that were not found.

        Returns
        -------
        polars.DataFrame
            Columns ``effect``, ``joint`` (null for the whole arm), ``status`` (``named``, ``absent``, ``not excited``,
            ``undecided``), ``probability``, ``closed``, ``parameter``, ``value``, ``sigma``, ``bound``, ``unit``; a cause has a row
            for each of its parameters.
        """
        import polars as pl

        return pl.DataFrame(_rows(self.to_dict()), schema=_SCHEMA)


def card(data: Data) -> str:
    """Return verdict and answers as HTML in the notebook's own colours, every string escaped."""
    from jinja2 import Environment

    template = Environment(autoescape=True).from_string(_CARD)
    return template.render(verdict=words.verdict(data), answers=words.answers(data))


_CARD = """\
<div style="max-width: 60em">
<p style="font-size: 1.2em; font-weight: bold; margin: 0 0 .4em">{{ verdict }}</p>
<dl style="display: grid; grid-template-columns: max-content 1fr; gap: .3em 1em; margin: 0">
{% for a in answers %}<dt style="opacity: .7">{{ a.question }}</dt><dd style="margin: 0"><b>{{ a.headline }}</b><br>{{ a.detail }}</dd>
{% endfor %}</dl></div>"""

_SCHEMA = {
    "effect": str,
    "joint": int,
    "status": str,
    "probability": float,
    "closed": float,
    "parameter": str,
    "value": float,
    "sigma": float,
    "bound": float,
    "unit": str,
}


def _rows(data: Data) -> list[Data]:
    empty = dict.fromkeys(_SCHEMA)
    rows = [
        empty
        | {"effect": c["effect"], "joint": c["joint"], "status": "named", "probability": c["probability"]}
        | {"closed": c["closed"], "parameter": name, **p}
        for c in by_joint(data.get("causes") or [])
        for name, p in c["parameters"].items()
    ]
    for r in data.get("ruled_out") or []:
        bound = r.get("bound") or {}
        limit = {"parameter": bound.get("parameter"), "bound": bound.get("value"), "unit": bound.get("unit")}
        rows.append(empty | {"effect": r["effect"], "joint": r["joint"], "status": r["status"]} | limit)
    return rows


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot
    except ImportError:
        raise PlotLibraryMissingError(
            "plots need matplotlib, which is not installed", remedy="pip install 'armgap[notebook]'"
        ) from None
    made: Axes = pyplot.subplots(figsize=(7.0, 3.6), layout="constrained")[1]
    return made


def _gap(data: Data, ax: Axes) -> Axes:
    gap = data["gap"]
    shown = [*model_labels(data), ("perfect model", "floor", charts.FLOOR)]
    width = 0.8 / len(shown)
    for i, (label, key, colour) in enumerate(shown):
        at = [j + (i - (len(shown) - 1) / 2) * width for j in range(len(gap[key]))]
        ax.bar(at, [1e3 * v for v in gap[key]], 0.9 * width, color=colour, label=label)
    ax.set_yscale("log")
    ax.set_xticks(range(len(gap["before"])), [f"joint {j + 1}" for j in range(len(gap["before"]))])
    return _finish(ax, f"RMS error over {gap['horizon_s']:g} s on held-out motion", "", f"[{small_unit(data)}]")


def _where(data: Data, ax: Axes) -> Axes:
    regimes = data.get("regimes") or []
    if not regimes:
        raise OptionError(
            "this diagnosis has no map of the gap", remedy=_OTHER if _is_serial(data) else "diagnose the logs again"
        )
    width = max(len(r["refit"]) for r in regimes)
    tiles = [[*r["refit"], *([float("nan")] * (width - len(r["refit"])))] for r in regimes]
    image = ax.imshow(tiles, aspect="auto", cmap="cividis")
    ax.set_yticks(range(len(regimes)), [f"joint {r['joint']}: {words.variable_text(r['variable'])}" for r in regimes])
    ax.set_xticks([0, width - 1], ["low", "high"])
    ax.figure.colorbar(image, ax=ax, label=f"residual torque of the re-estimated model, RMS [{torque_unit(data)}]")
    return ax


def _is_serial(data: Data) -> bool:
    return (data.get("arm") or {}).get("kind") == SERIAL


def _ranking(data: Data, ax: Axes) -> Axes:
    ranked = list(reversed(data.get("ranking") or []))
    if not ranked and _is_serial(data):
        raise OptionError("a serial arm's diagnosis has no ranking", remedy=_OTHER)
    named = {(c["effect"], c["joint"]) for c in data.get("causes") or []}
    colours = [charts.AFTER if (r["effect"], r["joint"]) in named else charts.MEASURED for r in ranked]
    ax.barh([words.named(r) for r in ranked], [max(100 * r["closed"], 0.0) for r in ranked], color=colours)
    ax.set_xlabel("share of the gap removed alone [%]")
    return ax


def _law(data: Data, cause: _EffectOnJoint, ax: Axes) -> Axes:
    place = (cause.effect, cause.joint, getattr(cause, "log", None))
    drawn = [x for x in data.get("laws") or [] if x.get("bins")]
    law = next((x for x in drawn if (x["effect"], x["joint"], x.get("log")) == place), None)
    if law is None:
        raise OptionError(f"there is no evidence on `{cause.effect}` to draw", remedy="give one of the named causes")
    bins, points = law["bins"], law["points"]
    ax.plot(points["x"], points["y"], ".", color=charts.MEASURED, alpha=0.5, label="samples")
    ax.errorbar(
        bins["x"], bins["mean"], bins["error"], fmt="o", color=charts.BEFORE, mfc="none", label="mean residual torque"
    )
    ax.plot(bins["x"], bins["law"], color=charts.AFTER, lw=2, label="fitted law")
    x = f"{law['variable']} [{words.unit_text(law['unit'])}]"
    return _finish(ax, words.named(law), x, f"torque on joint {law['shown_joint']} [{law['torque_unit']}]")


def _curves(data: Data, what: str, joint: int, log: str | None, ax: Axes) -> Axes:
    series = data.get("series") or []
    found = next((s for s in series if s["joint"] == joint and log in (None, s["log"])), None)
    if found is None:
        known = ", ".join(dict.fromkeys(s["log"] for s in series))
        raise OptionError(f"no prediction of joint {joint} of {log or 'any log'}", remedy=f"logs kept are {known}")
    unit = joint_unit(data, joint)
    if what == "prediction":
        ax.plot(found["t"], found["measured"], color=charts.MEASURED, lw=2.5, label="measured")
    for label, key, colour in model_labels(data):
        y = (
            found[key]
            if what == "prediction"
            else [1e3 * (m - p) for m, p in zip(found["measured"], found[key], strict=True)]
        )
        ax.plot(found["t"], _lifted(y, found["window_start"]), color=colour, lw=1.2, label=label)
    y_label = f"position [{unit}]" if what == "prediction" else f"measured minus predicted [m{unit}]"
    return _finish(ax, f"{found['log']}, joint {joint}", "time [s]", y_label)


def _lifted(values: list[float], starts: list[int]) -> list[float]:
    """Return a curve of predictions with NaN in place of the first value of each window but the first, so that windows are drawn apart."""
    first = set(starts[1:])
    return [float("nan") if i in first else v for i, v in enumerate(values)]


def _finish(ax: Axes, title: str, x_label: str, y_label: str) -> Axes:
    # A dollar sign in the name of a log does not start a formula.
    ax.set_title(title, parse_math=False)
    ax.set_xlabel(x_label)
    ax.set_ylabel(y_label)
    ax.grid(visible=True, alpha=0.3)
    ax.legend(frameon=False)
    return ax


_PLOTS = {"gap": _gap, "where": _where, "ranking": _ranking}
