"""Expected evidence of a motion for one model against another (T-optimality, Atkinson and Fedorov 1975).

Both models predict the motion's windows from the same starts under the same torques, as a diagnosis does. The rival's values, all of the
arm's (with the arm file's standard deviations as prior) and a diagnosis' nuisances are fitted to the difference of the predictions to first
order; half the square of the remaining difference, in units of noise and discrepancy, is the expected log-likelihood ratio.

A decision of `armgap.diagnose` needs more than a likely effect: without the effect the gap has to exceed the noise floor, and most
windows have to prefer the effect. Both conditions are evaluated too, with the diagnosis' thresholds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm.arm import Arm
from armgap.evidence.hypothesis import EffectInstance, Hypothesis, true_positions
from armgap.planning.columns import Columns
from armgap.planning.dynamics import LATENT, inverse_dynamics
from armgap.planning.motion import Motion
from armgap.planning.outcome import ABOVE_FLOOR, CERTAIN, HELD_CERTAIN, MATTERS, Outcome, certainty

__all__ = ["HypothesisPair", "PredictedMotion", "Rest", "Setting"]

Array = NDArray[np.float64]

#: Samples per prediction window at which motions are predicted, at most as dense as those of a log.
WINDOW_SAMPLES = 50
#: Highest degree of the polynomials that represent predictions in a window; degrees 0 and 1, which take up errors of the initial state, are left out.
DEGREES = 12
#: Smallest assumed discrepancy of the best model, as a part of the noise floor.
LEAST_DISCREPANCY = 0.3
#: Ratio of the RMS of t^2, with t from the start of an interval, to the RMS of its Legendre component of degree 2.
BEND = 6.0
#: Time before a window at which the prediction of a model with latent states begins, s.
LEAD = 0.15
#: Tolerance of predictions, in standard deviations of a measured position.
ACCURACY = 0.1
#: Largest number of steps of the integrator per predicted sample. An elastic joint that needs more, with a natural frequency of a kilohertz or so,
#: is a rigid one to every log, and costs as much as all other predictions together.
MAX_SUBSTEPS = 32
#: Step of finite differences for a parameter's sensitivity, in standard deviations of its prior, and at most this part of its value.
STEP_SIGMA, STEP_PART = 0.2, 0.02
#: Part of a log, from its beginning, that a diagnosis fits models to; the rest is the holdout.
TRAINED = 0.6
#: Widths of the smoothed sign of friction that a diagnosis may choose, in RMS speeds of the motion.
SMOOTHED = (0.01, 0.05)
#: Gauss-Newton steps in which a rival is fitted after the first-order fit.
_RIVAL_GAUSS_NEWTON_STEPS = 8
#: Decrease of the cost by a Gauss-Newton step, as a part of the cost before, below which the fit of a rival has converged.
SETTLED = 0.02
#: Effects that act on the encoders' readings.
_MEASURED = ("encoder_offset", "encoder_eccentricity")


class Rest(NamedTuple):
    """Error of predictions that a model leaves beyond the noise floor: discrepancy of the model.

    Attributes
    ----------
    discrepancy : tuple of float
        RMS error beyond the floor, or the least that is assumed, per joint [rad or m].
    excess : float
        Mean square error beyond the floor's, over the floor's; mean over the joints.
    """

    discrepancy: tuple[float, ...]
    excess: float

    @classmethod
    def of(cls, rms: Array, floor: Array) -> Rest:
        """Return the rest for RMS errors of predictions and their floor, shape (n_joints,) each."""
        beyond = np.maximum(rms**2 - floor**2, 0.0)
        discrepancy = np.sqrt(np.maximum(beyond, (LEAST_DISCREPANCY * floor) ** 2))
        return cls(tuple(discrepancy.tolist()), float(np.mean(beyond / np.maximum(floor, 1e-12) ** 2)))


@dataclass(frozen=True)
class Setting:
    """Models, noise and horizon with which the expected evidence of a motion is computed.

    Attributes
    ----------
    model : Hypothesis
        Best model of a diagnosis: its re-estimated model with causes.
    horizon : float
        Length of a window [s].
    sigma : ndarray, shape (n_joints,)
        Standard deviation of a measured position [rad or m].
    encoder_step : ndarray, shape (n_joints,)
        Step of the encoders, zero where unknown [rad or m].
    rest : Rest
        Error of predictions that the best model leaves beyond the noise floor.
    unknown : ndarray, shape (n_parameters,)
        Variance of each of the arm's parameters after the diagnosis over that of its prior, 0 to 1: part of the prior's evidence that the diagnosed
        logs have not used up.
    """

    model: Hypothesis
    horizon: float
    sigma: Array
    encoder_step: Array
    rest: Rest
    unknown: Array

    @classmethod
    def of(cls, data: dict[str, Any], model: Hypothesis) -> Setting:
        """Return the setting for a diagnosis (its JSON object) and its best model."""
        gap, noise = data["gap"], data["noise"]
        sigma = np.maximum(np.array(noise["position_sigma"], dtype=np.float64), 1e-12)
        step = np.array(noise.get("encoder_step") or np.zeros(len(sigma)), dtype=np.float64)
        rest = Rest.of(np.array(gap["after"], dtype=np.float64), np.array(gap["floor"], dtype=np.float64))
        found = data["parameters"]["with_causes"]
        known = np.array([found[name]["sigma"] for name in model.arm.parameter_names], dtype=np.float64)
        unknown = np.clip((known / np.maximum(model.arm.sigma, 1e-300)) ** 2, 0.0, 1.0)
        return cls(model, float(gap["horizon_s"]), sigma, step, rest, unknown)

    @property
    def arm(self) -> Arm:
        """Arm of the best model."""
        return self.model.arm

    @property
    def step(self) -> float:
        """Step of predictions [s], a whole number of sample periods."""
        period = self.arm.sample_period
        return period * max(1, round(self.horizon / WINDOW_SAMPLES / period))


@dataclass(frozen=True)
class HypothesisPair:
    """Two sets of models for one question of a planned experiment: with the effect, and without it.

    Attributes
    ----------
    alternatives : tuple of (weight, effects)
        Models with the effect in question, of several sizes; the weights add up to one.
    rival : tuple of EffectInstance
        Effects of the rival, the model without the effect in question.
    free : EffectInstance, optional
        Effect of the rival whose values are fitted; None for a rival without such an effect.
    rest : Rest, optional
        Error of predictions that a model with the effect in question leaves on the diagnosed logs; by default that of the best model.
    """

    alternatives: tuple[tuple[float, tuple[EffectInstance, ...]], ...]
    rival: tuple[EffectInstance, ...]
    free: EffectInstance | None = None
    rest: Rest | None = None


class PredictedMotion:
    """A reference motion, its torques, and the predictions of models over its windows.

    Parameters
    ----------
    setting : Setting
        Models, noise and horizon of the predictions.
    motion : Motion
        Reference motion.
    most : int, optional
        Largest number of windows that are predicted, spread evenly; evidence is scaled to all windows. By default all are.
    """

    def __init__(self, setting: Setting, motion: Motion, most: int | None = None) -> None:
        self._setting = setting
        self._arm = setting.arm
        h = setting.step
        self._samples = max(round(setting.horizon / h), DEGREES + 2)
        every = int((motion.duration / h + 1e-6) // self._samples)
        self._stride = 1 if most is None else -(-every // most)
        self._windows = np.arange(0, every, self._stride)
        self._count = len(self._windows)
        #: Number of windows that each predicted window stands for.
        self._share = every / self._count
        self._every = every
        length = every * self._samples + 1
        self.t: Array = h * np.arange(length, dtype=np.float64)
        self.q, self.dq, self.ddq = motion.at(self.t)
        # A torque is held over a step; it is the one that the motion needs at the step's middle.
        held = motion.at(self.t + 0.5 * h)
        self.tau = inverse_dynamics(setting.model, *held)
        self.held = held
        self._known: dict[Any, Array] = {}
        #: Sub-steps per sample and window that met the tolerance for the first model predicted with the same effects, of other values: those of all
        #: such models, whose differences then hold no error of a change of step.
        self._substeps: dict[Any, list[int]] = {}
        polynomials, _ = np.linalg.qr(
            np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, self._samples + 1), DEGREES)
        )
        self._basis: Array = polynomials[:, 2:]
        self._weights: dict[Rest, tuple[Array, Array]] = {}
        self._columns: Array | None = None
        self._remainder: tuple[Array, Array] | None = None

    def _weights_of(self, rest: Rest) -> tuple[Array, Array]:
        if rest not in self._weights:
            self._weights[rest] = self._weights_beside(np.array(rest.discrepancy))
        return self._weights[rest]

    def _weights_beside(self, discrepancy: Array) -> tuple[Array, Array]:
        """Return inverse standard deviations of the polynomial coefficients, by white noise and in total, by window, degree and joint, flattened.

        An encoder's rounding error is constant until the joint has moved by a step. The discrepancy is modelled as a torque that changes from
        window to window: its part of a coefficient falls with the square of the degree.
        """
        setting, n = self._setting, self._samples + 1
        period = self._arm.sample_period
        share = period / setting.step
        way = np.array([np.mean(np.abs(v), axis=0) for v in np.split(self.dq[1:], (len(self.dq) - 1) // self._samples)])
        way = way[self._windows] * period
        rounding = np.minimum(setting.encoder_step**2 / 12.0, setting.sigma**2)
        held = np.clip(setting.encoder_step / np.maximum(way, 1e-15), 1.0, setting.horizon / period)
        noise = (setting.sigma**2 - rounding + rounding * held) * share
        degree = np.arange(2, DEGREES + 1)[None, :, None]
        bend = n * (discrepancy / BEND) ** 2 * (2.0 / degree) ** 4
        shape = (self._count, DEGREES - 1, self._arm.n_joints)
        white = np.broadcast_to(1.0 / np.sqrt(setting.sigma**2 * share), shape)
        return white.ravel(), (1.0 / np.sqrt(noise[:, None, :] + bend)).ravel()

    def predicted(
        self,
        theta: tuple[float, ...],
        effects: Sequence[EffectInstance],
        lead: bool,
        smoothing: tuple[float, ...] | None = None,
    ) -> Array:
        """Return the polynomial coefficients of the predictions of all windows as one vector [rad or m].

        Raises
        ------
        ValueError
            If a model's motion diverges.
        """
        key = (theta, tuple((e.effect, e.joint, *e.parameters.items()) for e in effects), lead, smoothing)
        if key not in self._known:
            self._known[key] = self._predict(theta, effects, lead, smoothing)
        return self._known[key]

    def _predict(
        self,
        theta: tuple[float, ...],
        effects: Sequence[EffectInstance],
        lead: bool,
        smoothing: tuple[float, ...] | None,
    ) -> Array:
        arm, model, s = self._arm, self._setting.model, self._samples
        before = round(LEAD / self._setting.step) if lead else 0
        first = s * self._windows
        begin = np.maximum(first - before, 0)
        q0, dq0 = self._true_start(begin, effects)
        placed = [e.on(e.joint) for e in effects]
        lengths = None if arm.link_length is None else arm.link_length.tolist()
        tolerance = max(ACCURACY * float(self._setting.sigma.min()), 1e-9)
        rows = list(zip(begin.tolist(), (first + s + 1).tolist(), strict=True))
        structure = (tuple((e.effect, e.joint) for e in effects), lead, smoothing is None)
        found, _, self._substeps[structure] = _native.simulate_windows(
            arm.kind, arm.gravity, lengths, list(theta), self.t, self.tau, rows, s + 1, q0, dq0, placed, tolerance,
            model.smoothing if smoothing is None else smoothing, self._substeps.get(structure), MAX_SUBSTEPS,
        )  # fmt: skip
        return np.asarray(np.einsum("wsj,sk->wkj", found, self._basis), dtype=np.float64).ravel()

    def _true_start(self, rows: Array, effects: Sequence[EffectInstance]) -> tuple[Array, Array]:
        """Return the joints' true positions and velocities at the windows' starts, for encoders that read the reference."""
        q, dq = self.q[rows], self.dq[rows]
        sensors = [e for e in effects if e.effect in _MEASURED]
        if not sensors:
            return q, dq
        step = 1e-3
        many = true_positions(np.concatenate([q, q + step, q - step]), sensors)
        middle, above, below = np.split(many, 3)
        return middle, dq * (above - below) / (2 * step)

    def sensitivities(self) -> Array:
        """Return derivatives of the predictions by the values that every model fits, per prior standard deviation; shape (n_numbers, n_columns).

        The values are arm parameters; a delay of all torques, whose prior is one sample; widths of the smoothed sign of friction.

        Raises
        ------
        ValueError
            If the best model cannot be predicted along the motion.
        """
        if self._columns is None:
            self._columns = np.column_stack([*self._of_parameters(), *self._of_nuisances()])
        return self._columns

    def _of_parameters(self) -> list[Array]:
        model = self._setting.model
        lead = latent(model.effects)
        reference = self.predicted(model.theta, model.effects, lead)
        columns = []
        sizes = np.abs(model.theta) + 0.1 * np.max(np.abs(model.theta))
        for i, sigma in enumerate(self._arm.sigma):
            step = min(STEP_SIGMA * float(sigma), STEP_PART * float(sizes[i]))
            theta = tuple(x + step * (k == i) for k, x in enumerate(model.theta))
            columns.append((self.predicted(theta, model.effects, lead) - reference) * (float(sigma) / step))
        return columns

    def _of_nuisances(self) -> list[Array]:
        model, arm = self._setting.model, self._arm
        columns = []
        speed = float(np.sqrt(np.mean(self.dq**2)))
        lead = latent(model.effects)
        for part in SMOOTHED:
            widths = tuple(max(part * speed, 2.0 * width) for width in model.smoothing or (0.0,) * arm.n_joints)
            with suppress(
                ValueError
            ):  # friction so steep, as in a motion that is all but at rest, is none that a diagnosis could fit
                rounded = self.predicted(model.theta, model.effects, lead, widths)
                columns.append(rounded - self.predicted(model.theta, model.effects, lead))
        late = [EffectInstance("actuator_delay", j + 1, {"delay": arm.sample_period}) for j in range(arm.n_joints)]
        with suppress(ValueError):  # the model has as many effects as the simulator carries, as a rule with a delay
            delayed = self.predicted(model.theta, (*model.effects, *late), True)
            columns.append(delayed - self.predicted(model.theta, model.effects, True))
        return columns

    def outcome(self, pair: HypothesisPair, steps: int = _RIVAL_GAUSS_NEWTON_STEPS) -> Outcome:
        """Return the evidence that the motion is expected to give between two models; zero if one of them cannot be simulated along it.

        Parameters
        ----------
        pair : HypothesisPair
            Models with and without the effect in question.
        steps : int, default 8
            Gauss-Newton steps in which the wrong model of the pair is fitted to the other's motion, beyond the first-order fit.
        """
        weight = np.array([w for w, _ in pair.alternatives])
        excess = (pair.rest or self._setting.rest).excess
        residuals = 0.5 * self._arm.n_joints * self._setting.horizon / self._arm.sample_period
        half = self._every * residuals
        needs = max(MATTERS * excess, ABOVE_FLOOR - 1.0 - excess) * half
        spread = math.sqrt(half) / needs
        try:
            found = np.array([self._evidence(effects, pair, residuals, steps) for _, effects in pair.alternatives])
        except ValueError:
            nothing = np.zeros(len(weight))
            return Outcome(nothing, nothing, nothing, nothing, nothing, weight, spread)
        left, plain, above, certain, prior = found.T
        return Outcome(left, self._share * plain, above / needs, certain, prior, weight, spread)

    def floors(self, pair: HypothesisPair, index: int, floor: Array) -> float:
        """Return the RMS difference of model `index` of a pair from the rival, in noise floors, at the worst joint; infinite if not computable."""
        try:
            delta, _ = self._difference(pair.alternatives[index][1], pair)
        except ValueError:
            return math.inf
        factors = delta.reshape(self._count, -1, self._arm.n_joints)
        rms = np.sqrt(np.sum(factors**2, axis=(0, 1)) / (self._count * (self._samples + 1)))
        return float(np.max(rms / np.maximum(floor, 1e-12)))

    def unfitted(self, pair: HypothesisPair) -> float:
        """Return the log-likelihood ratio of the pair's first model and the rival with nothing fitted; zero if not computable."""
        try:
            delta = self.difference(pair)
        except ValueError:
            return 0.0
        _, whole = self._weights_of(pair.rest or self._setting.rest)
        return 0.5 * self._share * float(np.sum((delta * whole) ** 2))

    def difference(self, pair: HypothesisPair) -> Array:
        """Return the difference of predictions between the pair's first model and the rival."""
        return self._difference(pair.alternatives[0][1], pair)[0]

    def left_of(self, delta: Array, *free: Array) -> tuple[float, Array]:
        """Return the squared rest of a difference after a fit of the values common to all models, and the coefficients of columns fitted too."""
        columns = np.column_stack(free) if free else np.empty((len(delta), 0))
        _, whole = self._weights_of(self._setting.rest)
        common = self.sensitivities()
        found = Columns(common, columns, (), len(self._arm.sigma)).fitted(delta, whole)
        return found.square, found.values[common.shape[1] :]

    def imitations(self, effect: EffectInstance, rival: tuple[EffectInstance, ...]) -> list[Array]:
        """Return changes of the predictions that an effect can make beside `rival`, to first order: by itself, and by each of its values.

        Raises
        ------
        ValueError
            If the arm with the effect cannot be predicted along the motion.
        """
        pair = HypothesisPair((), (*rival, effect), effect)
        _, by_value = self._of_rival(pair, latent(pair.rival))
        return [self.change(effect, rival), *by_value.T]

    def change(self, effect: EffectInstance, rival: tuple[EffectInstance, ...]) -> Array:
        """Return the change of the predictions by an effect beside the effects `rival`; errors as :meth:`imitations`."""
        return self._difference((*rival, effect), HypothesisPair((), rival))[0]

    def remainder(self, delta: Array) -> Array:
        """Return what a fit of the values common to all models leaves of a difference, and of those values, in standard deviations."""
        if self._remainder is None:
            _, whole = self._weights_of(self._setting.rest)
            common = self.sensitivities()
            stacked = np.vstack([common * whole[:, None], np.eye(common.shape[1])])
            self._remainder = whole, np.linalg.qr(stacked)[0]
        whole, basis = self._remainder
        padded = np.concatenate([delta * whole, np.zeros(basis.shape[1])])
        return np.asarray(padded - basis @ (basis.T @ padded))

    def _difference(self, effects: tuple[EffectInstance, ...], pair: HypothesisPair) -> tuple[Array, bool]:
        lead = latent((*effects, *pair.rival))
        theta = self._setting.model.theta
        return self.predicted(theta, effects, lead) - self.predicted(theta, pair.rival, lead), lead

    def _evidence(
        self, effects: tuple[EffectInstance, ...], pair: HypothesisPair, residuals: float, steps: int
    ) -> tuple[float, float, float, float, float]:
        theta = self._setting.model.theta
        white, whole = self._weights_of(pair.rest or self._setting.rest)
        lead = latent((*effects, *pair.rival))
        truth = self.predicted(theta, effects, lead)
        delta = truth - self.predicted(theta, pair.rival, lead)
        names, free = self._of_rival(pair, lead)
        columns = Columns(self.sensitivities(), free, names, len(self._arm.sigma))
        # A diagnosis fits the rival to the first windows and judges it on the others.
        first = self._windows < TRAINED * self._every
        trained = np.repeat(first, len(delta) // self._count)
        best = columns.fitted(delta, whole * trained)
        absent = self.predicted(theta, tuple(e for e in pair.rival if e != pair.free), lead)
        plain = 0.5 * float(np.sum(((truth - absent) * whole) ** 2))
        for _ in range(steps):
            # Gauss-Newton: the rival predicts with the fitted values, and the remaining difference is fitted again.
            changed, rival = self._moved(pair, columns, best.values)
            try:
                missed = truth - self.predicted(changed, rival, lead)
            except ValueError:
                break
            linear = columns.product(best.values, simulated=True)
            again = columns.fitted(missed + linear, whole * trained)
            gain = best.square - again.square
            if gain > 0:
                delta, best = missed + linear, again
            if gain < SETTLED * best.square:
                break
        left = 0.5 * np.sum(best.left.reshape(self._count, -1) ** 2, axis=1)
        moved = best.values[: len(theta)]
        prior = 0.5 * float(self._setting.unknown @ moved**2)
        by_noise = columns.fitted(delta, white * trained)
        beyond = (delta - columns.product(by_noise.values, simulated=False)) * white
        windows = 0.5 * np.sum(beyond.reshape(self._count, -1) ** 2, axis=1)
        share = self._share
        above = share * min(float(np.sum(windows[first])) / TRAINED, float(np.sum(windows[~first])) / (1.0 - TRAINED))
        # With robust weights a window's cost grows with the logarithm of its squared residuals only.
        advantage = residuals * np.log1p(windows / residuals)
        certain = min(certainty(advantage, share), CERTAIN / HELD_CERTAIN * certainty(advantage[~first], share))
        return share * float(np.sum(left[first])) + prior, plain, above, certain, prior

    def _moved(
        self, pair: HypothesisPair, columns: Columns, values: Array
    ) -> tuple[tuple[float, ...], tuple[EffectInstance, ...]]:
        """Return parameters and effects of the rival with fitted changes added; positive parameters of the arm stay positive."""
        arm, theta = self._arm, np.array(self._setting.model.theta)
        p = len(theta)
        changed = theta + arm.sigma * values[:p]
        kept = np.where(theta > 0, np.maximum(changed, 1e-3 * theta), changed)
        if pair.free is None:
            return tuple(kept.tolist()), pair.rival
        steps = values[columns.common.shape[1] :]
        parameters = dict(pair.free.parameters)
        for name, step in zip(columns.names, steps, strict=True):
            parameters[name] += float(step)
        moved = pair.free._replace(parameters=parameters)
        return tuple(kept.tolist()), tuple(moved if e == pair.free else e for e in pair.rival)

    def _of_rival(self, pair: HypothesisPair, lead: bool) -> tuple[tuple[str, ...], Array]:
        """Return names of the rival's fitted values, and derivatives of its predictions by them."""
        theta, free = self._setting.model.theta, pair.free
        if free is None:
            return (), np.empty((self._count * (DEGREES - 1) * self._arm.n_joints, 0))
        reference = self.predicted(theta, pair.rival, lead)
        names, columns = [], []
        for name, value in free.parameters.items():
            if name in _FIXED:
                continue
            step = STEP_PART * (abs(value) or 1.0)
            moved = free._replace(parameters={**free.parameters, name: value + step})
            effects = tuple(moved if e == free else e for e in pair.rival)
            columns.append((self.predicted(theta, effects, lead) - reference) / step)
            names.append(name)
        return tuple(names), np.column_stack(columns)


#: Parameters of an effect that state where it acts, not its size, and are not fitted.
_FIXED = ("riding", "encoder_at_motor", "friction_at_motor", "rotor_rides")


def latent(effects: Sequence[EffectInstance]) -> bool:
    """Return whether one of the effects has a latent state, one that no encoder shows."""
    return any(e.effect in LATENT for e in effects)
