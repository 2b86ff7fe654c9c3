"""The page of a fleet: robots by cause, what drifts, which robot is the odd one, and what failed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from armgap.fleet.drift import Drift, drifts, odd_ones
from armgap.report import charts
from armgap.report.document import Document
from armgap.report.page import Bar, Drawing, Section, Table
from armgap.report.words import SummaryAnswer, figure, joint_text, title

if TYPE_CHECKING:
    from armgap.fleet.folder import Fleet

__all__ = ["fleet_document", "moving", "odd"]

# Charts and rows that are shown; the tables hold all of them.
_CHARTS, _ROWS = 6, 40
_EMPTY = "-"
_MIDNIGHT = "T00:00:00"


def fleet_document(fleet: Fleet) -> Document:
    """Return the page of a fleet."""
    robots = fleet.summary["robot"].n_unique()
    moves, strangers = list(moving(fleet.parameters)), list(odd(fleet.parameters))
    failed, done = fleet.failed.height, fleet.summary.filter(pl.col("error").is_null())
    diagnoses = done.unique(["robot", "time", "seconds"]).height
    lead = f"{diagnoses} diagnoses of {robots} robots; entries without one: {failed}."
    answers = [
        SummaryAnswer("What drifts?", *_listed([_moved(m) for m in moves], "nothing", "parameters that grow or fall steadily")),
        SummaryAnswer("Which robot is the odd one?", *_listed([_stranger(s) for s in strangers], "none", "values far from the other robots'")),
        SummaryAnswer("What is most often the cause?", *_commonest(fleet.summary)),
    ]  # fmt: skip
    sections = [_causes(fleet.summary), _moving(fleet.parameters, moves), _odd(strangers), _failures(fleet.failed)]
    return Document("Fleet", lead, answers, [section for section in sections if section is not None])


Move = tuple[str, str, str, list[str], Drift]
"""Robot, what the parameter is of, its name, the visits, and the drift."""


def moving(parameters: pl.DataFrame) -> Iterator[Move]:
    """Yield what drifts: parameters of arms and of causes, by name, the surest of each first."""
    for (of, name), table in _by_parameter(parameters):
        robots, visits, values = _visits(table)
        for drift in drifts(values):
            yield robots[drift.robot], of, name, visits[drift.robot], drift


def odd(parameters: pl.DataFrame) -> Iterator[tuple[str, str, str, float]]:
    """Yield robots whose parameters lie far from the others': robot, what it is of, name, robust standard deviations."""
    for (of, name), table in _by_parameter(parameters):
        robots, _, values = _visits(table)
        for robot, apart in odd_ones(values):
            yield robots[robot], of, name, apart


def _by_parameter(parameters: pl.DataFrame) -> Iterator[tuple[tuple[str, str], pl.DataFrame]]:
    for (of, name), table in parameters.sort("time", nulls_last=False).group_by(["of", "name"], maintain_order=True):
        yield (str(of), str(name)), table


def _visits(table: pl.DataFrame) -> tuple[list[str], list[list[str]], np.ndarray]:
    """Robots, the times of their visits, and values of shape (n_robots, n_visits), NaN beyond a robot's last visit."""
    groups = {str(robot): rows for (robot,), rows in table.group_by(["robot"], maintain_order=True)}
    most = max(rows.height for rows in groups.values())
    values = np.full((len(groups), most), np.nan)
    for row, rows in zip(values, groups.values(), strict=True):
        row[: rows.height] = rows["value"].to_numpy()
    return list(groups), [[str(t or "") for t in rows["time"]] for rows in groups.values()], values


def _moved(move: Move) -> str:
    robot, of, name, visits, drift = move
    return f"{robot}: {_named(of, name)} by {100 * drift.rate:+.1f} % per visit since {_since(visits, drift)}"


def _since(visits: list[str], drift: Drift) -> str:
    return visits[drift.onset].removesuffix(_MIDNIGHT) or f"visit {drift.onset + 1}"


def _stranger(found: tuple[str, str, str, float]) -> str:
    robot, of, name, apart = found
    return f"{robot}: {_named(of, name)}, {apart:+.0f} robust standard deviations"


def _named(of: str, name: str) -> str:
    effect, _, joint = of.partition(":")
    return name if of == "arm" else f"{name} of {title(effect)}, {joint_text(int(joint) if joint else None)}"


def _listed(found: list[str], none: str, of: str) -> tuple[str, str]:
    if not found:
        return none, of
    more = f"; {len(found) - 1} more below" if len(found) > 1 else ""
    return found[0], f"{of}{more}"


def _commonest(summary: pl.DataFrame) -> tuple[str, str]:
    named = summary.filter(pl.col("effect").is_not_null())
    if not named.height:
        return "nothing is named", "no diagnosis names an effect"
    counts = named.group_by(["effect", "joint"]).agg(pl.col("robot").n_unique().alias("robots"))
    first = counts.sort(["robots", "effect", "joint"], descending=[True, False, False], nulls_last=True).row(
        0, named=True
    )
    return f"{title(first['effect'])}, {joint_text(first['joint'])}", f"on {first['robots']} robots"


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
            ", ".join(r["robots"][:_ROWS]) + (" …" if len(r["robots"]) > _ROWS else ""),
        )
        for r in groups.sort(["entries", "what", "joint"], descending=[True, False, False]).to_dicts()
    ]
    header = ("cause, or verdict without one", "robots", "entries", "median probability", "which")
    return Section("Robots by cause", tables=[Table(header, rows[:_ROWS])])


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
        "A parameter drifts if its logarithm, less what all robots did at that visit, follows a ramp by more than five standard deviations of the "
        "ramp's slope; the scatter is that of the fleet."
    )
    header = ("robot", "parameter", "since", "per visit", "standard deviations")
    rows = [
        (
            robot,
            _named(of, name),
            _since(visits, d),
            f"{100 * d.rate:+.1f} %",
            f"{d.evidence:.1f}",
        )
        for robot, of, name, visits, d in moves[:_ROWS]
    ]
    tables = [Table(header, rows)] if rows else []
    points = [] if rows else ["Nothing drifts that these visits can tell."]
    drawings = [_course(parameters, move) for move in moves[:_CHARTS]]
    return Section("Over time", text=[text], points=points, tables=tables, figures=drawings, columns=2)


def _course(parameters: pl.DataFrame, move: Move) -> Drawing:
    """The parameter of one robot over its visits, with its interval."""
    robot, of, name, _, _ = move
    rows = parameters.filter((pl.col("robot") == robot) & (pl.col("of") == of) & (pl.col("name") == name)).sort("time")
    value, sigma = rows["value"].to_numpy(), rows["sigma"].fill_null(0.0).to_numpy()
    visits = np.arange(1.0, len(value) + 1)
    unit = rows["unit"][0] or ""
    chart = charts.figure(f"{robot}: {_named(of, name)}", "visit", f"{name} [{unit}]")
    chart.varea(visits, value - 1.96 * sigma, value + 1.96 * sigma, color=charts.MEASURED, alpha=0.25)
    chart.line(visits, value, color=charts.AFTER, line_width=2)
    chart.scatter(visits, value, color=charts.AFTER, size=5)
    return Drawing(f"{name} of {robot} over its visits, with 95 % intervals.", chart)


def _odd(strangers: list[tuple[str, str, str, float]]) -> Section:
    text = "A robot is odd if its usual value (median over its visits) lies more than five robust standard deviations from the fleet's median."
    rows = [(robot, _named(of, name), f"{apart:+.1f}") for robot, of, name, apart in strangers[:_ROWS]]
    tables = [Table(("robot", "parameter", "robust standard deviations"), rows)] if rows else []
    return Section("Odd ones", text=[text], points=[] if rows else ["No robot is far from the others."], tables=tables)


def _failures(failed: pl.DataFrame) -> Section | None:
    if not failed.height:
        return None
    rows: list[tuple[str, ...]] = [
        (r["robot"], (r["time"] or _EMPTY).removesuffix(_MIDNIGHT), r["error"]) for r in failed.to_dicts()
    ]
    tables = [Table(("robot", "time", "why"), rows[:_ROWS])]
    if rows[_ROWS:]:
        tables.append(Table(("robot", "time", "why"), rows[_ROWS:], fold=f"{len(rows) - _ROWS} more"))
    return Section("Entries without a diagnosis", tables=tables)
