"""Judgement of a diagnosis: its first cause against the key, with equivalent effects accepted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from armgap.trial.cases.key import HiddenEffect, Key

if TYPE_CHECKING:
    from armgap.diagnosis.result import Diagnosis

Name = tuple[str, int | None]


@dataclass(frozen=True)
class Judgement:
    """Judgement of a diagnosis against the key of its case.

    Attributes
    ----------
    right : bool
        Whether the first cause is hidden, or equivalent to a hidden one; without hidden effects, whether none was named.
    exact : bool
        Whether the diagnosis is right without an equivalence.
    found : int
        Number of hidden effects that a named cause equals or is equivalent to.
    extra : int
        Number of named causes that are neither hidden effects nor equivalent to one.
    named, hidden : str
        Named causes and hidden effects, each with its joint, in words.
    """

    right: bool
    exact: bool
    found: int
    extra: int
    named: str
    hidden: str


def judge(diagnosis: Diagnosis, key: Key) -> Judgement:
    """Return the judgement of a diagnosis against the opened key of its case."""
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
    """Return whether no log of motion distinguishes two effects: equivalents that hold for every log.

    A hidden rotor coupling may be named as rotor inertia of joint 2: most of its torque is inertia times joint 2's own acceleration.
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
    """Return effects with joints in words: ``stribeck (joint 2)``."""
    if not names:
        return "no effect"
    return " and ".join(f"{n} (joint {j})" if j is not None else n for n, j in names)


def _distinct(effects: tuple[HiddenEffect, ...]) -> list[Name]:
    return list(dict.fromkeys((e.effect, e.joint) for e in effects))
