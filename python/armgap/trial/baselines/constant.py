"""Baseline with a constant guess, independent of the logs."""

from __future__ import annotations

from armgap.trial.answers import Answer, NamedCause
from armgap.trial.cases.sealed import SealedCase
from armgap.trial.methods import Method

__all__ = ["CONSTANT"]

#: Constant guess: Stribeck friction of joint 1, the effect most often named in the literature on friction; its probability is one over 24 effects.
GUESS = NamedCause("stribeck", 1, probability=1.0 / 24.0)


def answer(case: SealedCase) -> Answer:
    """Return the constant guess as answer, whatever the logs."""
    return Answer("constant", "effect", (GUESS,))


CONSTANT = Method("constant", "constant guess", "always names Stribeck friction of joint 1", answer)
