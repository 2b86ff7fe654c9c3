"""Elastic torques beside an arm's equation of motion: whatever on a joint does not fall with its position, as springs and contacts do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armgap.check.equation_error import EquationError
from armgap.log.log import Log

__all__ = ["beside_elasticity"]

Array = NDArray[np.float64]

# Turns of a fit beside elastic torques. One that takes most of a torque is found in the first; after five no share changed by more than 0.02 on
# nine development cases (columns of another arm 0.5 to 1.1, a spring 0.7 before and 0.09 after).
_TURNS = 5
# Positions are taken together in so many classes where a torque may be any function of them that does not fall.
_CLASSES = 50


def beside_elasticity(
    base: EquationError,
    logs: Sequence[Log],
    model: Callable[[EquationError], tuple[Array, Array]],
    joints: Sequence[int] | None = None,
) -> EquationError:
    """Return the equation error of the torques without an elastic one on each joint, fitted by turns with the model.

    Parameters
    ----------
    base : EquationError
        Of the logs.
    logs : sequence of Log
        The logs.
    model : callable
        What a fit makes of an equation error: the parameters, and the factors that belong on the torques, not zero on the joints asked for.
    joints : sequence of int, optional
        Joints that elastic torques are looked for on; all by default.
    """
    q = np.concatenate([log.q[rows.samples] for log, rows in zip(logs, base.rows, strict=True)])
    ends = np.cumsum([len(rows.y) for rows in base.rows])[:-1]
    asked = list(range(q.shape[1]) if joints is None else joints)
    now = base
    for _ in range(_TURNS):
        theta, factors = model(now)
        left = np.concatenate([rows.y[:, asked] - rows.psi[:, asked] @ theta / factors[asked] for rows in base.rows])
        elastic = np.zeros_like(q)
        for j, torque in zip(asked, left.T, strict=True):
            elastic[:, j] = _rising(q[:, j], torque)
        parts = np.split(elastic, ends)
        rows = [replace(r, y=r.y - part) for r, part in zip(base.rows, parts, strict=True)]
        now = EquationError(rows, base.arm, base.scale)
    return now


def _rising(x: Array, y: Array) -> Array:
    """Return the function of `x` that never falls and is closest to `y`: isotonic regression by pooling adjacent violators (Barlow et al. 1972)."""
    edges = np.linspace(x.min(), x.max(), _CLASSES + 1)[1:-1]
    place = np.searchsorted(edges, x)
    weight = np.bincount(place, minlength=_CLASSES).astype(float)
    taken = weight > 0
    middle = np.bincount(place, x, minlength=_CLASSES)[taken] / weight[taken]
    pools: list[tuple[float, float, int]] = []
    for mean, count in zip(
        np.bincount(place, y, minlength=_CLASSES)[taken] / weight[taken], weight[taken], strict=True
    ):
        pool = (float(mean), float(count), 1)
        while pools and pools[-1][0] > pool[0]:
            before = pools.pop()
            total = before[1] + pool[1]
            pool = ((before[0] * before[1] + pool[0] * pool[1]) / total, total, before[2] + pool[2])
        pools.append(pool)
    rising = np.repeat([p[0] for p in pools], [p[2] for p in pools])
    return np.asarray(np.interp(x, middle, rising))
