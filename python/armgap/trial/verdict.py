"""Was the diagnosis right? Its first cause against what the key says, look-alikes counted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from armgap.trial.cases.key import HiddenEffect, Key

if TYPE_CHECKING:
    from armgap.diagnosis.result import Diagnosis

Name = tuple[str, int | None]


@dataclass(frozen=True)
class Judgement:
    """What came of a diagnosis.

    Attributes
    ----------
    right : bool
        The first cause is a hidden one, or its equivalent; without hidden effects, none was named.
    exact : bool
        Right without help of an equivalence.
    found : int
        Hidden effects among all causes.
    extra : int
        Causes named that are not hidden.
    named, hidden : str
        For people.
    """

    right: bool
    exact: bool
    found: int
    extra: int
    named: str
    hidden: str


def judge(diagnosis: Diagnosis, key: Key) -> Judgement:
    """Compare a diagnosis with the opened key."""
    named = [(c.effect, c.joint) for c in diagnosis.causes] if diagnosis.verdict == "effect" else []
    hidden = _distinct(key.effects)
    matches = [any(equivalent(n, h) for h in hidden) for n in named]
    return Judgement(
        right=matches[0] if named and hidden else not named and not hidden,
        exact=named[0] in hidden if named and hidden else not named and not hidden,
        found=sum(any(equivalent(n, h) for n in named) for h in hidden),
        extra=sum(not m for m in matches),
        named=describe(named),
        hidden=describe(hidden),
    )


def equivalent(named: Name, hidden: Name) -> bool:
    """Whether no log of motion alone separates the two: the look-alikes that hold for every log.

    A hidden rotor that couples the joints is also a rotor: most of what it does is inertia on joint 2's own acceleration.
    """
    if named == hidden or (named, hidden) == (("rotor_inertia", 2), ("rotor_coupling", None)):
        return True
    pair, joints = {named[0], hidden[0]}, {named[1], hidden[1]}
    if pair == {"coulomb_asymmetry", "torque_offset"}:
        return len(joints) == 1
    if pair == {"base_tilt", "encoder_offset"}:
        return joints == {None, 1}
    return pair == {"torque_gain"}


def describe(names: list[Name]) -> str:
    """Names for people: ``stribeck (joint 2)``."""
    if not names:
        return "no effect"
    return " and ".join(f"{n} (joint {j})" if j is not None else n for n, j in names)


def _distinct(effects: tuple[HiddenEffect, ...]) -> list[Name]:
    return list(dict.fromkeys((e.effect, e.joint) for e in effects))
