"""Report sections on causes: evidence for each cause, ranking of candidates, and equivalent effects."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from armgap.report import charts
from armgap.report.page import Bar, Cell, Drawing, Section, Table
from armgap.report.sections.model_labels import Data, load_text, small_unit, torque_unit
from armgap.report.symbols import depends_text, symbol_text
from armgap.report.words import error_text, figure, named, percent, sizes, title
from armgap.several_joints import place_text

__all__ = ["candidates", "evidence", "look_alikes", "ranking", "unnamed"]

#: Smallest share of the gap that is shown; smaller shares are shown as this value.
_WORST_SHARE = -9.99
#: Share of a cause's evidence explained by its law from which a report says that the law explains all of it.
ALL = 0.995
#: Number of candidates that the ranking shows; further candidates are in a folded table.
SHOWN = 8


def evidence(data: Data) -> Section | None:
    """Return the section with evidence for each cause: residual torque over the cause's variable, with the fitted law."""
    laws = [law for law in data.get("laws") or [] if law.get("bins")]
    if not laws:
        return None
    what = load_text(data)
    text = (
        f"Dots: the residual {what} of the model without this cause, on held-out motion. Rings: its mean over a range, with the 95 % interval. "
        "Line: what the fitted law adds in the same samples. A law that is right runs through the rings. Samples at rest are left out, "
        f"where dry friction hides every other {what}."
    )
    notes = [f"{_name(law)}: {_verdict(law)}" for law in laws]
    drawn = [Drawing(_caption(law), charts.law(law)) for law in laws]
    return Section(
        "The evidence: each cause against its own variable", text=[text], figures=drawn, notes=notes, columns=2
    )


def _name(law: Data) -> str:
    text = named(law)
    return text[:1].upper() + text[1:]


def _caption(law: Data) -> str:
    along = " along the motion" if law["folded"] else ""
    what = "force" if law["torque_unit"] == "N" else "torque"
    return f"{_name(law)}: {what} on joint {law['shown_joint']}{along} [{law['torque_unit']}] over the {symbol_text(law['variable'])}"


def _verdict(law: Data) -> str:
    share = law["explained"]
    failed = f"; {law['failed']} windows could not be simulated ({law.get('why', '')})" if law["failed"] else ""
    if share > ALL:
        return f"the law explains all of what the ranges' means show{failed}."
    if share <= 0:
        return f"the law explains none of what the ranges' means show{failed}."
    return f"the law explains {percent(share)} of what the ranges' means show (mean square){failed}."


def unnamed(data: Data) -> Section | None:
    """Return the section on variables that the remaining residual torque depends on, with a chart of the torque over each variable."""
    found = data.get("unnamed") or []
    if not found:
        return None
    unit = torque_unit(data)
    text = (
        f"The {load_text(data)} that stays depends on these variables, in logs that each table was not fitted to. No effect of the library is "
        "behind them: they are tables, and another load or motion may have others. Each is drawn beside its mean: over one variable with 95 % "
        "intervals, over two by colour."
    )
    header = (
        "joint",
        "depends on",
        f"share of the {load_text(data)} that stays (variance)",
        f"largest [{unit}]",
    )
    rows = [
        (
            str(d["joint"]),
            depends_text(d),
            Bar(d["share"], percent(d["share"]), charts.MEASURED),
            figure(max(abs(y) for y in _torques(d))),
        )
        for d in found
    ]
    drawn = [
        Drawing(f"Joint {d['joint']}: {load_text(data)} [{unit}] over {depends_text(d)}", charts.dependence(d, unit))
        for d in found
    ]
    return Section("What the rest depends on", text=[text], tables=[Table(header, rows)], figures=drawn, columns=2)


def _torques(entry: Data) -> list[float]:
    """Return the torques of a table without a name."""
    grid = entry.get("grid")
    return [y for row in grid["torque"] for y in row] if grid else entry["law"]["torque"]


def ranking(data: Data) -> Section | None:
    """Return the section with the ranking of candidates: share of the gap that each removes alone, and probability of the named causes."""
    ranked = data.get("ranking") or []
    if not ranked:
        return None
    header = (
        "candidate",
        "share of the gap removed",
        "probability",
        f"RMS per joint [{small_unit(data)}]",
        "size",
        "distance from trusted values [σ²]",
    )
    text = (
        "Every candidate was tested to first order; those that passed were fitted one by one together with the arm's parameters on the "
        "training logs and judged on held-out motion. The share counts held-out windows with their tails cut. The last column says how far the arm's "
        "own parameters had to leave the values that the arm file trusts."
    )
    rows = [_rank(data, r) for r in ranked]
    tables = [Table(header, rows[:SHOWN])]
    if rows[SHOWN:]:
        tables.append(Table(header, rows[SHOWN:], fold=f"{len(rows) - SHOWN} more"))
    return Section("Ranking of causes", text=[text], tables=tables, notes=_course(data))


def _rank(data: Data, r: Data) -> tuple[Cell, ...]:
    share = max(r["closed"], _WORST_SHARE)
    cause = _cause(data, r)
    return (
        named(r),
        Bar(min(max(share, 0.0), 1.0), percent(share), charts.AFTER if cause else charts.MEASURED),
        f"{cause['probability']:.2f}" if cause else "",
        " / ".join(error_text(1e3 * v) for v in r["rms"]),
        sizes(r["parameters"]),
        figure(r.get("trust", 0.0)),
    )


def _cause(data: Data, ranked: Data) -> Any:
    place = (ranked["effect"], ranked["joint"])
    return next((c for c in data.get("causes") or [] if (c["effect"], c["joint"]) == place), None)


def _course(data: Data) -> list[str]:
    """Return sentences on the order in which the model search added the causes."""
    stages = data.get("stages") or []
    unit = small_unit(data)
    lines: list[str] = []
    for before, after in pairwise(stages):
        if before.get("added"):
            errors = [" / ".join(error_text(1e3 * v) for v in s["rms"]) for s in (before, after)]
            lines.append(
                f"Step {len(lines) + 1}: {named(before['added'])} was added, and the error fell from {errors[0]} to {errors[1]} {unit}."
            )
    return lines


def candidates(data: Data) -> Section | None:
    """Return the section with candidates that were fitted but are not named as causes, and the reasons."""
    found = data.get("candidates") or []
    if not found:
        return None
    rows = [
        (named(c), f"{c['probability']:.2f}", sizes(c["parameters"]), percent(c["closed"]), c.get("why") or "")
        for c in found
    ]
    text = "These were fitted like causes, but do not stand on their own. Take them as hints of what to look at, not as findings."
    header = ("candidate", "probability", "size", "share of the gap removed", "why it is no named cause")
    return Section("Candidates not fit for the headline", points=[text], tables=[Table(header, rows)])


def look_alikes(data: Data) -> Section | None:
    """Return the section with effects that the logs do not distinguish from the named causes, and the reasons."""
    rows = [
        (
            f"{title(c['effect'])} ({place_text(c)})",
            f"{title(e['effect'])} ({place_text(e)})",
            e["why"],
        )
        for c in data.get("causes") or []
        for e in c.get("equivalents") or []
    ]
    if not rows:
        return None
    text = (
        "Each of these would explain the logs as well as the cause it stands beside. The last column says whether another motion may decide, "
        "or what else does."
    )
    return Section("What looks alike", text=[text], tables=[Table(("named", "could also be", "why"), rows)])
