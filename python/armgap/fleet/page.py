"""HTML page of a fleet: robots by cause, drifting parameters, robots that differ from the others, and failed entries."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from armgap.fleet.drift import FALSE_ALARMS
from armgap.fleet.outliers import FALSE_FLEETS, FEWEST_ROBOTS
from armgap.fleet.series import Move, Odd, moving, numbered, odd
from armgap.fleet.tables import owner_text
from armgap.report import charts
from armgap.report.document import Document
from armgap.report.page import Bar, Drawing, Section, Table
from armgap.report.words import SummaryAnswer, figure, parameter_text, title
from armgap.several_joints import joint_text

if TYPE_CHECKING:
    from armgap.fleet.folder import Fleet

__all__ = ["fleet_document", "moved", "plain_time"]

# Charts and table rows that the fleet's page shows at most; the tables on disk hold all.
_CHARTS, _MAX_TABLE_ROWS = 6, 40
# Digits of values that differ, and difference in percent from which only the values are given.
_DIGITS, _MOST_PERCENT = 4, 1e3
_EMPTY = "-"
_MIDNIGHT = "T00:00:00"


def fleet_document(fleet: Fleet) -> Document:
    """Return the page of a fleet as a document."""
    robots = fleet.summary["robot"].n_unique()
    moves, odd_ones = list(moving(fleet.parameters)), odd(fleet.parameters)
    failed, done = fleet.failed.height, fleet.summary.filter(pl.col("error").is_null())
    diagnoses = done.unique(["robot", "time", "seconds"]).height
    lead = f"{diagnoses} diagnoses of {robots} robots; entries without one: {failed}."
    answers = [
        SummaryAnswer("What drifts?", *_listed([moved(m) for m in moves], "nothing", "parameters that grow or fall steadily")),
        SummaryAnswer("Which robot is the odd one?", *_listed([_odd_one(o) for o in odd_ones], "none", "values far from the other robots'")),
        SummaryAnswer("What is most often the cause?", *_commonest(fleet)),
    ]  # fmt: skip
    sections = [_causes(fleet.summary), _moving(fleet.parameters, moves), _odd(odd_ones), _failures(fleet.failed)]
    return Document("Fleet", lead, answers, [section for section in sections if section is not None])


def moved(move: Move) -> str:
    """Return a drift as a sentence without its full stop."""
    return f"{move.robot}: {_named(move.of, move.name)} by {_rate(move)} per visit since {_since(move)}"


def _rate(move: Move) -> str:
    return f"{100 * move.drift.rate:+.1f} %"


def _since(move: Move) -> str:
    return plain_time(move.since) if move.since else f"visit {move.visit}"


def plain_time(time: str | None) -> str:
    """Return a time for a reader: midnight as a day, an unknown time as a dash."""
    return (time or _EMPTY).removesuffix(_MIDNIGHT)


def _odd_one(found: Odd) -> str:
    usual, others = found.outlier.usual, found.outlier.others
    values = f"{figure(usual, _DIGITS)}, the others' {figure(others, _DIGITS)}"
    part = (usual - others) / abs(others) if others else 0.0
    by = f" ({100 * part:+.2g} %)" if 0.0 < 100 * abs(part) < _MOST_PERCENT else ""
    return f"{found.robot}: {_named(found.of, found.name)} is {values}{by}"


def _named(of: str, name: str) -> str:
    if of == "arm":
        meaning = parameter_text("", name)
        return f"{meaning} ({name})" if meaning else name
    return f"{name} of {owner_text(of)}"


def _listed(found: list[str], none: str, of: str) -> tuple[str, str]:
    if not found:
        return none, of
    more = f"; {len(found) - 1} more below" if len(found) > 1 else ""
    return found[0], f"{of}{more}"


def _commonest(fleet: Fleet) -> tuple[str, str]:
    if fleet.settings.get("max_causes") == 0:
        return "not asked", "no cause was to be named, parameters only were estimated"
    named = fleet.summary.filter(pl.col("effect").is_not_null())
    if not named.height:
        return "nothing is named", "no diagnosis names an effect"
    counts = named.group_by(["effect", "joint"]).agg(pl.col("robot").n_unique().alias("robots"))
    first = counts.sort(["robots", "effect", "joint"], descending=[True, False, False], nulls_last=True).row(
        0, named=True
    )
    return (
        f"{title(first['effect'])}, {joint_text(first['joint'])}",
        f"on {first['robots']} {'robot' if first['robots'] == 1 else 'robots'}",
    )


def _causes(summary: pl.DataFrame) -> Section:
    robots = summary["robot"].n_unique()
    named = summary.with_columns(what=pl.col("effect").fill_null(pl.col("verdict")))
    groups = named.filter(pl.col("error").is_null()).group_by(["what", "joint"]).agg(
        pl.col("robot").unique().sort().alias("robots"),
        pl.len().alias("entries"),
        pl.col("probability").median().alias("probability"),
    )  # fmt: skip
    rows = [
        (
            _cause(r["what"], r["joint"]),
            Bar(len(r["robots"]) / robots, f"{len(r['robots'])} of {robots}", charts.AFTER),
            str(r["entries"]),
            figure(r["probability"], 2) if r["probability"] is not None else _EMPTY,
            ", ".join(r["robots"][:_MAX_TABLE_ROWS]) + (" …" if len(r["robots"]) > _MAX_TABLE_ROWS else ""),
        )
        for r in groups.sort(["entries", "what", "joint"], descending=[True, False, False]).to_dicts()
    ]
    header = ("cause, or verdict without one", "robots", "entries", "median probability", "which")
    return Section("Robots by cause", tables=[Table(header, rows[:_MAX_TABLE_ROWS])])


def _cause(what: str, joint: int | None) -> str:
    verdicts = {
        "none": "no gap",
        "parameters": "parameters suffice",
        "unexplained": "unexplained",
        "input": "input contradicts itself",
    }
    return verdicts.get(what) or f"{title(what)}, {joint_text(joint)}"


def _moving(parameters: pl.DataFrame, moves: list[Move]) -> Section:
    text = (
        "A parameter drifts if its logarithm, less what all robots did that day, follows a ramp from some visit to the last. "
        "Noise shows one at most once in "
        f"{1 / FALSE_ALARMS:.0f} visits of the whole fleet, all parameters together. "
        "A robot needs six visits before anything is said of it."
    )
    header = ("robot", "parameter", "since", "per visit", "standard deviations", "needed")
    rows = [
        (
            m.robot,
            _named(m.of, m.name),
            _since(m),
            _rate(m),
            f"{m.drift.evidence:.1f}",
            f"{m.drift.threshold:.1f}",
        )
        for m in moves[:_MAX_TABLE_ROWS]
    ]
    tables = [Table(header, rows)] if rows else []
    points = [] if rows else ["Nothing drifts that these visits can tell."]
    drawings = [_course(parameters, move) for move in moves[:_CHARTS]]
    return Section("Over time", text=[text], points=points, tables=tables, figures=drawings, columns=2)


def _course(parameters: pl.DataFrame, move: Move) -> Drawing:
    """Return a chart of one robot's parameter over its visits, with its 95 % interval."""
    robot, of, name = move.robot, move.of, move.name
    of_robot = (pl.col("robot") == robot) & (pl.col("of") == of) & (pl.col("name") == name)
    rows = numbered(parameters).filter(of_robot & pl.col("value").is_not_null())
    value, sigma = rows["value"].to_numpy(), rows["sigma"].fill_null(0.0).to_numpy()
    visits = rows["visit"].to_numpy().astype(np.float64)
    unit = rows["unit"][0] or ""
    chart = charts.figure(f"{robot}: {_named(of, name)}", "visit", f"{name} [{unit}]" if unit else name)
    chart.varea(visits, value - 1.96 * sigma, value + 1.96 * sigma, color=charts.MEASURED, alpha=0.25)
    chart.vspan(x=[move.visit], color=charts.BEFORE, line_dash="dashed")
    chart.line(visits, value, color=charts.AFTER, line_width=2)
    chart.scatter(visits, value, color=charts.AFTER, size=5)
    return Drawing(
        f"{name} of {robot} over its visits, with 95 % intervals; dashed the visit since which it drifts.", chart
    )


def _odd(found: list[Odd]) -> Section:
    text = (
        "A robot is odd if its mean over its visits differs from the other robots' by more than their scatter and that of visits can make. "
        f"One is called so in at most {100 * FALSE_FLEETS:.0f} % of fleets of like robots, all robots and parameters together. "
        f"Few robots show large differences only, fewer than {FEWEST_ROBOTS} none. "
        "Where more than a fifth of the robots differ, they are taken for arms of several models, and nothing is said."
    )
    rows = [
        (
            o.robot,
            _named(o.of, o.name),
            figure(o.outlier.usual, _DIGITS),
            figure(o.outlier.others, _DIGITS),
            f"{o.outlier.apart:+.1f}",
            figure(o.outlier.chance, 2),
        )
        for o in found[:_MAX_TABLE_ROWS]
    ]
    header = (
        "robot",
        "parameter",
        "its mean",
        "the others'",
        "standard deviations",
        "probability in a fleet of like robots",
    )
    points = [] if rows else ["No robot differs from the others by more than chance."]
    return Section("Odd ones", text=[text], points=points, tables=[Table(header, rows)] if rows else [])


def _failures(failed: pl.DataFrame) -> Section | None:
    if not failed.height:
        return None
    rows: list[tuple[str, ...]] = [(r["robot"], plain_time(r["time"]), r["error"]) for r in failed.to_dicts()]
    tables = [Table(("robot", "time", "why"), rows[:_MAX_TABLE_ROWS])]
    if rows[_MAX_TABLE_ROWS:]:
        tables.append(
            Table(("robot", "time", "why"), rows[_MAX_TABLE_ROWS:], fold=f"{len(rows) - _MAX_TABLE_ROWS} more")
        )
    return Section("Entries without a diagnosis", tables=tables)
