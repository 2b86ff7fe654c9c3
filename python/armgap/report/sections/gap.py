"""Report sections on the size and location of the gap: first chart, and full map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from armgap.report import charts
from armgap.report.page import Bar, Cell, Drawing, HeatMap, Section, Table, Tile
from armgap.report.sections.model_labels import Data, load_text, model_labels, small_unit, torque_unit
from armgap.report.words import error_text, figure, percent, unit_text, variable_text

__all__ = ["first_picture", "gap_map"]

#: Residual torque [N m or N] below which a tile of the map shows one significant digit, to fit on a phone.
SMALL = 0.01
#: Factor by which the map is paler for a diagnosis without a gap, whose map shows noise.
PALE = 5.0
#: A limit of a range counts as zero below this share of the largest limit of its row.
NOTHING = 1e-4


def first_picture(data: Data) -> Section:
    """Return the section with the gap before and after, and the map of the joints and regimes where it lies."""
    gap = data["gap"]
    unit = small_unit(data)
    joints = [f"joint {j + 1}" for j in range(len(gap["before"]))]
    series = [(label, [1e3 * v for v in gap[key]], colour) for label, key, colour in model_labels(data)]
    series.append(("perfect model", [1e3 * v for v in gap["floor"]], charts.FLOOR))
    caption = f"How far: RMS prediction error over {gap['horizon_s']:g} s [{unit}, log scale]"
    chart = charts.bars("", f"{unit}, log scale", joints, series, log=True, height=300)
    key = "before" if data["verdict"] == "parameters" else "refit"
    name = {"before": "arm file's model", "refit": "re-estimated model"}[key]
    what = f"Where: {load_text(data)} missing in the {name} [RMS, {torque_unit(data)}]; below the tiles, the limits of each range"
    return Section("", figures=[Drawing(caption, chart, _bars(data))], heats=_heats(data, [(what, key)]))


def _bars(data: Data) -> Table:
    """Return the chart of the gap as a table with bars of text, longest for the largest error."""
    gap = data["gap"]
    shown = [*((label, key) for label, key, _ in model_labels(data)), ("perfect model", "floor")]
    top = max((v for _, key in shown for v in gap[key]), default=0.0) or 1.0
    rows: list[tuple[Cell, ...]] = [
        (f"joint {j + 1}", label, Bar(gap[key][j] / top, error_text(1e3 * gap[key][j]), charts.BEFORE))
        for j in range(len(gap["before"]))
        for label, key in shown
    ]
    return Table(("joint", "model", f"RMS error over {gap['horizon_s']:g} s [{small_unit(data)}]"), rows)


def _heats(data: Data, wanted: Sequence[tuple[str, str]]) -> list[HeatMap]:
    """Return heat maps of the residual torque on one scale: a row per joint and variable, a tile per range, low values first."""
    regimes = data.get("regimes") or []
    if not regimes:
        return []
    weight = _weights(data)
    order = sorted(regimes, key=lambda r: -weight[r["joint"]][1])
    top = max(v * weight[r["joint"]][0] for r in regimes for _, key in wanted for v in r[key]) or 1.0
    top *= PALE if data["verdict"] == "none" else 1.0
    return [
        HeatMap(
            caption,
            [
                (_row(r), [_tile(data, r, i, v, v * weight[r["joint"]][0] / top) for i, v in enumerate(r[key])])
                for r in order
            ],
        )
        for caption, key in wanted
    ]


def _weights(data: Data) -> dict[int, tuple[float, float]]:
    """Return per joint the factor from its residual torque to the square root of its share of the gap, and the share."""
    share = {p["joint"]: p["share"] for p in data.get("where") or []}
    key = "before" if data["verdict"] == "parameters" else "refit"
    found: dict[int, tuple[float, float]] = {}
    for r in data["regimes"]:
        squares = sum(n * v * v for n, v in zip(r["count"], r[key], strict=True))
        rms = math.sqrt(squares / max(sum(r["count"]), 1))
        part = share.get(r["joint"], 1.0)
        found.setdefault(r["joint"], (math.sqrt(part) / rms if rms > 0 else 0.0, part))
    return found


def _row(regime: Data) -> str:
    """Return joint, variable and unit as label of a row of the map."""
    unit = unit_text(regime["unit"]).replace(" ", "\N{NO-BREAK SPACE}")
    return f"joint {regime['joint']}: {variable_text(regime['variable'])}" + (f" [{unit}]" if unit else "")


def _tile(data: Data, regime: Data, i: int, value: float, depth: float) -> Tile:
    span = _groups(regime)[i]
    reversal = regime["variable"].startswith("reversal")
    text = ("no ", "yes ")[min(i, 1)] if reversal else ""
    low, high = ("", "") if reversal else (_limit(regime, k) for k in (i, i + 1))
    if not regime["count"][i]:
        return Tile("", 0.0, f"{span}: no samples", low=low, high=high)
    tip = f"{span}: {figure(value)} {torque_unit(data)}, {regime['count'][i]} samples"
    return Tile(f"{text}{value:.{2 if value >= SMALL else 1}g}", depth, tip, _stands_out(data, regime, i), low, high)


def _limit(regime: Data, k: int) -> str:
    """Return the k-th limit of a regime's ranges as text; zero where it is negligible relative to the largest limit."""
    edge, largest = regime["edges"][k], max(abs(e) for e in regime["edges"])
    return figure(edge if abs(edge) > NOTHING * largest else 0.0, 2)


def _stands_out(data: Data, regime: Data, i: int) -> bool:
    """Whether a tile is the joint and regime that the first answer names."""
    if data["verdict"] == "none" or not data.get("where"):
        return False
    place = data["where"][0]
    span = place.get("range")
    if not span or (place["joint"], span["variable"]) != (regime["joint"], regime["variable"]):
        return False
    return bool(span["from"] == regime["edges"][i] and span["to"] == regime["edges"][i + 1])


def gap_map(data: Data) -> Section | None:
    """Return the section with the residual torque by joint and regime for each model, as heat maps on one scale and as a table."""
    if not data.get("regimes"):
        return None
    what = load_text(data)
    text = (
        f"The residual {what} of each model: the curvature of the prediction error within each window, times the inertia. All maps share "
        f"one scale, on which each joint's {what} counts against what is typical of that joint. The columns of a row are ranges of its variable "
        "that hold equally many samples; their limits stand below them. A right cause empties the map where it acts."
    )
    wanted = [
        (f"{label[:1].upper()}{label[1:]} [RMS, {torque_unit(data)}]", key) for label, key, _ in model_labels(data)
    ]
    tables = [_table(data)]
    if data.get("energy"):
        tables.append(_energy(data))
    return Section("The gap by joint and regime", text=[text], heats=_heats(data, wanted), tables=tables, columns=2)


def _energy(data: Data) -> Table:
    """Return a table of the residual torque's power, per joint and model."""
    does = {"takes": "takes energy", "gives": "gives energy", "both": "takes and gives back"}
    labels = {key: label for label, key, _ in model_labels(data)}
    rows = [
        [
            f"joint {e['joint']}",
            labels[e["model"]],
            figure(e["power"], 2),
            figure(e["exchanged"], 2),
            percent(e["exchanged"] / e["commanded"]) if e["commanded"] > 0 else "–",
            f"{e['balance']:+.2f}",
            does[e["kind"]],
        ]
        for e in data["energy"]
        if e["model"] in labels
    ]
    head = (
        "joint",
        "model",
        "power [W]",
        "exchanged [W]",
        "of the commanded",
        "balance",
        f"the missing {load_text(data)}",
    )
    return Table(
        head, rows, fold=f"What the missing {load_text(data)} does with energy: friction takes, a spring gives back"
    )


def _groups(regime: Data) -> list[str]:
    """Return the ranges of a regime's variable (such as speed or position) in words."""
    if regime["variable"].startswith("reversal"):
        return ["away from reversals", "near a reversal"][: len(regime["count"])]
    unit = regime["unit"]
    return [f"{regime['variable']} {figure(a)} to {figure(b)} {unit}" for a, b in pairwise(regime["edges"])]


def _table(data: Data) -> Table:
    names = [label for label, _, _ in model_labels(data)]
    rows = [
        (f"joint {r['joint']}", span, str(r["count"][i]), *(figure(r[k][i]) for _, k, _ in model_labels(data)))
        for r in data["regimes"]
        for i, span in enumerate(_groups(r))
    ]
    unit = torque_unit(data)
    return Table(("joint", "where", "samples", *(f"{n} [{unit}]" for n in names)), rows, fold="The same in figures")
