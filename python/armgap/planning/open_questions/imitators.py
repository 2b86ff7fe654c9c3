"""Effects that imitate another effect: values of an effect with which it changes a usual motion as much as possible like the other does."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.evidence.hypothesis import EffectInstance
from armgap.planning.criterion import PredictedMotion
from armgap.planning.open_questions.sizes import Scales, levels, shapes

__all__ = ["Imitators"]

Array = NDArray[np.float64]
EffectOnJoint = tuple[str, int | None]
Effects = tuple[EffectInstance, ...]

#: Largest number of evaluations, per value, of the fit of an effect to what another one changes.
_MAX_EVALUATIONS = 12


class Imitators:
    """Effects as imitations of another one on a usual motion.

    Parameters
    ----------
    usual : PredictedMotion
        A usual motion within the limits.
    scales : Scales
        Typical torques, speeds and positions in the usual motion.
    specs : dict of str to list of dict
        Parameters of each effect, with their bounds.
    """

    def __init__(self, usual: PredictedMotion, scales: Scales, specs: Mapping[str, list[dict[str, Any]]]) -> None:
        self._usual = usual
        self._scales = scales
        self._specs = specs

    def instance(self, place: EffectOnJoint, values: Mapping[str, float]) -> EffectInstance:
        """Return an effect with values kept within the bounds of its parameters: small and slow motions suggest some beyond them."""
        bounds = {spec["name"]: (spec["lower"], spec["upper"]) for spec in self._specs[place[0]]}
        kept = {
            name: min(max(v, bounds[name][0]), bounds[name][1]) if name in bounds else v for name, v in values.items()
        }
        return EffectInstance(*place, kept)

    def starts(self, place: EffectOnJoint, without: Effects, target: Array) -> Iterable[EffectInstance]:
        """Yield instances of an effect: per shape the one of the size that best fits the difference `target`, or of typical size; or its levels."""
        known = shapes(*place, self._scales)
        for shape in known:
            typical = self.instance(place, shape.at(shape.typical))
            try:
                factor = self._usual.left_of(target, self._usual.change(typical, without))[1][0]
            except ValueError:
                continue
            size = float(factor) * shape.typical
            spec = self._specs[place[0]][0]
            is_possible = (size > 0 or not shape.inverse) and spec["lower"] <= shape.at(size)[shape.main] <= spec[
                "upper"
            ]
            yield self.instance(place, shape.at(size)) if is_possible and size else typical
        for level in () if known else levels(*place, self._scales):
            yield self.instance(place, level)

    def least_left(self, place: EffectOnJoint, without: Effects, target: Array) -> float:
        """Return the least square that an effect may leave of a difference, by first-order fits of all its values and the arm's.

        A spring with a far-off rest position is an offset: the size alone would not tell. Infinite if the effect cannot be predicted.
        """
        left = np.inf
        for start in self.starts(place, without, target):
            try:
                left = min(left, self._usual.left_of(target, *self._usual.imitations(start, without))[0])
            except ValueError:
                continue
        return float(left)

    def best(self, starts: Iterable[EffectInstance], without: Effects, target: Array) -> EffectInstance:
        """Return the instance of an effect that leaves least of a difference, beside the arm's values, of fits of all its values from some instances.

        Raises
        ------
        ValueError
            If no instance can be predicted along the usual motion.
        """
        found = [self._fitted(start, without, target) for start in starts]
        _, best = min(found, key=lambda x: x[0], default=(np.inf, None))
        if best is None:
            raise ValueError
        return best

    def _fitted(self, start: EffectInstance, without: Effects, target: Array) -> tuple[float, EffectInstance | None]:
        """Return the square that an effect leaves of a difference, and the effect, after a fit of its values (Levenberg-Marquardt)."""
        from scipy.optimize import least_squares

        names = [n for n in start.parameters if any(n == spec["name"] for spec in self._specs[start.effect])]
        first = np.array([start.parameters[n] for n in names])
        unit = np.where(first == 0.0, 1.0, np.abs(first))

        def effect(x: Array) -> EffectInstance:
            return self.instance(
                (start.effect, start.joint), {**start.parameters, **dict(zip(names, x * unit, strict=True))}
            )

        def left(x: Array) -> Array:
            return self._usual.remainder(target - self._usual.change(effect(x), without))

        try:
            found = least_squares(
                left, first / unit, method="lm", diff_step=1e-3, max_nfev=_MAX_EVALUATIONS * (len(names) + 1)
            )
        except ValueError:
            return np.inf, None
        return 2.0 * float(found.cost), effect(found.x)
