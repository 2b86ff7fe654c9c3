"""Rows of a fleet's tables: one per named cause, and one per parameter."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import polars as pl

from armgap.fleet.manifest import Entry
from armgap.report.words import title
from armgap.several_joints import by_joint, joint_text, place_text

__all__ = ["PARAMETERS", "SUMMARY", "failed_row", "owner", "owner_text", "parameter_rows", "summary_rows"]

Row = dict[str, Any]
SUMMARY: dict[str, type[pl.DataType]] = {
    "robot": pl.String,
    "time": pl.String,
    "verdict": pl.String,
    "effect": pl.String,
    "joint": pl.Int64,
    "probability": pl.Float64,
    "closed": pl.Float64,
    "unexplained": pl.Float64,
    "seconds": pl.Float64,
    "error": pl.String,
}
"""Columns of ``summary.parquet``: one row per named cause; without one, or where the entry failed, one row with an empty effect."""
PARAMETERS: dict[str, type[pl.DataType]] = {
    "robot": pl.String,
    "time": pl.String,
    "of": pl.String,
    "name": pl.String,
    "value": pl.Float64,
    "sigma": pl.Float64,
    "unit": pl.String,
}
"""Columns of ``parameters.parquet``, one row per parameter of an entry; `of` is its owner, ``arm`` or that of a cause, see `owner`."""


def summary_rows(entry: Entry, diagnosis: dict[str, Any]) -> list[Row]:
    """Return the rows of ``summary.parquet`` for one entry's diagnosis."""
    gap = diagnosis["gap"]
    of_entry = {
        **_empty(entry),
        "verdict": diagnosis["verdict"],
        "closed": gap["closed"],
        "unexplained": gap["unexplained"],
        "seconds": diagnosis["seconds"],
    }
    named = [
        {"effect": c["effect"], "joint": c["joint"], "probability": c["probability"]}
        for c in by_joint(diagnosis["causes"])
    ]
    # Several pushes on one joint are one row, with the probability of the surest.
    places = {(row["effect"], row["joint"]): row for row in sorted(named, key=lambda row: row["probability"])}
    return [{**of_entry, **row} for row in named if row is places[row["effect"], row["joint"]]] or [of_entry]


def failed_row(entry: Entry, error: str, seconds: float | None) -> Row:
    """Return the row of ``summary.parquet`` for an entry without a diagnosis."""
    return {**_empty(entry), "seconds": seconds, "error": error}


def _empty(entry: Entry) -> Row:
    return {**dict.fromkeys(SUMMARY), "robot": entry.robot, "time": entry.time or None}


def owner(cause: dict[str, Any]) -> str:
    """Return the owner of a cause's parameters: ``effect:2``; ``effect:1+2`` or ``1-2`` of two coupled joints; ``effect:`` of the whole arm."""
    if not cause.get("row"):
        return f"{cause['effect']}:{cause['joint'] or ''}"
    sign = "+" if cause["row"][1] > 0 else "-"
    return f"{cause['effect']}:{cause['joints'][0]}{sign}{cause['joints'][1]}"


def owner_text(of: str) -> str:
    """Return the owner of a cause's parameters (see `owner`) in words.

    Examples
    --------
    >>> owner_text("stribeck:2"), owner_text("base_tilt:")
    ('Stribeck friction (stiction), joint 2', 'tilted base, whole arm')
    """
    effect, _, place = of.partition(":")
    if coupled := re.fullmatch(r"(\d+)([+-])(\d+)", place):
        row = (1, 1 if coupled[2] == "+" else -1)
        where = place_text({"joint": None, "joints": [int(coupled[1]), int(coupled[3])], "row": row})
    else:
        where = joint_text(int(place) if place else None)
    return f"{title(effect)}, {where}"


def parameter_rows(entry: Entry, diagnosis: dict[str, Any]) -> Iterator[Row]:
    """Yield rows of ``parameters.parquet``: re-estimated parameters of the arm, and those of its named causes but pushes, which are no property."""
    place = {"robot": entry.robot, "time": entry.time or None}
    arm = diagnosis["parameters"]["with_causes"]
    found = [("arm", name, value) for name, value in arm.items()]
    for cause in by_joint([cause for cause in diagnosis["causes"] if not cause.get("log")]):
        of = owner(cause)
        found += [(of, name, value) for name, value in cause["parameters"].items()]
    for of, name, value in found:
        yield {**place, "of": of, "name": name, **{key: value.get(key) for key in ("value", "sigma", "unit")}}
