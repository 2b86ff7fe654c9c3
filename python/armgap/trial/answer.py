"""Whether a diagnosis names what a key hides.

Some effects cannot be told apart by any log of motion alone; naming one of them for the other is right. Which these
are does not depend on the log:

* asymmetric Coulomb friction and a torque offset of the same joint, while it moves;
* a tilt of the base and an encoder offset of joint 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from armgap.trial.key import Hidden, Key


class Named(Protocol):
    """What a diagnosis says of one cause."""

    @property
    def effect(self) -> str:
        """Standard name."""
        ...

    @property
    def joint(self) -> int | None:
        """From 1; None for the whole arm."""
        ...


class Answer(Protocol):
    """What is judged: a verdict and the causes, strongest first."""

    @property
    def verdict(self) -> str:
        """``none``, ``parameters``, ``effect`` or ``unexplained``."""
        ...

    @property
    def causes(self) -> Sequence[Named]:
        """Named causes."""
        ...


@dataclass(frozen=True)
class Judgement:
    """How an answer compares with the key.

    Attributes
    ----------
    right : bool
        The first cause is hidden, cause and joint; or nothing is hidden and no effect was named.
    look_alike : bool
        Right by an equivalent effect.
    found : int
        How many of the hidden effects were named, at any place.
    extra : int
        How many causes were named that are not hidden.
    """

    right: bool
    look_alike: bool
    found: int
    extra: int


def judge(key: Key, answer: Answer) -> Judgement:
    """Compare a diagnosis with the key of its case.

    Parameters
    ----------
    key : Key
        What is hidden.
    answer : Answer
        A diagnosis, or anything with a verdict and causes.
    """
    causes = list(answer.causes) if answer.verdict == "effect" else []
    if not key.effects:
        return Judgement(right=not causes, look_alike=False, found=0, extra=len(causes))
    first = [h for h in key.effects if causes and matches(causes[0], h)]
    exact = [h for h in first if h.effect == causes[0].effect]
    return Judgement(
        right=bool(first),
        look_alike=bool(first) and not exact,
        found=sum(any(matches(c, h) for c in causes) for h in key.effects),
        extra=sum(not any(matches(c, h) for h in key.effects) for c in causes),
    )


def matches(named: Named, hidden: Hidden) -> bool:
    """Whether a named cause is the hidden effect, or one that no log tells from it."""
    return _canonical(named.effect, named.joint) == _canonical(hidden.effect, hidden.joint)


def _canonical(effect: str, joint: int | None) -> tuple[str, int | None]:
    if effect == "coulomb_asymmetry":
        return "torque_offset", joint
    if (effect, joint) == ("encoder_offset", 1):
        return "base_tilt", None
    return effect, joint


def in_words(effect: str, joint: int | None) -> str:
    """``stribeck of joint 2``, ``payload of the whole arm``."""
    return f"{effect} of " + ("the whole arm" if joint is None else f"joint {joint}")
