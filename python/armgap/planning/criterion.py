"""Expected evidence of a motion for one model against another (T-optimality, Atkinson and Fedorov 1975).

Both models predict the motion's windows from the same starts under the same torques, as a diagnosis does. What counts of their
difference is what is left after the rival's values, and all of the arm's, are fitted to it to first order, with the arm file's standard
deviations as prior; half of its square, in units of noise and discrepancy, is the expected log-likelihood ratio.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm import Arm
from armgap.evidence.hypothesis import EffectInstance, Hypothesis, true_positions
from armgap.planning.dynamics import LATENT, inverse_dynamics
from armgap.planning.motion import Motion

__all__ = ["Contest", "Outcome", "Played", "Setting", "settled"]

Array = NDArray[np.float64]

#: Samples per window at which motions are predicted; denser ones than the log's are not taken.
WINDOW_SAMPLES = 50
#: Polynomials per window and joint; those of degree 0 and 1 take up the start's error.
DEGREES = 12
#: Discrepancy at least, as a part of the noise floor.
FAINT = 0.3
#: RMS of t^2 over an interval, over the RMS of its part of degree 2 (Legendre polynomials).
BEND = 6.0
#: Time by which predictions with latent states begin before their windows, s.
LEAD = 0.15
#: Tolerance of predictions, in standard deviations of a position.
ACCURACY = 0.1
#: Change of a parameter over which its sensitivity is taken, in standard deviations of its prior, and at most this part of its value.
STEP_SIGMA, STEP_PART = 0.2, 0.02
_MEASURED = ("encoder_offset", "encoder_eccentricity")


@dataclass(frozen=True)
class Setting:
    """What evidence is counted with.

    Attributes
    ----------
    model : Hypothesis
        The best model of a diagnosis.
    horizon : float
        Length of a window [s].
    sigma : ndarray, shape (n_joints,)
        Standard deviation of a measured position [rad or m].
    discrepancy : ndarray, shape (n_joints,)
        RMS error of predictions that the best model leaves beyond the noise floor [rad or m].
    """

    model: Hypothesis
    horizon: float
    sigma: Array
    discrepancy: Array

    @classmethod
    def of(cls, data: dict[str, Any], model: Hypothesis) -> Setting:
        """Return the setting of a diagnosis (its JSON object)."""
        gap, noise = data["gap"], data["noise"]
        after, floor = np.array(gap["after"], dtype=np.float64), np.array(gap["floor"], dtype=np.float64)
        least = (FAINT * floor) ** 2
        sigma = np.array(noise["position_sigma"], dtype=np.float64)
        return cls(model, float(gap["horizon_s"]), np.maximum(sigma, 1e-12), np.sqrt(np.maximum(after**2 - floor**2, least)))

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self.model.arm

    @property
    def step(self) -> float:
        """Step of predictions [s], a whole number of sample periods."""
        period = self.arm.sample_period
        return period * max(1, round(self.horizon / WINDOW_SAMPLES / period))


@dataclass(frozen=True)
class Contest:
    """One question as models.

    Attributes
    ----------
    own : tuple of (weight, effects)
        Models with the effect in question, of several sizes; the weights add up to one.
    rival : tuple of EffectInstance
        Effects of the rival's model.
    free : EffectInstance, optional
        The effect of the rival whose values are fitted.
    """

    own: tuple[tuple[float, tuple[EffectInstance, ...]], ...]
    rival: tuple[EffectInstance, ...]
    free: EffectInstance | None = None


class Outcome(NamedTuple):
    """Expected log-likelihood ratios, one per size: with the rival fitted and without, and the sizes' weights."""

    fitted: Array
    plain: Array
    weight: Array

    @property
    def expected(self) -> float:
        """Mean over the sizes."""
        return float(self.weight @ self.fitted)

    def settled(self, threshold: float) -> float:
        """Probability of a decision, mean over the sizes."""
        return float(self.weight @ [settled(x, threshold) for x in self.fitted])

    @property
    def kept(self) -> float:
        """Part of the difference that fitting the rival leaves."""
        plain = float(self.weight @ self.plain)
        return self.expected / plain if plain > 0 else 0.0


def settled(expected: float, threshold: float) -> float:
    """Probability that a log-likelihood ratio exceeds a threshold: normal, its variance twice its expectation."""
    if not expected > 0:
        return 0.0
    return 0.5 * math.erfc(-(expected - threshold) / (2.0 * math.sqrt(expected)))


class Played:
    """A motion, its torques, and what models predict over its windows."""

    def __init__(self, setting: Setting, motion: Motion) -> None:
        self._setting = setting
        self._arm = setting.arm
        h = setting.step
        self._samples = max(round(setting.horizon / h), DEGREES + 2)
        self._count = int((motion.duration / h) // self._samples)
        length = self._count * self._samples + 1
        self.t: Array = h * np.arange(length, dtype=np.float64)
        self.q, self.dq, self.ddq = motion.at(self.t)
        # A torque is held over a step: that of the step's middle.
        held = motion.at(self.t + 0.5 * h)
        self.tau = inverse_dynamics(setting.model, *held)
        self.held = held
        self._known: dict[Any, Array] = {}
        self._basis, self._weight = self._whitening()
        self._sensitivity: Array | None = None

    def _whitening(self) -> tuple[Array, Array]:
        """Polynomials of degree 2 and more over a window, and one over the standard deviation of each of their factors per joint.

        Noise is white. The discrepancy is that of a torque that changes from window to window: its positions fall with the square of the
        degree.
        """
        setting, n = self._setting, self._samples + 1
        x = np.linspace(-1.0, 1.0, n)
        polynomials, _ = np.linalg.qr(np.polynomial.legendre.legvander(x, DEGREES))
        degree = np.arange(2, DEGREES + 1)[:, None]
        white = setting.sigma**2 * self._arm.sample_period / setting.step
        bend = n * (setting.discrepancy / BEND) ** 2
        return polynomials[:, 2:], 1.0 / np.sqrt(white + bend * (2.0 / degree) ** 4)

    def predicted(self, theta: tuple[float, ...], effects: Sequence[EffectInstance], lead: bool) -> Array:
        """Whitened predictions of all windows, one column of numbers.

        Raises
        ------
        ValueError
            If a model's motion diverges.
        """
        key = (theta, tuple((e.effect, e.joint, *e.parameters.items()) for e in effects), lead)
        if key not in self._known:
            self._known[key] = self._predict(theta, effects, lead)
        return self._known[key]

    def _predict(self, theta: tuple[float, ...], effects: Sequence[EffectInstance], lead: bool) -> Array:
        arm, model, s = self._arm, self._setting.model, self._samples
        before = round(LEAD / self._setting.step) if lead else 0
        first = s * np.arange(self._count)
        begin = np.maximum(first - before, 0)
        q0, dq0 = self._true_start(begin, effects)
        placed = [e.on(e.joint) for e in effects]
        lengths = None if arm.link_length is None else arm.link_length.tolist()
        tolerance = max(ACCURACY * float(self._setting.sigma.min()), 1e-9)
        found = np.empty((self._count, s + 1, arm.n_joints))
        for w in range(self._count):
            rows = slice(int(begin[w]), int(first[w]) + s + 1)
            q, _ = _native.simulate(
                arm.kind, arm.gravity, lengths, list(theta), self.t[rows], self.tau[rows], q0[w], dq0[w], placed, tolerance,
                model.smoothing,
            )  # fmt: skip
            found[w] = q[-(s + 1) :]
        factors = np.einsum("wsj,sk->wkj", found, self._basis)
        return np.asarray(factors * self._weight, dtype=np.float64).ravel()

    def _true_start(self, rows: Array, effects: Sequence[EffectInstance]) -> tuple[Array, Array]:
        """States of the joints behind the encoders, which show the reference."""
        q, dq = self.q[rows], self.dq[rows]
        sensors = [e for e in effects if e.effect in _MEASURED]
        if not sensors:
            return q, dq
        step = 1e-3
        many = true_positions(np.concatenate([q, q + step, q - step]), sensors)
        middle, above, below = np.split(many, 3)
        return middle, dq * (above - below) / (2 * step)

    def sensitivities(self) -> Array:
        """Derivatives of the predictions by the arm's parameters, in standard deviations of their prior; shape (n_numbers, n_parameters)."""
        if self._sensitivity is None:
            model = self._setting.model
            lead = latent(model.effects)
            reference = self.predicted(model.theta, model.effects, lead)
            columns = []
            sizes = np.abs(model.theta) + 0.1 * np.max(np.abs(model.theta))
            for i, sigma in enumerate(self._arm.sigma):
                step = min(STEP_SIGMA * float(sigma), STEP_PART * float(sizes[i]))
                theta = tuple(x + step * (k == i) for k, x in enumerate(model.theta))
                columns.append((self.predicted(theta, model.effects, lead) - reference) * (float(sigma) / step))
            self._sensitivity = np.column_stack(columns)
        return self._sensitivity

    def outcome(self, contest: Contest) -> Outcome:
        """Expected log-likelihood ratios of a contest over this motion; zero where a model's motion cannot be computed."""
        weight = np.array([w for w, _ in contest.own])
        try:
            found = np.array([self._ratio(effects, contest) for _, effects in contest.own])
        except ValueError:
            return Outcome(np.zeros(len(weight)), np.zeros(len(weight)), weight)
        return Outcome(found[:, 0], found[:, 1], weight)

    def floors(self, contest: Contest, index: int, floor: Array) -> float:
        """RMS difference of one of the contest's models from the rival, in noise floors, worst joint; infinite if it cannot be computed."""
        try:
            delta, _ = self._difference(contest.own[index][1], contest)
        except ValueError:
            return math.inf
        factors = delta.reshape(self._count, -1, self._arm.n_joints) / self._weight
        rms = np.sqrt(np.sum(factors**2, axis=(0, 1)) / (self._count * (self._samples + 1)))
        return float(np.max(rms / np.maximum(floor, 1e-12)))

    def differences(self, contest: Contest) -> tuple[Array, Array]:
        """Differences of the first model's predictions from the rival's, and the columns that are fitted to them."""
        return self._difference(contest.own[0][1], contest)[0], self.sensitivities()

    def _difference(self, effects: tuple[EffectInstance, ...], contest: Contest) -> tuple[Array, bool]:
        lead = latent((*effects, *contest.rival))
        theta = self._setting.model.theta
        return self.predicted(theta, effects, lead) - self.predicted(theta, contest.rival, lead), lead

    def _ratio(self, effects: tuple[EffectInstance, ...], contest: Contest) -> tuple[float, float]:
        delta, lead = self._difference(effects, contest)
        columns = [self.sensitivities()]
        if contest.free is not None:
            columns.append(self._of_rival(contest, contest.free, lead))
        left = remainder(delta, columns[0], columns[1] if len(columns) > 1 else None)
        return 0.5 * left, 0.5 * float(delta @ delta)

    def _of_rival(self, contest: Contest, free: EffectInstance, lead: bool) -> Array:
        """Derivatives of the rival's predictions by its effect's values."""
        theta = self._setting.model.theta
        reference = self.predicted(theta, contest.rival, lead)
        columns = []
        for name, value in free.parameters.items():
            if name in _FIXED:
                continue
            step = STEP_PART * (abs(value) or 1.0)
            moved = free._replace(parameters={**free.parameters, name: value + step})
            effects = tuple(moved if e == free else e for e in contest.rival)
            columns.append(self.predicted(theta, effects, lead) - reference)
        return np.column_stack(columns)


#: Values of an effect that say where it sits, not how large it is.
_FIXED = ("riding", "encoder_at_motor", "friction_at_motor", "rotor_rides")


def remainder(delta: Array, arm: Array, free: Array | None) -> float:
    """Square of a difference after the arm's parameters (with their prior) and the rival's values (without) were fitted to it."""
    prior = np.eye(arm.shape[1])
    if free is None:
        rows, right = np.vstack([arm, prior]), np.concatenate([delta, np.zeros(len(prior))])
    else:
        length = np.linalg.norm(free, axis=0)
        scaled = free / np.where(length > 0, length, 1.0)
        rows = np.vstack([np.hstack([arm, scaled]), np.hstack([prior, np.zeros((len(prior), free.shape[1]))])])
        right = np.concatenate([delta, np.zeros(len(prior))])
    solution = np.linalg.lstsq(rows, right, rcond=1e-12)[0]
    return float(np.sum((right - rows @ solution) ** 2))


def latent(effects: Sequence[EffectInstance]) -> bool:
    """Whether one of the effects has a state that no encoder shows."""
    return any(e.effect in LATENT for e in effects)


