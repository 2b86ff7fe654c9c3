"""Cases drawn at random: arm model, arm, effect, joint and size follow from a seed, and are not looked at before the scores."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from armgap.planning.open_questions.sizes import PLANNED
from armgap.trial.cases.case import possible
from armgap.trial.effects import REGISTRY, Draw, NoTravelError, usage
from armgap.trial.simulation.arms import random_arm

from .cases import ARMS, Case, multisine, play, write_arm

#: Duration of the large motion by which the sizes of effects are drawn, s.
STATED_S = 10.0
#: Range of the sizes of effects, on the trial's scale: 0 is barely visible in a large motion, 1 large; with sizes up to 1 every large motion settled
#: nearly every question.
SIZES = (-1.2, 0.0)


def draw(seed: int, number: int) -> Case | None:
    """Draw a case: a random arm of one of the arm models with one effect; return None where no size of the effect can be drawn.

    Sizes are drawn for a large motion, most below what is barely visible there.
    """
    rng = np.random.default_rng([seed, number])
    model = sorted(ARMS)[int(rng.integers(len(ARMS)))]
    arm = replace(random_arm(rng, model), step=ARMS[model].step)
    choices = [(name, joint) for name, joint in possible(arm.kind, arm.n_joints) if name in PLANNED]
    name, joint = choices[int(rng.integers(len(choices)))]
    plain = Case(model, name, joint, {}, arm)
    with tempfile.TemporaryDirectory() as folder:
        _, arm_file = write_arm(plain, seed, Path(folder))
        motion = multisine(arm_file, model, STATED_S, int(rng.integers(2**31)))
    trace = play(plain, arm, motion, hidden=False)
    index = (joint or 1) - 1
    try:
        drawn = REGISTRY[name].draw(Draw(rng, float(rng.uniform(*SIZES)), arm, index, usage([trace], index)))
    except NoTravelError:
        return None
    if not any(drawn.values()):  # a time below the simulator's step
        return None
    return replace(plain, parameters=drawn)
