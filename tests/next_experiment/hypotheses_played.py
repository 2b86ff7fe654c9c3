"""A planned motion played on arms with each effect of the open questions in turn: largest shares of the limits that are used.

The values of the effects are drawn by the trial's generator for the planned motion, but are no larger than the planner considers possible.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

import armgap
from armgap.trial.effects import REGISTRY, Draw, NoTravelError, usage
from armgap.trial.simulation.arms import TrialArm
from armgap.trial.simulation.simulated_arm import Trace

from .cases import LIMITS, Case, Reference, play, poor

#: Largest share of a range of position or speed by which a played motion may exceed it.
EXCESS = 0.02


def used(trace: Trace, model: str, limit: tuple[float, ...]) -> dict[str, float]:
    """Return the largest share of the position, speed and torque limits that a played motion uses; 1 is at the limit."""
    low, high, speed, _ = (np.array(x) for x in LIMITS[model])
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    return {
        "position": float(np.max(np.abs(trace.q_true - middle) / half)),
        "speed": float(np.max(np.abs(trace.dq_true) / speed)),
        "torque": float(np.max(np.abs(trace.tau) / np.array(limit))),
    }


def is_followed(part: dict[str, float]) -> bool:
    """Return whether a played motion stayed within its limits of position and speed, up to :data:`EXCESS`; `part` are shares of limits."""
    return max(part["position"], part["speed"]) <= 1.0 + EXCESS


def hypotheses(plan: armgap.Plan) -> list[tuple[str, int | None, tuple[str, float] | None]]:
    """Return every effect in a plan's open questions, its joint, and, if known, a parameter with its largest possible value."""
    found: dict[tuple[str, int | None], tuple[str, float] | None] = {}
    for q in plan.questions:
        found[q.effect, q.joint] = None if q.sizes is None else (q.sizes[0], max(np.abs(q.sizes[1:])))
        if q.against != "none":
            found.setdefault((q.against, q.against_joint), None)
    return [(*place, largest) for place, largest in found.items() if place[0] in REGISTRY]


def played(case: Case, arm: TrialArm, plan: armgap.Plan, seed: int) -> Iterator[dict[str, object]]:
    """Play the planned motion on arms with each effect of the open questions in turn; yield the effect, its values and shares of limits used.

    An effect with which the arm could not follow the first, small motion is left out: the first log would have looked different. So is one so
    small that the simulator has no arm for it, as with a rotor without mass.
    """
    reference = Reference(plan.q_ref, plan.dq_ref, plan.tau_ff)
    bare = play(case, arm, reference, hidden=False)
    for number, (effect, joint, largest) in enumerate(hypotheses(plan)):
        rng = np.random.default_rng([seed, number])
        index = (joint or 1) - 1
        with suppress(NoTravelError, ValueError):
            values = REGISTRY[effect].draw(Draw(rng, float(rng.uniform()), arm, index, usage([bare], index)))
            if largest is not None and abs(values.get(largest[0], 0.0)) > largest[1]:
                values[largest[0]] = float(np.copysign(largest[1], values[largest[0]]))
            other = replace(case, effect=effect, joint=joint, parameters=values)
            if not is_followed(used(play(other, arm, poor(arm, case.arm)), case.arm, arm.torque_limit)):
                continue
            yield {
                "hypothesis": other.asked,
                "values": values,
                **used(play(other, arm, reference), case.arm, arm.torque_limit),
            }
