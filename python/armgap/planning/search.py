"""The motion with the most evidence for all questions: differential evolution from usual motions (Storn and Price 1997)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import MotionLimits
from armgap.errors import OptionError
from armgap.planning.criterion import PredictedMotion, Setting
from armgap.planning.dynamics import inverse_dynamics, torque_with
from armgap.planning.limits import TORQUE_MARGIN, TORQUE_MOST, PlanLimits
from armgap.planning.motion import LOOK_HZ, Motion, build, count, named
from armgap.planning.open_questions.hypotheses import TestedQuestion
from armgap.planning.outcome import Outcome
from armgap.progress import report_progress

__all__ = ["Found", "Search", "standard"]

Array = NDArray[np.float64]

#: Number of motions in a generation of differential evolution, and number of generations after the first.
POPULATION, GENERATIONS = 20, 9
#: Largest number of windows on which motions are compared, and number of best motions that are compared again on all windows.
_MAX_COMPARED_WINDOWS, FINALISTS = 20, 4
#: Largest number of steps in which a motion is scaled down until its torques are within limits and it is free of collision.
_MAX_SCALING_STEPS = 12
#: Factor per step by which a motion with a collision is scaled down.
_SHRINK = 0.8
#: Part of a motion whose torques stand for those of the smallest motion: friction and weight.
_LEAST_SCALE = 1e-3
#: Part of the torque that a motion may take from which friction and weight alone are named as what leaves no motion.
_MOSTLY_CARRIED = 0.8
#: Interval, in prediction steps, at which torques are checked while a motion is scaled down.
COARSE = 4
#: Number of poses per joint at which the torque left for accelerations is computed, and smallest value assumed for it, as a part of the limit.
_POSES_PER_JOINT, LEFT = 5, 0.1
#: Part of the torque left for accelerations that a joint's own acceleration takes; the rest is for the other joints' accelerations.
COUPLED = 0.6
#: Usual motions with which a search begins, and pairs of poses at which they oscillate, from 0 to 1 of each joint's range.
_SEEDS = ("slow, then fast", "large travel", "fast multisine", "slow reversals", "one multisine", "one slow multisine")
_POSE_PAIRS = ((0.5, 0.5), (0.3, 0.7), (0.8, 0.35))


@dataclass(frozen=True)
class Found:
    """Best motion that a search found for the open questions of a diagnosis: whether an effect or its rival is in the arm.

    Attributes
    ----------
    motion : Motion
        Motion expected to settle the largest share of the questions.
    evaluations : int
        Number of motions tried.
    most : ndarray, shape (n_questions,)
        Largest expected log-likelihood ratio of effect and rival that any motion tried gave, per question.
    """

    motion: Motion
    evaluations: int
    most: Array


def standard(n_joints: int) -> Array:
    """Return the design variables of the usual motion with which sizes of effects are judged."""
    return named("slow, then fast", n_joints, (0.35, 0.65))


class Search:
    """Search for the motion within limits that gives the most evidence for some questions.

    Parameters
    ----------
    setting : Setting
        Models, noise and horizon of the expected evidence.
    limits : PlanLimits
        Limits of the motion.
    duration : float
        Length of the motion [s].
    """

    def __init__(self, setting: Setting, limits: PlanLimits, duration: float) -> None:
        self._setting = setting
        self._limits = limits
        self._duration = duration
        self._check_home()
        self._inner = self._reachable(limits.inner())

    def _check_home(self) -> None:
        """Raise an error if the arm collides with itself or a box at the home pose, or its torques cannot hold it there."""
        space = self._limits.motion.space
        if space is not None and (pair := space.touched(self._limits.home)) is not None:
            raise OptionError(
                f"{pair} touch where the motion begins",
                remedy="correct boxes and link_radius, or choose limits that contain a pose in which they do not",
            )
        if self._limits.torque is None:
            return
        rest = np.zeros((1, len(self._limits.home)))
        needed = np.abs(inverse_dynamics(self._setting.model, self._limits.home[None], rest, rest)[0])
        for j in np.flatnonzero(needed > TORQUE_MARGIN * self._limits.torque):
            raise OptionError(
                f"joint {j + 1} needs {needed[j]:.3g} of its {self._limits.torque[j]:.3g} torque to rest where the motion begins",
                remedy="correct torque_limit, or choose limits that contain a pose that takes less",
            )

    def _reachable(self, inner: MotionLimits) -> MotionLimits:
        """Return limits with accelerations reduced to an estimate of those possible with the torque that gravity and friction leave."""
        if self._limits.torque is None:
            return inner
        arm, model = self._setting.arm, self._setting.model
        ends = [
            np.linspace(a, b, _POSES_PER_JOINT) for a, b in zip(inner.position_min, inner.position_max, strict=True)
        ]
        poses = np.stack(np.meshgrid(*ends, indexing="ij"), axis=-1).reshape(-1, arm.n_joints)
        rest = np.zeros_like(poses)
        carried = np.abs(inverse_dynamics(model, poses, rest, rest)).max(axis=0)
        theta, first = np.array(model.theta), arm.n_inertial
        friction = theta[first + arm.n_joints :] + theta[first : first + arm.n_joints] * inner.speed
        left = np.maximum(TORQUE_MARGIN * self._limits.torque - carried - friction, LEFT * self._limits.torque)
        inertia = np.array([np.diag(m) for m in model.inertia(poses)]).max(axis=0)
        return replace(inner, acceleration=np.minimum(inner.acceleration, COUPLED * left / inertia))

    def motion(self, numbers: Array) -> Motion:
        """Return the motion for design variables from 0 to 1, within limits of position, speed, acceleration, torque and free space."""
        period = self._setting.arm.sample_period
        motion = build(numbers, self._limits.home, self._inner, self._duration, period)
        return self._allowed(motion, (), TORQUE_MARGIN)

    def _allowed(self, motion: Motion, effects: Sequence[Any], part: float) -> Motion:
        """Scale a motion down until its torques are within a part of the limit and the arm is free of collision."""
        for _ in range(_MAX_SCALING_STEPS):
            within = self._within(motion, effects, part)
            motion = self._clear(within)
            if motion is within:
                return motion
        return motion.scaled(0.0)

    def _clear(self, motion: Motion) -> Motion:
        """Scale a motion down until the arm is free of collision."""
        space = self._limits.motion.space
        if space is None:
            return motion
        t = np.linspace(0.0, motion.duration, math.ceil(motion.duration * LOOK_HZ) + 1)
        for _ in range(_MAX_SCALING_STEPS):
            if space.is_free(motion.at(t)[0]):
                return motion
            motion = motion.scaled(_SHRINK)
        return motion.scaled(0.0)

    def _within(self, motion: Motion, effects: Sequence[Any], part: float) -> Motion:
        """Scale a motion down until its torques, under the best model with some effects added, are within a part of the limit."""
        limit = self._limits.torque
        if limit is None:
            return motion
        h = self._setting.step * COARSE
        t = np.arange(0.0, motion.duration, h)
        for _ in range(_MAX_SCALING_STEPS):
            ratio = float(np.max(np.abs(self._torques(motion, effects, t)) / (part * limit)))
            if ratio <= 1.0:
                return motion
            motion = motion.scaled(max(0.5, min(0.97, 0.98 / ratio)))
        return motion.scaled(0.0)

    def _torques(self, motion: Motion, effects: Sequence[Any], t: Array) -> Array:
        """Return the torques of a motion under the best model with some effects added, shape (n_times, n_joints)."""
        states = motion.at(t)
        tau = inverse_dynamics(self._setting.model, *states)
        return torque_with(self._setting.model, effects, t, states, tau) if effects else tau

    def kept(self, motion: Motion, tested: Sequence[TestedQuestion]) -> Motion:
        """Scale a motion down until its torques suffice under every model in question and the arm is free of collision."""
        for p in tested:
            largest = p.pair.alternatives[-1][1][-1]
            motion = self._allowed(motion, (largest,), TORQUE_MOST)
        return motion

    def usual(self) -> PredictedMotion:
        """Return a usual motion within the limits, by which sizes of effects are judged.

        Raises
        ------
        OptionError
            If the limits allow no motion, or none along which the best model can be predicted.
        """
        motion = build(
            standard(len(self._limits.home)),
            self._limits.home,
            self._inner,
            self._duration,
            self._setting.arm.sample_period,
        )
        allowed = self._allowed(motion, (), TORQUE_MARGIN)
        if allowed.scale == 0.0:
            raise self._no_motion(motion, (), TORQUE_MARGIN)
        played = self.play(allowed)
        try:
            played.sensitivities()
        except ValueError:
            states = [np.abs(x).max(axis=0) for x in (played.q - self._limits.home, played.dq)]
            travel, speed = (", ".join(f"{x:.2g}" for x in values) for values in states)
            raise OptionError(
                f"the arm cannot be predicted along a motion within these limits, which moves the joints by {travel} at speeds up to {speed}",
                remedy="widen position_min, position_max or speed in [limits]",
            ) from None
        return played

    def _no_motion(self, motion: Motion, effects: Sequence[Any], part: float) -> OptionError:
        """Return the error for a motion that no scale brings within the limits, with the joint whose torque does not suffice."""
        limit = self._limits.torque
        if limit is not None:
            t = np.arange(0.0, motion.duration, self._setting.step * COARSE)
            carried = np.abs(self._torques(motion.scaled(_LEAST_SCALE), effects, t)).max(axis=0)
            j = int(np.argmax(carried / limit))
            if carried[j] > _MOSTLY_CARRIED * part * limit[j]:
                taken = f"friction, weight and effects alone take {carried[j]:.3g}"
                return OptionError(
                    f"torque_limit of joint {j + 1} is {limit[j]:.3g}, of which a motion may take {part:.0%}; {taken}",
                    remedy="correct torque_limit, or choose limits near a pose that takes less",
                )
        return OptionError(
            "no motion within the limits is free of collision and within the torques",
            remedy="correct boxes, link_radius and torque_limit, or choose other limits",
        )

    def play(self, motion: Motion) -> PredictedMotion:
        """Return a motion with the torques that it needs and the predictions of models along it."""
        return PredictedMotion(self._setting, motion)

    def best(self, tested: Sequence[TestedQuestion], threshold: float, seed: int) -> Found:
        """Return the motion with the most expected evidence that a search finds for some questions; equal seeds give equal motions."""
        from scipy.optimize import differential_evolution

        state = _State(np.zeros(len(tested)))
        total = POPULATION * (GENERATIONS + 1)

        def cost(numbers: Array) -> float:
            motion = self.motion(numbers)
            played = PredictedMotion(self._setting, motion, _MAX_COMPARED_WINDOWS)
            outcomes = [played.outcome(p.quick, steps=0) for p in tested]
            state.count += 1
            state.most = np.maximum(state.most, [x.expected for x in outcomes])
            report_progress("planning", min(state.count / total, 1.0))
            worth = _worth(outcomes, threshold)
            state.best = sorted([*state.best, (worth, state.count, motion)], key=lambda x: (-x[0], x[1]))[:FINALISTS]
            return -worth

        size = count(self._setting.arm.n_joints)
        differential_evolution(
            cost, [(0.0, 1.0)] * size, init=self._population(seed), maxiter=GENERATIONS, tol=0.0, polish=False,
            recombination=0.5, rng=np.random.default_rng(seed), callback=lambda *_: state.best[0][0] >= 1.0 - 1e-9,
        )  # fmt: skip
        return Found(self._final(state, tested, threshold), state.count, state.most)

    def _final(self, state: _State, tested: Sequence[TestedQuestion], threshold: float) -> Motion:
        """Return the best of the search's best motions, compared again by all sizes and windows and with the rival fully fitted."""
        kept = [self.kept(motion, tested) for _, _, motion in state.best]
        motions = [motion for motion in kept if motion.scale > 0.0]
        if not motions:
            effects = [p.pair.alternatives[-1][1][-1] for p in tested]
            errors = [self._no_motion(state.best[0][2], (effect,), TORQUE_MOST) for effect in effects]
            raise next((e for e in errors if "torque_limit of" in str(e)), errors[0])
        every = [[self.play(motion).outcome(p.pair) for p in tested] for motion in motions]
        sure = [sum(x.settled(threshold) for x in outcomes) / len(tested) for outcomes in every]
        order = [(s, _worth(outcomes, threshold)) for s, outcomes in zip(np.round(sure, 2), every, strict=True)]
        return motions[max(range(len(motions)), key=lambda i: order[i])]

    def _population(self, seed: int) -> Array:
        """Return the initial population: usual motions at several poses, and random ones."""
        n = self._setting.arm.n_joints
        rng = np.random.default_rng([seed, 1])
        usual = [named(name, n, poses) for poses in _POSE_PAIRS for name in _SEEDS]
        jitter = [np.clip(x + 0.05 * rng.standard_normal(len(x)), 0.0, 1.0) for x in usual]
        random = [rng.uniform(0.0, 1.0, count(n)) for _ in range(POPULATION - len(jitter))]
        return np.array([*jitter, *random])


@dataclass
class _State:
    """State of a search: largest evidence per question, number of motions tried, and best motions, each with its worth and number."""

    most: Array
    count: int = 0
    best: list[tuple[float, int, Motion]] = field(default_factory=list)


def _worth(outcomes: Sequence[Outcome], threshold: float) -> float:
    """Return the worth of a motion for several questions, from 0 to 1: mean probability that one is settled, and mean merit.

    The merit leads towards evidence where no question is nearly settled. A question that no motion settles changes neither much.
    """
    return float(np.mean([0.5 * (x.settled(threshold) + x.merit(threshold)) for x in outcomes]))
