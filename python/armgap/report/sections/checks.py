"""Report section on checks of the input: contradictions between log and arm file, repairs, warnings."""

from __future__ import annotations

from armgap.report.page import Section, Table
from armgap.report.sections.model_labels import Data
from armgap.several_joints import joint_text

__all__ = ["checks", "input_checks"]

TITLE = "Checks of the input"
#: Largest number of row ranges that the section lists per check, followed by the number of further ranges.
LISTED = 3
#: Words for the severities of checks, most severe first.
_SEVERITY = {"error": "contradiction", "repaired": "repaired", "warning": "warning"}


def checks(data: Data) -> Section | None:
    """Return the section with checks of the input; None for the verdict ``"input"``, whose report has this section before the answers."""
    return None if data["verdict"] == "input" else input_checks(data)


def input_checks(data: Data) -> Section | None:
    """Return the section with checks of the input, errors first."""
    found = data.get("checks") or []
    if not found:
        return None
    order = list(_SEVERITY)
    ordered = sorted(found, key=lambda c: order.index(c["severity"]) if c["severity"] in order else len(order))
    rows = [
        (
            _SEVERITY.get(c["severity"], c["severity"]),
            c["check"].replace("_", " "),
            _place(c),
            f"{c['message'].rstrip('.')}.",
            _remedies(c),
        )
        for c in ordered
    ]
    header = ("", "check", "where", "what the log shows", "remedy")
    return Section(TITLE, tables=[Table(header, rows)], name="checks")


def _place(check: Data) -> str:
    """Return joint, log and rows of a check as text, all counted from 1."""
    joint = "" if check.get("joint") is None else joint_text(check["joint"])
    return ", ".join(filter(None, (joint, check.get("log"), _rows(check.get("rows") or []))))


def _rows(ranges: list[list[int]]) -> str:
    shown = [str(a + 1) if a == b else f"{a + 1} to {b + 1}" for a, b in ranges[:LISTED]]
    more = f" and {len(ranges) - LISTED} more ranges" if len(ranges) > LISTED else ""
    one = len(ranges) == 1 and ranges[0][0] == ranges[0][1]
    return f"row{'' if one else 's'} {', '.join(shown)}{more}" if shown else ""


def _remedies(check: Data) -> str:
    """Return the remedies of a check as text, with command-line options and lines of the arm file as code."""
    several = check.get("remedies") or list(filter(None, [check.get("remedy")]))
    return " or ".join(f"`{r}`" for r in several)
