"""Report sections on effects that were not found, and on effects that the logs could not show."""

from __future__ import annotations

import functools

from armgap import _native
from armgap.report.page import Section, Table
from armgap.report.sections.model_labels import Data
from armgap.report.words import figure, named, title, unit_text
from armgap.several_joints import place_text

__all__ = ["excited_by", "not_shown", "ruled_out"]


@functools.cache
def _needs() -> dict[str, str]:
    return {entry["name"]: str(entry["excited_by"]) for entry in _native.effects()}


def excited_by(effect: str) -> str:
    """Return the motion that would show an effect, in words."""
    return _needs().get(effect, "")


def not_shown(data: Data) -> Section | None:
    """Return the section with effects that the logs do not excite, and motions that would show them."""
    silent = [r for r in data.get("ruled_out") or [] if r["status"] == "not excited"]
    if not silent:
        return None
    joints: dict[str, list[str]] = {}
    for r in silent:
        joints.setdefault(r["effect"], []).append(place_text(r))
    rows = [(title(effect), ", ".join(places), excited_by(effect)) for effect, places in joints.items()]
    text = "These effects could be present without leaving a trace in these logs. The last column says which motion would show them."
    return Section("What these logs could not show", text=[text], tables=[Table(("effect", "where", "needs"), rows)])


def ruled_out(data: Data) -> Section | None:
    """Return the section with every candidate that is no cause, and the bound on its size."""
    found = data.get("ruled_out") or []
    if not found:
        return None
    count = {status: sum(r["status"] == status for r in found) for status in ("absent", "undecided", "not excited")}
    text = (
        f"{len(found)} candidates are not named: {count['absent']} absent (no larger than the bound), {count['undecided']} undecided (the last "
        f"column says why), {count['not excited']} not excited."
    )
    rows = [(named(r), r["status"], bound_text(r), r.get("why") or "") for r in found]
    table = Table(("candidate", "status", "bound (95 %)", "why"), rows, fold=f"All {len(found)} candidates")
    return Section("What was looked for and not found", text=[text], tables=[table])


def bound_text(entry: Data) -> str:
    """Return the bound on the size of an absent effect as text."""
    bound = entry.get("bound")
    if not bound:
        return ""
    return f"{bound['parameter']} within {figure(bound['value'])} {unit_text(bound['unit'])}".strip()
