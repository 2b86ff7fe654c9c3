"""Score of a method's answer to one case against the case's opened key."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from armgap.simulation import effects
from armgap.trial.answers import Answer, Name, NamedCause
from armgap.trial.cases.key import Key
from armgap.trial.verdict import describe, equivalent

__all__ = ["GROUPS", "CaseScore", "hidden_names", "score_case"]

#: Groups of cases in the order of the tables, with the rule for a right answer in each.
GROUPS = {
    "one effect": "the first cause is the hidden one, on its joint, or its equivalent",
    "two effects": "the first cause is one of the two, or its equivalent",
    "not visible": "no wrong cause is named",
    "no effect": "no cause is named",
    "parameters only": "no cause is named",
    "outside the library": "no cause is named",
}


@dataclass(frozen=True)
class CaseScore:
    """Score of one method's answer to one case.

    Attributes
    ----------
    case, group, model, style : str
        Name of the case, its group (a key of :data:`GROUPS`), its machine, and the style of motion of its first training log.
    hidden : tuple of (effect, joint)
        Hidden effects with their joints (from 1), without repeats.
    visible : float
        Prediction error by the least visible hidden effect as a multiple of the floor; see
        `armgap.trial.cases.visibility`.
    named : tuple of NamedCause
        Named causes, the first cause first.
    matches : tuple of bool
        Whether each named cause is hidden, or equivalent to a hidden one.
    right, exact : bool
        Whether the answer is right by the rule of the group; whether it is right without an equivalence.
    listed : bool
        Whether the answer is right, or a hidden effect is among the look-alikes of the first cause.
    found : int
        Number of hidden effects that a named cause equals or is equivalent to.
    located : bool, optional
        Whether the joint named for most of the gap is that of the hidden effects; None if no joint is named, or they have no single joint.
    verdict, error, seconds
        Verdict, error and CPU time [s] of the answer.
    """

    case: str
    group: str
    model: str
    style: str
    hidden: tuple[Name, ...]
    visible: float
    named: tuple[NamedCause, ...]
    matches: tuple[bool, ...]
    right: bool
    exact: bool
    listed: bool
    found: int
    located: bool | None
    verdict: str
    error: str | None
    seconds: float
    extra_details: dict[str, Any] = field(default_factory=dict, repr=False)

    @property
    def extra(self) -> int:
        """Number of named causes that are neither hidden effects nor equivalent to one."""
        return sum(not m for m in self.matches)

    @property
    def headline(self) -> str:
        """Hidden effects and named causes of the case in one line."""
        named = " and ".join(f"{describe([n.name])} p={n.probability:.2f}" for n in self.named)
        return f"{describe(list(self.hidden))} -> {named or self.verdict}"


def score_case(case: str, answer: Answer, key: Key) -> CaseScore:
    """Return the score of a method's answer to a case; the rules in :data:`GROUPS` define a right answer."""
    hidden, named = hidden_names(key), answer.causes
    matches = tuple(any(equivalent(n.name, h) for h in hidden) for n in named)
    group = _group(key, hidden)
    return CaseScore(
        case=case,
        group=group,
        model=key.details["model"],
        style=next(iter(key.details["motions"].values())),
        hidden=hidden,
        visible=_visible(key),
        named=named,
        matches=matches,
        right=answer.error is None and _right(group, matches),
        exact=answer.error is None and _right(group, tuple(n.name in hidden for n in named)),
        listed=bool(named) and _listed(named[0], matches[0], hidden),
        found=sum(any(equivalent(n.name, h) for n in named) for h in hidden),
        located=_located(answer, hidden, key),
        verdict=answer.verdict,
        error=answer.error,
        seconds=answer.seconds,
    )


def _located(answer: Answer, hidden: tuple[Name, ...], key: Key) -> bool | None:
    joints = {joint for _, joint in hidden}
    if answer.place is None or len(joints) != 1 or None in joints or key.details["kind"] != "two-link":
        return None
    return answer.place in joints


def hidden_names(key: Key) -> tuple[Name, ...]:
    """Return the hidden effects of a key with their joints, in order and without repeats."""
    return tuple(dict.fromkeys((e.effect, e.joint) for e in key.effects))


def _group(key: Key, hidden: Sequence[Name]) -> str:
    if not hidden:
        return "no effect" if key.nominal == "exact" else "parameters only"
    if not key.details.get("visible", True):
        return "not visible"
    if any(e.effect not in _library() for e in key.effects):
        return "outside the library"
    return "one effect" if len(hidden) == 1 else "two effects"


@cache
def _library() -> frozenset[str]:
    """Return the names of the effects in armgap's library."""
    return frozenset(e["name"] for e in effects())


def _visible(key: Key) -> float:
    return min(
        (float(x["above_floor"]) for x in key.details.get("visibility", {}).values() if "above_floor" in x), default=0.0
    )


def _right(group: str, matches: tuple[bool, ...]) -> bool:
    if group in ("one effect", "two effects"):
        return bool(matches) and matches[0]
    if group == "not visible":
        return all(matches)
    return not matches


def _listed(first: NamedCause, match: bool, hidden: Sequence[Name]) -> bool:
    return match or any(equivalent(alike, h) for alike in first.look_alikes for h in hidden)
