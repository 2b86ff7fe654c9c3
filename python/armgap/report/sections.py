"""The sections of a diagnosis report, in their order; each is a function of the diagnosis as data."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

from armgap.report import charts
from armgap.report.page import Section
from armgap.report.words import figure, joint_text, title

__all__ = ["SECTIONS"]

Data = dict[str, Any]
_STEPS = (
    ("arm file", "before", charts.BEFORE),
    ("re-estimated", "refit", charts.REFIT),
    ("with causes", "after", charts.AFTER),
)


def _unit(data: Data) -> str:
    return str(data["gap"].get("unit", "rad"))


def first_picture(data: Data) -> Section:
    """How far, and where."""
    gap = data["gap"]
    joints = [f"joint {j + 1}" for j in range(len(gap["before"]))]
    series = [(label, [1e3 * v for v in gap[key]], colour) for label, key, colour in _STEPS]
    series.append(("sensor floor", [1e3 * v for v in gap["floor"]], charts.FLOOR))
    how_far = charts.bars(
        f"RMS error over {gap['horizon_s']:g} s on held-out motion [m{_unit(data)}]",
        "",
        joints,
        series,
        log=True,
        height=320,
    )
    caption = f"Torque the model lacks, by joint and regime, from low to high values [RMS, {_torque_unit(data)}]"
    return Section("The gap, and where it lies", figures=[how_far], heat=_map(data), heat_title=caption)


def _torque_unit(data: Data) -> str:
    return str(next((r["torque_unit"] for r in data.get("regimes") or []), "N m"))


def _map(data: Data) -> list[tuple[str, list[tuple[str, float]]]]:
    """The gap by joint and regime: one row per variable, one cell per bin, low values first."""
    regimes = data.get("regimes") or []
    key = "before" if data["verdict"] == "parameters" else "refit"
    rows = []
    for regime in regimes:
        top = max((v for r in regimes if r["joint"] == regime["joint"] for v in r[key]), default=0.0)
        cells = [(_cell(regime, i, v), 0.75 * v / top if top > 0 else 0.0) for i, v in enumerate(regime[key])]
        rows.append((f"joint {regime['joint']}: {regime['variable']}", cells))
    return rows


def _cell(regime: Data, i: int, value: float) -> str:
    return f"{value:.2g}" if regime["count"][i] else ""


def predictions(data: Data) -> Section:
    """Predicted against measured."""
    figures: list[Any] = []
    unit = _unit(data)
    for series in data.get("series") or []:
        curves = [("measured", series["measured"], charts.MEASURED)]
        curves += [(label, series[key], colour) for label, key, colour in _STEPS]
        figures.append(
            charts.lines(
                f"{series['log']}, joint {series['joint']}",
                "time [s]",
                f"position [{unit}]",
                series["t"],
                curves,
                breaks=series["window_start"],
                share=figures[-1] if figures and series["joint"] > 1 else None,
            )
        )
    text = (
        "Each window starts from its measured state and runs under the logged torque. Zoom with the wheel, click a name in the legend to "
        "hide its curve."
    )
    return Section(
        "Predicted against measured, on held-out motion",
        text=[text] if figures else ["No curves were kept."],
        figures=figures,
    )


def gap_map(data: Data) -> Section:
    """The gap by joint and regime, before and after."""
    figures = []
    for regime in data.get("regimes") or []:
        edges = regime["edges"]
        groups = [f"{a:.3g} … {b:.3g}" for a, b in pairwise(edges)]
        series = [(label, regime[key], colour) for label, key, colour in _STEPS]
        figures.append(
            charts.bars(
                f"Joint {regime['joint']}: torque the model lacks over {regime['variable']} [{regime['unit']}]",
                f"RMS [{regime.get('torque_unit', 'N m')}]",
                groups,
                series,
                log=True,
                height=240,
            )
        )
    text = "From the curvature of the prediction error within each window, times the inertia: the torque that the model lacks."
    return Section("The gap by joint and regime", text=[text], figures=figures, fold=True)


def ranking(data: Data) -> Section:
    """The candidates against each other."""
    ranked = data.get("ranking") or []
    header = (
        "candidate",
        "where",
        "share of the gap removed",
        f"RMS [m{_unit(data)}]",
        "size",
        "distance from trusted values",
    )
    rows = [
        (
            title(r["effect"]),
            joint_text(r["joint"]),
            f"{max(r['closed'], -9.99):.0%}",
            " / ".join(figure(1e3 * v) for v in r["rms"]),
            ", ".join(f"{name} {figure(p['value'])} {p['unit']}" for name, p in r["parameters"].items()),
            figure(r.get("trust", 0.0)),
        )
        for r in ranked
    ]
    causes = data.get("causes") or []
    look_alikes = [
        f"{title(c['effect'])} ({joint_text(c['joint'])}) looks like {title(e['effect'])} ({joint_text(e['joint'])}): {e['why']}."
        for c in causes
        for e in c["equivalents"]
    ]
    figures = []
    if ranked:
        names = [f"{title(r['effect'])}, {joint_text(r['joint'])}" for r in ranked]
        shares = [max(100 * r["closed"], 0.0) for r in ranked]
        figures.append(
            charts.bars(
                "Share of the gap above the floor that each candidate removes alone [%]",
                "",
                names,
                [("share", shares, charts.AFTER)],
            )
        )
    text = [
        "Every candidate was tested to first order; those that passed were fitted together with the arm's parameters on the training logs and "
        "judged on held-out motion. The share counts held-out windows with their tails cut."
    ]
    return Section(
        "Ranking of causes", text=text, figures=figures, tables=[(header, rows)] if rows else [], notes=look_alikes
    )


def parameters(data: Data) -> Section:
    """The arm's parameters."""
    tables = data["parameters"]
    names = list((data.get("arm") or {}).get("parameter_names") or tables["nominal"])
    rows = []
    for name in names:
        nominal, refit, final = (_value(tables[k].get(name)) for k in ("nominal", "refit", "with_causes"))
        rows.append((name, nominal[0], refit[0], final[0], nominal[1]))
    for cause in data.get("causes") or []:
        for name, p in cause["parameters"].items():
            label = f"{cause['effect']}.{name} ({joint_text(cause['joint'])})"
            rows.append((label, "", "", f"{figure(p['value'], 4)} ± {figure(p['sigma'], 2)}", p["unit"]))
    header = ("parameter", "arm file", "re-estimated", "with causes", "unit")
    return Section("Parameters", tables=[(header, rows)])


def _value(entry: Any) -> tuple[str, str]:
    if isinstance(entry, dict):
        return f"{figure(entry['value'], 4)} ± {figure(entry['sigma'], 2)}", str(entry.get("unit", ""))
    return ("" if entry is None else figure(float(entry), 4)), ""


def ruled_out(data: Data) -> Section:
    """What was looked for and not found."""
    rows = []
    for r in data.get("ruled_out") or []:
        bound = r.get("bound")
        limit = f"{bound['parameter']} within {figure(bound['value'])} {bound['unit']} (95 %)" if bound else ""
        rows.append((title(r["effect"]), joint_text(r["joint"]), r["status"], limit, r.get("why") or ""))
    header = ("candidate", "where", "status", "bound", "why")
    return Section("What was looked for and not found", tables=[(header, rows)] if rows else [], fold=True)


def free_run(data: Data) -> Section:
    """The whole holdout from its first sample."""
    gap, unit = data["gap"], _unit(data)
    run = gap["free_run"]
    text = (
        "Simulated from the first sample of the log to its last, errors add up: RMS "
        f"{' / '.join(figure(1e3 * v) for v in run['before'])} m{unit} with the arm file, "
        f"{' / '.join(figure(1e3 * v) for v in run['after'])} m{unit} with the causes."
    )
    figures = [
        charts.lines(
            f"{s['log']}, joint {s['joint']}, free run",
            "time [s]",
            f"position [{unit}]",
            s["t"],
            [
                ("measured", s["measured"], charts.MEASURED),
                ("arm file", s["before"], charts.BEFORE),
                ("with causes", s["after"], charts.AFTER),
            ],
        )
        for s in data.get("free_run_series") or []
    ]
    return Section("Free run", text=[text], figures=figures, fold=True)


def quality(data: Data) -> Section:
    """The logs, what was noticed in them, and remarks."""
    header = ("log", "use", "samples", "duration [s]", "windows")
    rows = [
        (log["name"], use, str(log["samples"]), figure(log["duration_s"], 4), str(log["windows"]))
        for use in ("training", "holdout")
        for log in data.get(use) or []
    ]
    noise = data.get("noise") or {}
    found = [f"{f['log']}: {f['message']}." for f in data.get("log_findings") or []]
    remarks = [f"Note: {note}." for note in data.get("notes") or []]
    text = []
    if noise:
        sigma = " / ".join(figure(1e3 * v) for v in noise["position_sigma"])
        step = " / ".join(figure(1e3 * v) if v else "none seen" for v in noise["encoder_step"])
        text.append(
            f"Position noise (one sigma, per joint): {sigma} m{_unit(data)}; encoder step: {step} m{_unit(data)}."
        )
    return Section("The logs", text=text, tables=[(header, rows)], notes=[*found, *remarks])


def method(data: Data) -> Section:
    """How it was computed."""
    options = data.get("options") or {}
    listed = ", ".join(f"{key} {value}" for key, value in options.items())
    text = [
        "The logs are cut into short windows. Each starts from its measured state, which is itself fitted within its noise, and runs under the "
        "logged torque through a simulator with dry friction whose reversals are located inside the steps. Parameters and effects are fitted "
        "together to the positions; what the arm file states with its sigmas enters as prior knowledge.",
        f"Options: {listed}. armgap {data.get('version', '')}, {figure(data.get('seconds') or 0.0)} s.",
    ]
    return Section("How this was computed", text=text, fold=True)


SECTIONS: tuple[Callable[[Data], Section], ...] = (
    first_picture,
    predictions,
    gap_map,
    ranking,
    parameters,
    ruled_out,
    free_run,
    quality,
    method,
)
"""Every section, in the order of the page."""
