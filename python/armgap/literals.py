"""The words that results and options consist of, as types: what a type checker accepts is what the program knows."""

from __future__ import annotations

from typing import Any, Literal, get_args

__all__ = [
    "CAUSE_STATUSES",
    "CHAIN_STAGES",
    "FILTERS",
    "GAP_OUTCOMES",
    "SCHEMES",
    "SERIAL",
    "STATUSES",
    "VELOCITIES",
    "VERDICTS",
    "CauseStatus",
    "ChainStage",
    "Filters",
    "GapOutcome",
    "Scheme",
    "Side",
    "Status",
    "TauKind",
    "VelocityMethod",
    "Verdict",
    "joint_units",
]

Scheme = Literal["filtered-dynamic", "supplied-energy", "filtered-power"]
Filters = Literal["exact", "paper"]
VelocityMethod = Literal["backward", "central", "local-cubic", "sensor", "midpoint"]
Verdict = Literal["none", "parameters", "effect", "unexplained", "input"]
Status = Literal["absent", "not excited", "undecided"]
Side = Literal["motor", "link", "unknown"]
TauKind = Literal["command", "measured"]
CauseStatus = Literal["gone", "unseen", "undecided", "new", "smaller", "larger", "unchanged", "renamed"]
GapOutcome = Literal["smaller", "larger", "unchanged", "none"]
ChainStage = Literal["drive", "transmission", "mechanics", "sensor"]

SERIAL = "serial"
"""The kind of an arm that has a chain."""
SCHEMES: tuple[Scheme, ...] = get_args(Scheme)
"""The regression models, in the order of Reyes and Kelly (1997)."""
FILTERS: tuple[Filters, ...] = get_args(Filters)
"""Consistent filters, and the paper's as printed."""
VELOCITIES: tuple[VelocityMethod, ...] = get_args(VelocityMethod)
"""Ways to get velocities."""
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
"""Verdicts of a diagnosis."""
STATUSES: tuple[Status, ...] = get_args(Status)
"""What a candidate can be that is no cause."""
CAUSE_STATUSES: tuple[CauseStatus, ...] = get_args(CauseStatus)
"""What can become of a cause between two diagnoses."""
GAP_OUTCOMES: tuple[GapOutcome, ...] = get_args(GapOutcome)
"""What can become of the gap between two diagnoses."""
CHAIN_STAGES: tuple[ChainStage, ...] = get_args(ChainStage)
"""Stages from command to measured position."""


def joint_units(data: dict[str, Any]) -> list[str]:
    """Unit of each joint's position in a result; a serial arm may have joints that turn and joints that slide."""
    n_joints = len(data["gap"]["before"])
    units = list((data.get("arm") or {}).get("joint_unit") or [])
    return units if len(units) == n_joints else [str(data["gap"].get("unit", "rad"))] * n_joints
