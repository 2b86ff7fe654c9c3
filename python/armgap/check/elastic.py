"""Elastic torques added to an arm's equation of motion: any torque on a joint that never falls with position, such as a spring or contact."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armgap.check.equation_error import EquationError
from armgap.log.log import Log

__all__ = ["beside_elasticity"]

Array = NDArray[np.float64]

# Number of alternating fits of model and elastic torques. An elastic torque that is most of a torque is found in the first fit; after five fits no
# unexplained share changed by more than 0.02 on nine development cases (columns of another arm 0.5 to 1.1, a spring 0.7 before and 0.09 after).
_TURNS = 5
# Number of classes of position within which an elastic torque, any function that does not fall with position, is constant.
_CLASSES = 50


def beside_elasticity(
    base: EquationError,
    logs: Sequence[Log],
    model: Callable[[EquationError], tuple[Array, Array]],
    joints: Sequence[int] | None = None,
) -> EquationError:
    """Return the equation error of the torques less an elastic torque on each joint, which is fitted alternately with the model.

    Parameters
    ----------
    base : EquationError
        Equation error of the logs.
    logs : sequence of Log
        Logs of the arm.
    model : callable
        Fit to an equation error: returns the parameters and a factor per torque, non-zero for the joints in `joints`.
    joints : sequence of int, optional
        Joints (from 0) with an elastic torque; all by default.
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
