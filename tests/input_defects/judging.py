"""Judgement of one record against what was expected of its answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from armgap.trial.verdict import equivalent

from .expected import Expected, Remedy, listed, remedies, within

Record = dict[str, Any]
#: Probability from which a cause counts as named, because a user would act on it.
NAMED = 0.5
#: Largest difference of row numbers at which a check still points to the right rows.
ROWS = 2


@dataclass(frozen=True)
class Judged:
    """Judgement of the answer to one case with a defect.

    Attributes
    ----------
    right : bool
        Whether a check with an expected name and severity (and rows, where these are asked for) fired, or an accepted verdict came without
        any such check; and no check of another name stopped the diagnosis or repaired the input.
    complete : bool
        Whether the answer is right and offers all expected remedies.
    others : tuple of str
        Names of other checks that stopped the diagnosis or repaired the input.
    strange : bool
        Whether the checks offer a remedy that is not among the right ones.
    wrong : tuple of str
        Effects that are named in spite of the defect and are not in the arm.
    """

    right: bool
    complete: bool
    others: tuple[str, ...]
    strange: bool
    wrong: tuple[str, ...]


def judged(record: Record) -> Judged:
    """Return the judgement of a record that states what was expected."""
    expected = Expected.from_dict(record["expected"])
    found = checks(record)
    fit = [c for c in found if _fits(c, expected)]
    others = tuple(c["check"] for c in found if c["severity"] != "warning" and not _named(c, expected))
    offered = [r for c in fit for r in remedies(c["remedy"] or "", record["n_joints"])]
    wanted = [r for text in expected.remedies for r in remedies(text, record["n_joints"])]
    known = wanted + [r for text in expected.also for r in remedies(text, record["n_joints"])]
    silent = not fit and record["verdict"] in expected.verdicts
    right = (bool(fit) or silent) and not others and _stops(record, fit)
    return Judged(
        right=right,
        complete=right and (silent or all(listed(w, offered) for w in wanted)),
        others=others,
        strange=bool(known) and any(not _among(o, known) for o in offered),
        wrong=wrong_effects(record, expected.allowed),
    )


def checks(record: Record) -> list[Record]:
    """Return the checks that fired, together with refusals and unit conversions from the reading of the log, in the form of checks."""
    found = list(record.get("checks", []))
    refused = record.get("refused", {})
    if refused:
        unit = refused["type"] == "UnitError" and "--units q=" in refused["message"]
        found.append(_of_reader("position_unit" if unit else "refused", "error", refused["message"]))
    for finding in record.get("findings", []):
        if finding["kind"] == "units" and "degrees" in finding["message"]:
            found.append(_of_reader("position_unit", "repaired", "--units q=deg"))
    return found


def _of_reader(check: str, severity: str, remedy: str) -> Record:
    return {"check": check, "severity": severity, "remedy": remedy, "rows": [], "log": None}


def _named(check: Record, expected: Expected) -> bool:
    return "*" in expected.checks or check["check"] in expected.checks


def _fits(check: Record, expected: Expected) -> bool:
    if not _named(check, expected) or check["severity"] not in expected.severities or check["check"] == "refused":
        return False
    return not expected.rows or any(_overlap(check, *where) for where in expected.rows)


def _overlap(check: Record, log: str, first: int, last: int) -> bool:
    if check.get("log") not in (None, log):
        return False
    return any(a - ROWS <= last and first <= b + ROWS for a, b in check.get("rows") or [])


def _stops(record: Record, fit: list[Record]) -> bool:
    """Return whether the diagnosis gave no result if one of the right checks is an error; true if none of these is."""
    return record["verdict"] in ("input", "refused") or all(c["severity"] != "error" for c in fit)


def _among(remedy: Remedy, known: list[Remedy]) -> bool:
    return any(within(remedy, whole) for whole in known)


def wrong_effects(record: Record, allowed: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Return the effects named with probability :data:`NAMED` or more of which neither name nor equivalents match a hidden effect."""
    hidden = [(str(effect), joint) for effect, joint in record["hidden"]]

    def true(cause: Record) -> bool:
        names = [(cause["effect"], cause["joint"]), *((e["effect"], e["joint"]) for e in cause["equivalents"])]
        return cause["effect"] in allowed or any(equivalent(n, h) for n in names for h in hidden)

    named = [c for c in record.get("causes", []) if c["probability"] >= NAMED]
    return tuple(f"{c['effect']}:{c['joint'] or ''}" for c in named if not true(c))


def first_right(record: Record) -> bool:
    """Return whether the first cause is a hidden effect or its equivalent; without hidden effects, whether no cause is named."""
    hidden = [(str(effect), joint) for effect, joint in record["hidden"]]
    causes = record.get("causes", []) if record.get("verdict") == "effect" else []
    if not hidden or not causes:
        return not hidden and not causes and "refused" not in record
    return any(equivalent((causes[0]["effect"], causes[0]["joint"]), h) for h in hidden)
