"""Report section on the drive chain: share of the gap at each stage between command and measured position."""

from __future__ import annotations

from armgap.report import charts
from armgap.report.page import Bar, Cell, Section, Table
from armgap.report.sections.model_labels import Data
from armgap.report.words import percent, value
from armgap.several_joints import joint_text

__all__ = ["along_the_chain"]

_FIGURES = ("delay", "gain", "offset", "viscous", "inertia")


def along_the_chain(data: Data) -> Section | None:
    """Return the section with shares of drives, transmissions, mechanics and sensors, and the drives' parameters."""
    parts = data.get("chain") or []
    if not parts:
        return None
    text = (
        "The logs hold more of the way from command to position than its two ends. The share of a drive or a transmission is what the squared gap "
        "with re-estimated parameters loses once the measured torque, or the position on the link's side, takes the place of what the model is "
        "given; the rest is the mechanics' and the sensors'."
    )
    rows: list[tuple[Cell, ...]] = [
        (p["stage"], joint_text(p["joint"]), Bar(p["share"], percent(p["share"]), charts.REFIT), p["detail"])
        for p in parts
    ]
    tables = [Table(("stage", "where", "share of the gap", "what it rests on"), rows)]
    drives = [p for p in parts if p.get("parameters")]
    if drives:
        figures = [
            (joint_text(p["joint"]), *(value(p["parameters"][name]) for name in _FIGURES))
            for p in sorted(drives, key=lambda p: int(p["joint"]))
        ]
        tables.append(Table(("drive", *_FIGURES), figures))
    notes = [
        "A drive's model: measured torque = gain × command, delayed, + offset − viscous part × speed − inertia × acceleration; ± one "
        "standard deviation."
    ]
    return Section("Along the chain", text=[text], tables=tables, notes=notes if drives else [])
