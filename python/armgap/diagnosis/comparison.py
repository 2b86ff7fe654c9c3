"""Comparison of two diagnoses of one arm, such as before and after a repair: gap, causes, parameters."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path
from typing import Any

from armgap.diagnosis.result import MOST_BYTES, Cause, Diagnosis, Equivalent, RuledOut, Value
from armgap.errors import OptionError
from armgap.files.json_result import JsonResult
from armgap.files.reading import read_bounded
from armgap.literals import CauseStatus, GapOutcome, Verdict, joint_units
from armgap.log.findings import counted
from armgap.remainder import has_gap

__all__ = ["CauseChange", "Comparison", "GapChange", "ParameterChange", "compare", "read_diagnosis"]

_Place = tuple[str, int | None, tuple[int, ...] | None, tuple[int, int] | None]
_Key = tuple[_Place, str | None, int]
SCHEMA = "armgap.diagnosis/1"
#: Ratios of the gap above the noise floor, after to before, at which it counts as smaller or larger: different motions vary it by less.
SMALLER, LARGER = 0.8, 1.25
#: A parameter has changed if it differs by more than so many standard deviations of the difference, and by more than this share of itself.
SIGMAS, SHARE = 3.0, 0.02


@dataclass(frozen=True)
class GapChange:
    """The gap of one model in the earlier and in the later of two diagnoses.

    Attributes
    ----------
    model : {"before", "refit", "after"}
        Model with the arm file's parameters, with re-estimated parameters, or with the causes; as in `Gap`.
    before, after : tuple of float
        RMS position error per joint [rad or m] in the earlier and in the later diagnosis.
    factor : float or None
        Ratio of the gap above the noise floor, over all joints, in the later diagnosis to that in the earlier; 0 if none is left, None if there was
        none before. By its verdict a diagnosis may say that a model has no gap; what lies above its floor is then chance.
    """

    model: str
    before: tuple[float, ...]
    after: tuple[float, ...]
    factor: float | None


@dataclass(frozen=True)
class CauseChange:
    """Change of one cause between two diagnoses of an arm.

    Attributes
    ----------
    effect : str
        Name of the effect.
    joint : int or None
        1-based joint; a law on several joints is compared joint by joint.
    status : str
        ``"gone"``, ``"unseen"`` (the later log could not show it), ``"undecided"``, ``"new"``, ``"smaller"``, ``"larger"``, ``"unchanged"``, or
        ``"renamed"``: the later diagnosis names a look-alike of it.
    before, after : dict of str to Value, optional
        Parameters of the cause in each diagnosis that names it.
    why : str
        Reason of the status in words.
    joints, row : tuple of int, optional
        Two joints, and the factors of their positions in the sum or difference that the cause acts on.
    """

    effect: str
    joint: int | None
    status: CauseStatus
    before: dict[str, Value] | None
    after: dict[str, Value] | None
    why: str
    joints: tuple[int, ...] | None = None
    row: tuple[int, int] | None = None


@dataclass(frozen=True)
class ParameterChange:
    """Change of one parameter of the arm, in the model with causes, between two diagnoses.

    Attributes
    ----------
    name : str
        Name of the parameter.
    before, after : Value
        Estimates of the earlier and of the later diagnosis.
    sigmas : float or None
        Difference in standard deviations of the difference; None if no standard deviation is known.
    changed : bool
        Whether the difference is significant.
    """

    name: str
    before: Value
    after: Value
    sigmas: float | None
    changed: bool


@dataclass(frozen=True)
class Comparison(JsonResult):
    """Result of `compare`: changes of gap, causes and parameters between two diagnoses of one arm.

    Attributes
    ----------
    outcome : {"smaller", "larger", "unchanged", "none"}
        Change of the gap between log and arm file; ``"none"``: no gap before or after, as with verdict ``"none"`` of both.
    verdict_before, verdict_after : str
        The verdicts of the two diagnoses.
    gap : tuple of GapChange
        Changes of the gap with the arm file's parameters, with re-estimated parameters, and with causes.
    causes : tuple of CauseChange
        Every cause that either diagnosis names.
    parameters : tuple of ParameterChange
        Changes of the arm's parameters.
    notes : tuple of str
        Limitations of the comparison.
    unit : str
        Unit of positions.
    horizon_s : float
        Prediction horizon of both diagnoses [s].
    names : tuple of str
        Names of the two diagnoses.
    kind : str
        Kind of the arm.
    joint_units : tuple of str
        Unit of each joint's position; a serial arm may have rotary and linear joints.
    """

    outcome: GapOutcome
    verdict_before: Verdict
    verdict_after: Verdict
    gap: tuple[GapChange, ...]
    causes: tuple[CauseChange, ...]
    parameters: tuple[ParameterChange, ...]
    notes: tuple[str, ...]
    unit: str
    horizon_s: float
    names: tuple[str, str]
    kind: str = ""
    joint_units: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison as a JSON object, schema ``armgap.diagnosis.comparison/1``."""
        return {"schema": "armgap.diagnosis.comparison/1", **asdict(self)}


def read_diagnosis(path: str | Path) -> Diagnosis:
    """Read a diagnosis from a file of ``armgap diagnose --json``.

    Raises
    ------
    OptionError
        If the file is missing, not JSON, or not a whole diagnosis of the known schema.
    """
    remedy = "give a file that armgap diagnose --json wrote"
    try:
        data = json.loads(read_bounded(path, MOST_BYTES))
    except OSError as error:
        raise OptionError(f"cannot be read ({error.strerror or error})", remedy=remedy, file=path) from None
    except (ValueError, RecursionError):
        raise OptionError("is not JSON", remedy=remedy, file=path) from None
    schema = data.get("schema") if isinstance(data, dict) else None
    if schema != SCHEMA:
        raise OptionError(f"its schema is {schema!r}, not {SCHEMA!r}", remedy=remedy, file=path)
    try:
        return Diagnosis.from_dict(data)
    except KeyError as missing:
        raise OptionError(f"is not a whole diagnosis: {missing} is missing", remedy=remedy, file=path) from None
    except (TypeError, IndexError, AttributeError, ValueError):
        raise OptionError("is not a whole diagnosis: an entry has another form", remedy=remedy, file=path) from None


def compare(before: Diagnosis, after: Diagnosis, names: tuple[str, str] = ("before", "after")) -> Comparison:
    """Compare two diagnoses of one arm.

    Parameters
    ----------
    before, after : Diagnosis
        Diagnoses with equal horizon, for example before and after a repair.
    names : tuple of str
        Names of the two diagnoses in the comparison.

    Raises
    ------
    OptionError
        If the diagnoses are of different kinds of arm or have different horizons.
    """
    _check(before, after)
    gaps = tuple(_gap(before, after, model) for model in ("before", "refit", "after"))
    return Comparison(
        _outcome(gaps[0].factor, has_gap(after.to_dict(), "before")),
        before.verdict,
        after.verdict,
        gaps,
        _causes(before, after),
        _parameters(before, after),
        _notes(before, after),
        str(before.to_dict()["gap"].get("unit", "rad")),
        before.gap.horizon_s,
        names,
        str((before.to_dict().get("arm") or {}).get("kind", "")),
        tuple(joint_units(before.to_dict())),
    )


def _check(before: Diagnosis, after: Diagnosis) -> None:
    kinds = [(d.to_dict().get("arm") or {}).get("kind") for d in (before, after)]
    joints = [len(d.gap.before) for d in (before, after)]
    if kinds[0] != kinds[1] or joints[0] != joints[1]:
        raise OptionError(
            f"the diagnoses are of different arms ({kinds[0]} of {counted(joints[0], 'joint')}, {kinds[1]} of {joints[1]})",
            remedy="compare two diagnoses of one arm",
        )
    horizons = [d.gap.horizon_s for d in (before, after)]
    if horizons[0] != horizons[1]:
        raise OptionError(
            f"the diagnoses have different horizons ({horizons[0]:g} and {horizons[1]:g} s)",
            remedy="diagnose both with one --horizon",
        )


def _gap(before: Diagnosis, after: Diagnosis, model: str) -> GapChange:
    first, last = (tuple(getattr(d.gap, model)) for d in (before, after))
    scale = [max(v, 1e-300) for v in first]
    above = (_above(before, model), _above(after, model))
    size = [math.hypot(*(g / s for g, s in zip(a, scale, strict=True))) for a in above]
    return GapChange(model, first, last, size[1] / size[0] if size[0] > 0 else None)


def _above(diagnosis: Diagnosis, model: str) -> list[float]:
    """Return a model's prediction errors above the noise floor, per joint; zero where they are no gap."""
    if not has_gap(diagnosis.to_dict(), model):
        return [0.0] * len(diagnosis.gap.floor)
    return [max(v - f, 0.0) for v, f in zip(getattr(diagnosis.gap, model), diagnosis.gap.floor, strict=True)]


def _outcome(factor: float | None, has_gap: bool) -> GapOutcome:
    if factor is None:
        return "larger" if has_gap else "none"
    if factor < SMALLER:
        return "smaller"
    return "larger" if factor > LARGER else "unchanged"


def _causes(before: Diagnosis, after: Diagnosis) -> tuple[CauseChange, ...]:
    old, new = _placed(before), _placed(after)
    changes = []
    for key, cause in old.items():
        if key in new:
            status, why = _resized(cause.parameters, new[key].parameters)
            changes.append(_changed(cause, status, cause.parameters, new[key].parameters, why))
        else:
            named = {_place(single) for c in after.causes for single in (c, *c.by_joint())}
            alike = next((e.effect for e in cause.equivalents if _place(e) in named), None)
            status, why = _vanished(_place(cause), after, alike)
            changes.append(_changed(cause, status, cause.parameters, None, why))
    for key, cause in new.items():
        if key not in old:
            earlier = next((r for r in before.ruled_out if _place(r) == _place(cause)), None)
            changes.append(_changed(cause, "new", None, cause.parameters, _earlier(earlier)))
    return tuple(changes)


def _place(found: Cause | Equivalent | RuledOut) -> _Place:
    return found.effect, found.joint, found.joints, found.row


def _changed(
    cause: Cause, status: CauseStatus, before: dict[str, Value] | None, after: dict[str, Value] | None, why: str
) -> CauseChange:
    return CauseChange(cause.effect, cause.joint, status, before, after, why, cause.joints, cause.row)


def _placed(diagnosis: Diagnosis) -> dict[_Key, Cause]:
    """Return causes by effect, joint and log: a law on several joints joint by joint, external disturbances within one log by their order."""
    found: dict[_Key, Cause] = {}
    for cause in chain.from_iterable(cause.by_joint() for cause in diagnosis.causes):
        number = sum(key[:2] == (_place(cause), cause.log) for key in found)
        found[_place(cause), cause.log, number] = cause
    return found


def _vanished(place: _Place, after: Diagnosis, alike: str | None) -> tuple[CauseStatus, str]:
    """Return status and reason of a cause that the later diagnosis does not name."""
    if alike is not None:
        return "renamed", f"{alike} is named instead, which motion does not tell from it"
    found = next((r for r in after.ruled_out if _place(r) == place), None)
    if found is None:
        return "undecided", "the later diagnosis says nothing about it"
    if found.status == "not excited":
        return "unseen", found.why or "the later log could not show it"
    if found.status == "undecided":
        return "undecided", found.why or "the later log leaves it open"
    return "gone", _bound(found)


def _bound(found: RuledOut) -> str:
    if found.bound is None:
        return found.why or "absent"
    b = found.bound
    return f"{b.parameter} now within {b.value:.3g} {b.unit} ({b.level:.0%})"


def _earlier(found: RuledOut | None) -> str:
    if found is None:
        return "the earlier diagnosis says nothing about it"
    if found.status == "not excited":
        return "it may have been there before: the earlier log could not show it"
    return f"{found.status} before"


def _resized(before: dict[str, Value], after: dict[str, Value]) -> tuple[CauseStatus, str]:
    """Return status and reason of a cause that both diagnoses name, from its first changed parameter."""
    for name in before:
        change = _change(name, before[name], after[name]) if name in after else None
        if change and change.changed:
            grows = abs(change.after.value) > abs(change.before.value)
            return ("larger" if grows else "smaller"), f"{name} moved by {change.sigmas:.3g} sigma"
    return "unchanged", "no parameter moved beyond its uncertainty"


def _parameters(before: Diagnosis, after: Diagnosis) -> tuple[ParameterChange, ...]:
    old, new = (d.parameters["with_causes"] for d in (before, after))
    return tuple(_change(name, value, new[name]) for name, value in old.items() if name in new)


def _change(name: str, before: Value, after: Value) -> ParameterChange:
    difference = after.value - before.value
    sigma = math.hypot(before.sigma or 0.0, after.sigma or 0.0)
    if sigma <= 0:
        return ParameterChange(name, before, after, None, changed=False)
    matters = abs(difference) > SHARE * max(abs(before.value), abs(after.value))
    return ParameterChange(name, before, after, difference / sigma, bool(matters and abs(difference) > SIGMAS * sigma))


def _notes(before: Diagnosis, after: Diagnosis) -> tuple[str, ...]:
    notes = []
    if {k: v.value for k, v in before.parameters["nominal"].items()} != {
        k: v.value for k, v in after.parameters["nominal"].items()
    }:
        notes.append("the arm files differ, so the gap of the arm file as it is has changed with them")
    versions = [d.to_dict().get("version") for d in (before, after)]
    if versions[0] != versions[1]:
        notes.append(f"made with armgap {versions[0]} and {versions[1]}")
    notes.append("gaps depend on the motion too: compare logs of the same motion where you can")
    return tuple(notes)
