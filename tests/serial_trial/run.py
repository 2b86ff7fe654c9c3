"""Diagnose cases, compare the answers with the keys, and print tables."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import armgap

from .case import Case, make_case

Record = dict[str, Any]

#: Classes of answers, best first: the first cause is the hidden effect on its joint; one of its equivalents is; a later cause is; no cause is
#: named but a wrong value of the arm file was estimated right; no cause is named but a candidate is the hidden effect; no cause is named; the
#: first cause is another effect on the right joint; the first cause is wrong in effect and joint.
OUTCOMES = ("right", "look-alike", "later", "value", "candidate", "not named", "joint only", "wrong")
#: Largest relative error at which an estimated rotor inertia or viscous friction counts as right.
_VALUE = 0.2
#: Suffix of the names of effects that act on every joint.
_ALL = "_all"
#: Bounds of the ranges of probabilities in which names are counted.
_RANGES = (0.0, 0.5, 0.75, 0.9, 1.01)
#: Hidden effects that depend on a weighted sum of two joints' positions or velocities, with their names in the library.
_ON_ROW = {"cable_spring": "joint_spring", "coupled_transmission": "coupled_transmission"}
#: Entries of a case's key that are copied into the record of its answer.
_TOLD = (
    "seed", "number", "draw", "effect", "joint", "values", "outside", "change", "family", "joints", "kinds", "period", "noise", "controller",
    "above_floor", "moved", "beside",
)  # fmt: skip


def ask(case: Case) -> Record:
    """Diagnose a case; return the record with entries of its key, the diagnosis' causes and other results, and the outcome."""
    began = time.perf_counter()
    found = armgap.diagnose(case.training, case.arm, holdout=case.holdout)
    seconds = time.perf_counter() - began
    data = found.to_dict()
    kept = ("effect", "joint", "joints", "row", "probability", "closed", "equivalents", "why", "parameters")
    causes, candidates = ([{k: c[k] for k in kept if k in c} for c in data[part]] for part in ("causes", "candidates"))
    record = {
        **{name: case.key[name] for name in _TOLD if name in case.key},
        "verdict": found.verdict, "causes": causes, "candidates": candidates, "gap": data["gap"], "seconds": seconds,
        "parameters": {name: value.value for name, value in found.parameters["refit"].items()},
        "theta": case.key["theta"], "notes": data["notes"],
        "unnamed": [{k: law[k] for k in ("joint", "variable", "share")} for law in data["unnamed"]],
    }  # fmt: skip
    return record | {"outcome": outcome(record)}


def answer(seed: int, number: int, *, commanded: bool = False) -> Record:
    """Make a case, diagnose it, and return the record of the answer."""
    return ask(make_case(seed, number, commanded=commanded))


def is_hidden(record: Record, name: dict[str, Any]) -> bool:
    """Return whether a cause, candidate or equivalent is the hidden effect; an effect on all joints may be named on any joint."""
    effect = record["effect"]
    if effect.endswith(_ALL):
        return bool(name["effect"] == effect.removesuffix(_ALL))
    if effect in _ON_ROW:
        first, factor = record["joint"], record["values"].get("factor", 1.0)
        place = name.get("joints") == [first, first + 1] and name.get("row") == [1, int(factor)]
        return bool(place and name["effect"] == _ON_ROW[effect])
    return bool(name["effect"] == record["effect"] and name["joint"] == record["joint"])


def is_in_arm(record: Record, name: dict[str, Any]) -> bool:
    """Return whether a cause, or one of its equivalents, is the hidden effect or one of those beside it."""
    names = [name, *name.get("equivalents", ())]
    hidden = [record, *({**record, **effect} for effect in record["beside"])]
    return any(is_hidden(effect, n) for effect in hidden for n in names if not effect["outside"])


def outcome(record: Record) -> str:
    """Return which of the `OUTCOMES` an answer is; for a case without an effect of the library, ``"not named"`` or ``"wrong"``."""
    causes = record["causes"]
    if record["effect"] == "null" or record["outside"]:
        return "wrong" if causes else "not named"
    if not causes:
        if _restored(record):
            return "value"
        return "candidate" if any(is_hidden(record, c) for c in record["candidates"]) else "not named"
    first = causes[0]
    if is_hidden(record, first):
        return "right"
    if any(is_hidden(record, e) for e in first["equivalents"]):
        return "look-alike"
    if any(is_hidden(record, c) for c in causes[1:]):
        return "later"
    return "joint only" if first["joint"] is not None and first["joint"] == record["joint"] else "wrong"


def _restored(record: Record) -> bool:
    """Return whether a wrong rotor inertia of the arm file was estimated right, or a servo's additional damping as viscous friction."""
    if record["effect"] == "controller_damping":
        true = record["theta"][11 * record["joints"] + record["joint"] - 1] + record["values"]["difference"]
        return bool(abs(record["parameters"][f"viscous{record['joint']}"] / true - 1) < _VALUE)
    if record["effect"] != "rotor_inertia" or record["values"]["lacking"]:
        return False
    true = record["theta"][10 * record["joints"] + record["joint"] - 1]
    return bool(abs(record["parameters"][f"rotor{record['joint']}"] / true - 1) < _VALUE)


def report(records: list[Record]) -> str:
    """Return the tables of outcomes and a line for every case whose answer is not right, as text."""
    failed = [r for r in records if "failed" in r]
    answers = [r for r in records if "failed" not in r]
    cluttered = [r for r in answers if r["beside"]]
    hidden = [r for r in answers if r["effect"] != "null" and not r["outside"] and not r["beside"]]
    outside = [r for r in answers if r["outside"]]
    nulls = [r for r in answers if r["effect"] == "null"]
    lines = [f"{len(answers)} answers, {len(failed)} failed", ""]
    lines += _table("effect", hidden, lambda r: r["effect"])
    lines += _table("joints", hidden, lambda r: r["joints"])
    for label, of in (("no effect", nulls), ("effects outside the library", outside)):
        if of:
            named = [r for r in of if r["causes"]]
            sure = sum(any(c["probability"] >= 0.5 for c in r["causes"]) for r in named)
            lines.append(
                f"{label}: {len(named)} of {len(of)} with a cause named, {sure} of them at a probability of 0.5 or more"
            )
    if cluttered:
        lines += ["", *_table("with others", cluttered, lambda r: r["effect"])]
    for label, of in (("effects with others beside them", cluttered), ("all answers", answers)):
        if of:
            lines += [f"{label}: right names by probability", *_calibration(of), ""]
    everywhere = [r for r in hidden if r["effect"].endswith(_ALL)]
    if everywhere:
        one = sum(
            is_hidden(r, c) and len(c.get("joints") or ()) >= r["joints"] / 2
            for r in everywhere
            for c in r["causes"][:1]
        )
        lines.append(
            f"effects of all joints: {one} of {len(everywhere)} named in one cause of half of the joints or more"
        )
    if answers:
        seconds = [r["seconds"] for r in answers]
        lines.append(f"seconds per diagnosis: median {np.median(seconds):.1f}, longest {max(seconds):.1f}")
    good = ("right", "look-alike", "value")
    missed = [r for r in hidden if r["outcome"] not in good] + [r for r in (*outside, *nulls) if r["causes"]]
    missed += [r for r in cluttered if r["outcome"] not in good or not all(is_in_arm(r, c) for c in r["causes"])]
    lines += ["", *(_line(r) for r in missed), *(f"case {r['number']}: {r['failed']}" for r in failed)]
    return "\n".join(lines).rstrip()


def _calibration(records: list[Record]) -> list[str]:
    """Return a line for each range of probabilities: number of names, how many of them are in the arm, and their mean probability."""
    names = [(c["probability"], is_in_arm(r, c)) for r in records for c in r["causes"]]
    lines = []
    for low, high in itertools.pairwise(_RANGES):
        of = [(p, right) for p, right in names if low <= p < high]
        if of:
            right = sum(right for _, right in of)
            lines.append(
                f"  {low:.2f} to {min(high, 1):.2f}: {right} of {len(of)}, mean {np.mean([p for p, _ in of]):.2f}"
            )
    return lines


def _table(label: str, records: list[Record], group: Callable[[Record], Any]) -> list[str]:
    groups = sorted({group(r) for r in records})
    rows = [[str(g), *_counts([r for r in records if group(r) == g])] for g in groups]
    rows = [[label, "cases", *OUTCOMES], *rows, ["all", *_counts(records)]]
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = [
        "  ".join(cell.rjust(w) if i else cell.ljust(w) for i, (cell, w) in enumerate(zip(row, widths, strict=True)))
        for row in rows
    ]
    return [*(line.rstrip() for line in lines), ""]


def _counts(records: list[Record]) -> list[str]:
    return [str(len(records)), *(str(sum(r["outcome"] == word for r in records) or "-") for word in OUTCOMES)]


def _line(r: Record) -> str:
    """Return a line about a case whose answer is not right: hidden effect, its values, and what the diagnosis named."""

    def place(c: dict[str, Any]) -> str:
        joints = "/".join(map(str, c.get("joints") or [c["joint"] or ""]))
        row = f" {c['row']}" if c.get("row") else ""
        return f"{c['effect']}:{joints}{row}"

    def name(c: dict[str, Any]) -> str:
        alike = ",".join(map(place, c["equivalents"]))
        return f"{place(c)} {c['probability']:.2f}{f' ~{alike}' if alike else ''}"

    values = ", ".join(f"{k} {_short(v)}" for k, v in r["values"].items())
    seen = f", {r['above_floor']:.1f} floors, {r['moved']:.1f} sigmas" if "moved" in r else ""
    made = f"{r['family']} {r['kinds']}, {1e3 * r['period']:g} ms, {r['controller']}, noise {100 * r['noise']:g} %"
    said = f"{r['verdict']} [{'; '.join(map(name, r['causes']))}] ({'; '.join(map(name, r['candidates']))})"
    others = "".join(f" + {e['effect']}:{e['joint']}" for e in r["beside"])
    laws = "".join(f" {law['variable']} on {law['joint']} {law['share']:.2f}" for law in r["unnamed"])
    hidden = f"{r['effect']}:{r['joint'] or ''}{others} ({values}; {100 * r['change']:.0f} %{seen}; {made})"
    return f"case {r['number']}: {hidden} -> {r['outcome']}: {said}{' unnamed' if laws else ''}{laws}"


def _short(value: Any) -> str:
    return "/".join(f"{v:.3g}" for v in value) if isinstance(value, list) else f"{value:.3g}"
