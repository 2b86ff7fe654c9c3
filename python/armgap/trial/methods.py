"""The methods under trial: armgap's own diagnosis, and the baselines. Each method maps a sealed case to an answer."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from armgap import _native
from armgap.diagnosis.result import GapAtHorizon
from armgap.trial.answers import AbsentEffect, Answer, NamedCause, Size

if TYPE_CHECKING:
    from armgap.diagnosis.result import Cause, Diagnosis
    from armgap.trial.cases.sealed import SealedCase

__all__ = ["ARMGAP", "Method", "methods"]

HORIZON = 0.25  # horizon of the windows by which methods fit and predict, s


@cache
def _build() -> str:
    """Return the version of armgap with a hash of the compiled core; answers of another build are computed again."""
    core = hashlib.sha256(Path(_native.__file__).read_bytes()).hexdigest()
    return f"{_native.__version__}+{core[:8]}"


@dataclass(frozen=True)
class Method:
    """A method under trial.

    Attributes
    ----------
    name, title : str
        Name as in folders of answers, and title as in tables.
    settings : str
        Description and settings of the method, in one sentence or two.
    answer : callable
        Function that returns the method's answer to a sealed case.
    version : callable
        Function that returns the version of the method's software; answers of another version are computed again.
    check : callable
        Function that raises if the method cannot run.
    expresses : frozenset of str, optional
        Effects that the method can name, with their equivalents; None for a method that can name all.
    """

    name: str
    title: str
    settings: str
    answer: Callable[[SealedCase], Answer]
    version: Callable[[], str] = _build
    check: Callable[[], None] = lambda: None
    expresses: frozenset[str] | None = None


def methods() -> dict[str, Method]:
    """Return all methods under trial by name, armgap first."""
    from armgap.trial.baselines.all import BASELINES

    return {m.name: m for m in (ARMGAP, *BASELINES)}


def answer_with_armgap(case: SealedCase) -> Answer:
    """Return armgap's answer to a case: a diagnosis with default settings."""
    from armgap.diagnosis.diagnosis import diagnose

    result = diagnose(case.training, case.arm, holdout=case.holdout, horizon=HORIZON)
    return from_diagnosis(result, case.arm.parameter_names)


def from_diagnosis(result: Diagnosis, names: Sequence[str]) -> Answer:
    """Return a diagnosis as an answer; `names` are the arm's parameter names in order."""
    gap = result.gap
    final = result.parameters["with_causes"]
    absent = [r for r in result.ruled_out if r.status == "absent" and r.bound is not None]
    return Answer(
        method="armgap",
        verdict=result.verdict,
        causes=tuple(_named(c) for c in result.causes) if result.verdict == "effect" else (),
        limits=tuple(AbsentEffect(r.effect, r.joint, r.bound.parameter, r.bound.value) for r in absent if r.bound),
        reach=GapAtHorizon(gap.horizon_s, gap.before, gap.refit, gap.after, gap.floor),
        theta=tuple(final[name].value for name in names),
        place=result.where[0].joint if result.where else None,
        remark=_first_ranks(result),
    )


def _named(cause: Cause) -> NamedCause:
    sizes = {key: Size(x.value, x.sigma) for key, x in cause.parameters.items()}
    alike = tuple((e.effect, e.joint) for e in cause.equivalents)
    return NamedCause(cause.effect, cause.joint, cause.probability, sizes, alike)


def _first_ranks(result: Diagnosis) -> str:
    """Return a remark with the candidates that alone close most of the gap, for the analysis of failures."""
    first = result.extra.get("ranking", [])[:5]
    return ", ".join(f"{r['effect']}:{r['joint'] or ''} {r['closed']:.0%}" for r in first)


ARMGAP = Method(
    "armgap",
    "armgap",
    "armgap diagnose with its default settings: output error over windows of 0.25 s, judged on the held-out log",
    answer_with_armgap,
)
