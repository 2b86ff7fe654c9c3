"""Questions that a diagnosis left open: causes against their equivalents, effects that are undecided or were not excited, candidates."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from armgap import _native
from armgap.arm.arm import Arm
from armgap.errors import OptionError
from armgap.evidence.hypothesis import Hypothesis
from armgap.planning.open_questions.sizes import PLANNED

__all__ = ["NONE", "Question", "asked", "known_model", "open_questions"]

Data = dict[str, Any]
EffectOnJoint = tuple[str, int | None]
NONE = "none"
"""Word that stands in place of a rival effect where the question is whether an effect is present or absent."""

_ORDER = ("equivalents", "candidate", "undecided", "not excited")


@dataclass(frozen=True)
class Question:
    """An open question: an effect against another effect, or against its absence.

    Attributes
    ----------
    effect, joint : str, int or None
        Effect in question and its joint.
    against, against_joint : str, int or None
        Rival effect and its joint; ``"none"`` for the absence of `effect`.
    origin : {"asked", "equivalents", "candidate", "undecided", "not excited"}
        Reason why the question is open.
    estimate : dict of str to (value, sigma), optional
        The diagnosis' estimates of the parameters of `effect` [SI].
    bound : float, optional
        Upper 95 % confidence limit of the size of `effect`, where it was not found [SI].
    replaced : frozenset of (str, int or None)
        Named causes in whose place `effect` would be: neither model of the question holds them.
    why : str
        The diagnosis' remark on the effect.
    """

    effect: str
    joint: int | None
    against: str = NONE
    against_joint: int | None = None
    origin: str = "asked"
    estimate: dict[str, tuple[float, float]] | None = None
    bound: float | None = None
    replaced: frozenset[EffectOnJoint] = frozenset()
    why: str = ""

    @property
    def place(self) -> tuple[str, int | None]:
        """Name of the effect in question, and its joint."""
        return self.effect, self.joint

    @property
    def rival(self) -> tuple[str, int | None]:
        """Name of the rival effect, ``"none"`` for absence, and its joint."""
        return self.against, self.against_joint

    @property
    def text(self) -> str:
        """The question as one line, as ``backlash:2 against none``."""
        return f"{spelt(*self.place)} against {spelt(*self.rival) if self.against != NONE else NONE}"


def inseparable(data: Data) -> set[frozenset[tuple[str, int | None]]]:
    """Return the pairs of a named cause and an equivalent, by effect and joint, that no motion separates."""
    return {
        frozenset(((cause["effect"], cause["joint"]), (other["effect"], other["joint"])))
        for cause in data["causes"]
        for other in cause["equivalents"]
        if not other.get("motion_separates", True)
    }


def spelt(effect: str, joint: int | None) -> str:
    """Return an effect in the form of a command-line option, ``EFFECT:JOINT``."""
    return effect if joint is None else f"{effect}:{joint}"


def known_model(data: Data, arm: Arm) -> tuple[Hypothesis, tuple[str, ...]]:
    """Return a diagnosis' model with all causes that can be simulated, and remarks on causes left out."""
    full = Hypothesis.of(data, arm)
    names = {entry["name"] for entry in _native.effects()}
    kept = tuple(e for e in full.effects if e.effect in names and e.log is None)
    gone = [spelt(e.effect, e.joint) for e in full.effects if e not in kept]
    notes = [f"the planned motion is predicted without {', '.join(dict.fromkeys(gone))}"] if gone else []
    return full.only(kept), tuple(notes)


def open_questions(data: Data) -> tuple[list[Question], list[str]]:
    """Return the questions that a diagnosis leaves open, and remarks on questions that no motion can settle.

    Parameters
    ----------
    data : dict
        Diagnosis as a JSON object.
    """
    found: list[Question] = []
    remarks: list[str] = []
    same = inseparable(data)
    for cause in data["causes"]:
        for other in cause["equivalents"]:
            separates = other.get("motion_separates", True)
            if separates and cause["effect"] in PLANNED and other["effect"] in PLANNED:
                question = Question(cause["effect"], cause["joint"], other["effect"], other["joint"], "equivalents")
                found.append(replace(question, estimate=_estimate(cause), why=other.get("why") or ""))
            else:
                pair = f"{spelt(cause['effect'], cause['joint'])} against {spelt(other['effect'], other['joint'])}"
                remarks.append(f"{pair}: {other.get('why') or 'not a matter of the arm'}; no motion is planned for it")
    for candidate in data.get("candidates") or []:
        if candidate["effect"] in PLANNED:
            question = Question(
                candidate["effect"], candidate["joint"], origin="candidate", estimate=_estimate(candidate)
            )
            found.append(replace(question, why=candidate.get("why") or ""))
    for entry in data["ruled_out"]:
        if entry["status"] not in ("undecided", "not excited") or entry["effect"] not in PLANNED:
            continue
        place, why = (entry["effect"], entry["joint"]), entry.get("why") or ""
        if any(place in pair for pair in same):
            continue  # said beside the cause that it is the same as
        instead = [c for c in data["causes"] if _would_stand_for(entry, c)]
        for cause in instead:
            question = Question(cause["effect"], cause["joint"], *place, "undecided", _estimate(cause))
            found.append(replace(question, why=why))
        if entry["status"] == "not excited" or entry.get("bound"):
            found.append(replace(_against_absence(*place, data), origin=entry["status"], why=why))
        elif not instead:
            remarks.append(f"{spelt(*place)}: {why}; no motion is planned for it")
    return _once(found), list(dict.fromkeys(remarks))


def _would_stand_for(entry: Data, cause: Data) -> bool:
    """Return whether an undecided effect could replace a named cause: the reason for its status mentions the cause's title and joint."""
    where = "" if cause["joint"] is None else f", joint {cause['joint']}"
    named = f"in place of {cause.get('title')}{where} "
    return entry["status"] == "undecided" and cause["effect"] in PLANNED and named in (entry.get("why") or "")


def asked(texts: Sequence[str], data: Data, arm: Arm) -> list[Question]:
    """Return the questions requested by the user, ``EFFECT:JOINT`` each: the effect against its absence, and against its equivalents.

    An effect that no motion separates from a named cause has that cause's equivalents: what separates them from the cause separates them from it.

    Raises
    ------
    OptionError
        If an effect does not exist, or not on that joint, or no motion can be planned for it.
    """
    found = []
    for text in (texts,) if isinstance(texts, str) else texts:
        effect, joint = _parse(text, arm)
        pairs = [q for q in open_questions(data)[0] if q.against != NONE]
        alike = {(effect, joint)}.union(*(pair for pair in inseparable(data) if (effect, joint) in pair))
        found += [q for q in pairs if q.place in alike and q.rival not in alike]
        absent = _against_absence(effect, joint, data)
        found += [
            replace(absent, against=q.effect, against_joint=q.joint, origin=q.origin, why=q.why)
            for q in pairs
            if q.rival == (effect, joint)
        ]
        found.append(absent)
    return _once(found)


def _against_absence(effect: str, joint: int | None, data: Data) -> Question:
    """Return the question whether an effect is present, with what the diagnosis knows of its size.

    The diagnosis fitted the effect to the arm without causes (`ranking`). That is its estimate where no cause is named, or where the effect would be
    in the place of one.
    """
    place = (effect, joint)
    for entry in (*data["causes"], *(data.get("candidates") or [])):
        if (entry["effect"], entry["joint"]) == place:
            return Question(*place, estimate=_estimate(entry))
    bounds = [r for r in data["ruled_out"] if (r["effect"], r["joint"]) == place]
    replaced = frozenset((c["effect"], c["joint"]) for c in data["causes"] if _is_alternative(place, c, bounds))
    fitted = [r for r in data.get("ranking") or [] if (r["effect"], r["joint"]) == place]
    return Question(
        *place,
        estimate=_estimate(fitted[0]) if fitted and (replaced or not data["causes"]) else None,
        bound=_bound(bounds[0]) if bounds else None,
        replaced=replaced,
    )


def _is_alternative(place: EffectOnJoint, cause: Data, entries: list[Data]) -> bool:
    """Return whether an effect would be in the place of a named cause: it is among the cause's equivalents, or its entry says so."""
    equivalents = [(other["effect"], other["joint"]) for other in cause["equivalents"]]
    return place in equivalents or any(_would_stand_for(entry, cause) for entry in entries)


def _parse(text: str, arm: Arm) -> tuple[str, int | None]:
    match = re.fullmatch(r"([a-z_]+)(?::([0-9]{1,3}))?", str(text).strip())
    if match is None:
        raise OptionError(f"`{text}` is not an effect on a joint", remedy="write EFFECT:JOINT such as backlash:2")
    effect, number = match[1], match[2]
    scopes = {entry["name"]: entry["scope"] for entry in _native.effects()}
    if effect not in scopes:
        raise OptionError(f"`{effect}` is not an effect", remedy=f"known: {', '.join(PLANNED)}")
    if effect not in PLANNED:
        raise OptionError(f"`{effect}` comes from outside the arm", remedy="no motion can be planned for it")
    if scopes[effect] == "arm":
        if number:
            raise OptionError(f"`{effect}` is an effect of the whole arm", remedy=f"write {effect}")
        return effect, None
    if number is None or not 1 <= int(number) <= arm.n_joints:
        remedy = f"write {effect}:J with J from 1 to {arm.n_joints}"
        raise OptionError(f"`{text}` names no joint of this arm", remedy=remedy)
    return effect, int(number)


def _estimate(entry: Data) -> dict[str, tuple[float, float]]:
    """Return value and standard deviation of each parameter of an entry; JSON has null for one that is infinite."""
    sigma = {name: math.inf if p["sigma"] is None else float(p["sigma"]) for name, p in entry["parameters"].items()}
    return {name: (float(p["value"]), sigma[name]) for name, p in entry["parameters"].items()}


def _bound(entry: Data) -> float | None:
    bound = entry.get("bound")
    return float(bound["value"]) if bound else None


def _once(questions: list[Question]) -> list[Question]:
    """Return the questions without repeats; a pair asked from both sides counts once."""
    found: dict[frozenset[tuple[str, int | None]], Question] = {}
    for question in questions:
        found.setdefault(frozenset((question.place, question.rival)), question)
    return list(found.values())


def rank(question: Question) -> int:
    """Return the sort key of a question by its origin: 0 for causes against equivalents, which come first."""
    return _ORDER.index(question.origin) if question.origin in _ORDER else 0
