"""Positions that jump by a whole turn where a single-turn encoder wraps around: the jumps are removed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from armgap.arm.arm import Arm
from armgap.check.check import Check
from armgap.check.log_checks.outcome import NOTHING, Outcome, ranges, seconds
from armgap.log.conversion.turns import turn_jumps, unwrapped
from armgap.log.log import Log

__all__ = ["look"]


def look(log: Log, arm: Arm | None) -> Outcome:
    """Remove jumps by a turn where the path without the jump is smoother; linear joints are left as they are."""
    if arm is not None and not arm.rotary:
        return NOTHING
    found = []
    q, q_link = log.q.copy(), None if log.q_link is None else log.q_link.copy()
    for j in range(log.n_joints):
        at = np.flatnonzero(turn_jumps(log.q[:, j])) + 1
        if not len(at):
            continue
        q[:, j] = unwrapped(log.q[:, j])
        if q_link is not None:
            q_link[:, j] = unwrapped(q_link[:, j])
        times = "once" if len(at) == 1 else f"{len(at)} times"
        said = (
            f"q{j + 1} jumps by a whole turn {times}, first at {seconds(log.t[at[0]])}, and goes on smoothly without it"
        )
        found.append(Check("wrapped_positions", "repaired", said, (), j + 1, log.name, ranges(at)))
    return (
        Outcome(tuple(found), replace(log, q=q, q_link=q_link), None, "the turns were taken out") if found else NOTHING
    )
