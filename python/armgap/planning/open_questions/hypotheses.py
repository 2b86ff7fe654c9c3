"""Open questions of a diagnosis as pairs of models, with the sizes that the effect in question could have."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.evidence.hypothesis import EffectInstance, at_motor
from armgap.planning.criterion import HypothesisPair, PredictedMotion, Rest
from armgap.planning.open_questions.imitators import Imitators
from armgap.planning.open_questions.questions import NONE, Question, inseparable
from armgap.planning.open_questions.sizes import PLANNED, Scales, Shape, levels, shapes

__all__ = ["HypothesisBuilder", "TestedQuestion"]

Array = NDArray[np.float64]
Data = dict[str, Any]

#: Log-likelihood ratio of an effect and its absence on a usual motion, with nothing fitted, from which the effect is tried: about ten times what
#: decides, as a fit of the arm's values takes most of it.
DETECTABLE = 100.0
#: Ratio of the largest to the smallest size of an effect that is tried, upwards from a detectable one or downwards from a known bound.
_TRIED_SIZE_RATIO = 10.0
#: Number of sizes of an effect that are tried.
SIZES = 5
#: Nodes and weights of the mean over a normal distribution (Gauss-Hermite, three points).
NODES, WEIGHTS = (-math.sqrt(3.0), 0.0, math.sqrt(3.0)), (1 / 6, 2 / 3, 1 / 6)
#: Largest standard deviation of the logarithm of a stiffness with which values of an elastic joint are tried.
SPREAD = 1.0
#: Standard deviations by which a diagnosis' estimate of an effect differs from none for the estimate to stand for the effect's size.
DETERMINED = 2.0
#: Smallest likelihood of a size relative to that of the diagnosis' estimate: of sizes all far from it none is left out.
LEAST_LIKELY = 1e-3
#: An effect may imitate another one if, with only its size fitted, it leaves less than this part of that one's evidence in a usual motion.
IMITATES = 0.5


@dataclass(frozen=True)
class TestedQuestion:
    """An open question with its pair of models.

    Attributes
    ----------
    question : Question
        Effect in question and its rival.
    pair : HypothesisPair
        Models with and without the effect, at all sizes.
    quick : HypothesisPair
        The same models with few sizes of the effect, for the search.
    consequence : float
        Prediction error by the largest size of the effect on a usual motion, in noise floors.
    sizes : tuple of (str, float, float), optional
        Parameter of the effect, and range of its values over which evidence is averaged [SI].
    """

    question: Question
    pair: HypothesisPair
    quick: HypothesisPair
    consequence: float
    sizes: tuple[str, float, float] | None


class HypothesisBuilder:
    """Builder of the models for open questions, from a diagnosis and a usual motion.

    Parameters
    ----------
    data : dict
        Diagnosis as a JSON object.
    usual : PredictedMotion
        A usual motion within the limits, on which the consequences of sizes of effects are judged.
    scales : Scales
        Typical torques, speeds and positions in the usual motion.
    base : tuple of EffectInstance
        Effects of the best model.
    """

    def __init__(self, data: Data, usual: PredictedMotion, scales: Scales, base: tuple[EffectInstance, ...]) -> None:
        self._data = data
        self._usual = usual
        self._scales = scales
        self._base = base
        self._specs = {entry["name"]: entry["parameters"] for entry in _native.effects()}
        self._imitators = Imitators(usual, scales, self._specs)
        self._floor = np.array(data["gap"]["floor"], dtype=np.float64)

    def pose(self, question: Question) -> TestedQuestion | None:
        """Return a question with its models; None if the limits allow no value of the effect beyond those that the logs rule out.

        Raises
        ------
        ValueError
            If a model cannot be predicted along the usual motion.
        """
        gone = {question.place, question.rival, *question.replaced}
        without = tuple(e for e in self._base if (e.effect, e.joint) not in gone)
        groups = self._alternatives(question, without)
        if not groups:
            return None
        every = [(w, (*without, e)) for w, e in groups]
        rough = HypothesisPair(tuple(every), without)
        size = max(self._usual.floors(rough, i, self._floor) for i in range(len(every)))
        free = None if question.against == NONE else self._rival(question, rough)
        rival = without if free is None else (*without, free)
        rest = self._rest_with(question)
        pair = HypothesisPair(tuple(every), rival, free, rest)
        quick = HypothesisPair(_few(every), rival, free, rest)
        return TestedQuestion(question, pair, quick, size, self._range(question, [e for _, e in groups]))

    def _rest_with(self, question: Question) -> Rest | None:
        """Return what the re-estimated arm leaves with the effect in question added, if no cause is named: the gap may be this effect's doing.

        None, for what the best model leaves, if a cause is named or the effect was not fitted.
        """
        tried = [e["rms"] for e in self._data.get("ranking") or [] if (e["effect"], e["joint"]) == question.place]
        if not tried or self._data["causes"]:
            return None
        rests = [
            Rest.of(np.array(rms, dtype=np.float64), self._floor) for rms in (tried[0], self._data["gap"]["after"])
        ]
        return min(rests, key=lambda rest: rest.excess)

    def look_alikes(self, tested: TestedQuestion) -> list[Question]:
        """Return questions of an effect against effects that may imitate it, the most similar first.

        The imitating effects act on the same joint or the whole arm, and the diagnosis tried them without finding them. There are none where the
        effect itself cannot be predicted along the usual motion.
        """
        effect, joint = tested.question.place
        middle = tested.pair.alternatives[len(tested.pair.alternatives) // 2]
        pair = HypothesisPair(((1.0, middle[1]),), tested.pair.rival)
        try:
            target = self._usual.difference(pair)
        except ValueError:
            return []
        whole, _ = self._usual.left_of(target)
        modelled = {(e.effect, e.joint) for e in tested.pair.rival}
        same = inseparable(self._data)
        found = []
        for entry in self._data["ruled_out"]:
            place = (entry["effect"], entry["joint"])
            if place in modelled or place[0] not in PLANNED or place[0] == effect or place[1] not in (None, joint or 1):
                continue
            if frozenset((tested.question.place, place)) in same:
                continue
            left = self._imitators.least_left(place, tested.pair.rival, target)
            if left < IMITATES * whole:
                found.append((left, replace(tested.question, against=place[0], against_joint=place[1])))
        return [question for _, question in sorted(found, key=lambda x: x[0])]

    def _alternatives(
        self, question: Question, without: tuple[EffectInstance, ...]
    ) -> list[tuple[float, EffectInstance]]:
        known = shapes(*question.place, self._scales)
        if question.estimate is not None and self._is_determined(question, known):
            return self._estimated(question)
        if not known:
            values = levels(*question.place, self._scales)
            return _even(self._imitators.instance(question.place, v) for v in values)
        if question.estimate is not None:
            known = [shape.beside(question.estimate) for shape in known]
        found = [
            (_likelihood(question, shape, size), self._imitators.instance(question.place, shape.at(size)))
            for shape in known
            for size in self._sizes(question, shape, without)
        ]
        total = sum(weight for weight, _ in found)
        return [(weight / total, effect) for weight, effect in found]

    def _is_determined(self, question: Question, known: Sequence[Shape]) -> bool:
        """Return whether the diagnosis' estimate stands for the effect's size: that of a cause, or one that differs significantly from none.

        An effect with components, such as sine and cosine of a turn, differs if one of them does. One with a threshold is known if it is a candidate.
        """
        assert question.estimate is not None
        if any((c["effect"], c["joint"]) == question.place for c in self._data["causes"]):
            return True
        if not known:
            return any((c["effect"], c["joint"]) == question.place for c in self._data.get("candidates") or [])
        specs = self._specs[question.effect]
        sizes = [question.estimate[s["name"]] for s in specs if s["unit"] == specs[0]["unit"]]
        return any(abs(value - known[0].neutral) > DETERMINED * sigma for value, sigma in sizes)

    def _estimated(self, question: Question) -> list[tuple[float, EffectInstance]]:
        """Return weighted effects at the quadrature nodes of the estimate's normal distribution."""
        assert question.estimate is not None
        values = {name: value for name, (value, _) in question.estimate.items()}
        spec = self._specs[question.effect][0]
        name = spec["name"]
        value, sigma = question.estimate[name]
        sides = next((at_motor(c.get("sides")) for c in self._entries(question.place)), {})
        found = []
        nodes = zip(NODES, WEIGHTS, strict=True) if math.isfinite(sigma) else ((0.0, 1.0),)
        for node, weight in nodes:
            if node == 0.0:
                at = value
            elif question.effect == "joint_elasticity":
                at = value * math.exp(node * min(sigma / max(abs(value), 1e-300), SPREAD))
            else:
                at = min(max(value + node * sigma, spec["lower"]), spec["upper"])
            found.append((weight, EffectInstance(*question.place, {**values, name: at, **sides})))
        return found

    def _entries(self, place: tuple[str, int | None]) -> list[Data]:
        entries = (*self._data["causes"], *(self._data.get("candidates") or []), *(self._data.get("ranking") or []))
        return [e for e in entries if (e["effect"], e["joint"]) == place]

    def _sizes(self, question: Question, shape: Shape, without: tuple[EffectInstance, ...]) -> Array:
        """Return sizes of the effect from one that a usual motion may show, up to its bound if one is known: where larger ones show, all do."""
        effect = self._imitators.instance(question.place, shape.at(shape.typical))
        evidence = self._usual.unfitted(HypothesisPair(((1.0, (*without, effect)),), without))
        least = shape.typical * (math.sqrt(DETECTABLE / evidence) if evidence > 0 else 1.0)
        least = min(max(least, shape.typical / 1e4), shape.typical * _TRIED_SIZE_RATIO)
        if question.bound is None or shape.inverse:
            return np.geomspace(least, _TRIED_SIZE_RATIO * least, SIZES)
        return np.geomspace(max(min(least, question.bound), question.bound / _TRIED_SIZE_RATIO), question.bound, SIZES)

    def _rival(self, question: Question, rough: HypothesisPair) -> EffectInstance:
        """Return the rival effect with the values that best imitate the effect over the usual motion."""
        middle = rough.alternatives[len(rough.alternatives) // 2]
        target = self._usual.difference(HypothesisPair((middle,), rough.rival))
        starts = list(self._imitators.starts(question.rival, rough.rival, target))
        for entry in self._entries(question.rival)[:1]:
            values = {name: float(p["value"]) for name, p in entry["parameters"].items()}
            starts.append(EffectInstance(*question.rival, {**values, **at_motor(entry.get("sides"))}))
        return self._imitators.best(starts, rough.rival, target)

    def _range(self, question: Question, effects: list[EffectInstance]) -> tuple[str, float, float] | None:
        name = self._specs[question.effect][0]["name"]
        values = [e.parameters[name] for e in effects if name in e.parameters and e.parameters[name] != 0]
        return (name, float(min(values)), float(max(values))) if values else None


def _likelihood(question: Question, shape: Shape, size: float) -> float:
    """Return the likelihood of an effect's size under the diagnosis' estimate, mean over both signs; 1 where there is no estimate."""
    if question.estimate is None:
        return 1.0
    value, sigma = question.estimate[shape.main]
    if sigma <= 0 or (shape.inverse and value <= 0):
        return 1.0
    if shape.inverse:
        value, sigma = 1.0 / value, sigma / value**2
    places = [(sign * size + shape.neutral - value) / sigma for sign in (1.0, -1.0)]
    return max(0.5 * sum(math.exp(-0.5 * x * x) for x in places), LEAST_LIKELY)


def _even(effects: Iterable[EffectInstance]) -> list[tuple[float, EffectInstance]]:
    found = list(effects)
    return [(1.0 / len(found), e) for e in found]


def _few(
    models: list[tuple[float, tuple[EffectInstance, ...]]],
) -> tuple[tuple[float, tuple[EffectInstance, ...]], ...]:
    """Return at most four of the models, small sizes first, with equal weights, for the search."""
    if len(models) <= len(NODES):
        return ((1.0, models[len(models) // 2][1]),)
    picked = [models[i] for first in range(0, len(models), SIZES) for i in (first, first + SIZES // 2)][:4]
    return tuple((1.0 / len(picked), effects) for _, effects in picked)
