"""Words of results and options as `Literal` types, so that a type checker accepts exactly the known words."""

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
    "GravityCorrection",
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
GravityCorrection = Literal["reversed", "compensated", "standard", "+x", "-x", "+y", "-y", "+z", "-z"]
ChainStage = Literal["drive", "transmission", "mechanics", "sensor"]

SERIAL = "serial"
"""Kind of a serial arm: joints one after another from the base, given by a chain."""
SCHEMES: tuple[Scheme, ...] = get_args(Scheme)
"""Names of the regression models, in the order of Reyes and Kelly (1997)."""
FILTERS: tuple[Filters, ...] = get_args(Filters)
"""Sets of filters for identification: consistent filters, and those of Reyes and Kelly (1997) as printed."""
VELOCITIES: tuple[VelocityMethod, ...] = get_args(VelocityMethod)
"""Sources of velocities for identification: methods to compute velocities from positions, or a sensor."""
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
"""Verdicts of a diagnosis."""
STATUSES: tuple[Status, ...] = get_args(Status)
"""Statuses of a candidate effect that is no cause."""
CAUSE_STATUSES: tuple[CauseStatus, ...] = get_args(CauseStatus)
"""Statuses of a cause in a comparison of two diagnoses."""
GAP_OUTCOMES: tuple[GapOutcome, ...] = get_args(GapOutcome)
"""Words for the change of the gap between two diagnoses; ``"none"`` if neither diagnosis has a gap."""
CHAIN_STAGES: tuple[ChainStage, ...] = get_args(ChainStage)
"""Stages of the drive chain from commanded torque to measured position."""


def joint_units(data: dict[str, Any]) -> list[str]:
    """Return the unit of each joint's position in a result; a serial arm may have rotary and linear joints."""
    n_joints = len(data["gap"]["before"])
    units = list((data.get("arm") or {}).get("joint_unit") or [])
    return units if len(units) == n_joints else [str(data["gap"].get("unit", "rad"))] * n_joints
