"""Linear least squares of a rival's values, the arm's with their prior, to a difference of predictions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Columns", "Fitted"]

Array = NDArray[np.float64]


class Fitted(NamedTuple):
    """Values fitted to a difference, what is left of it in standard deviations, and its square with that of the prior."""

    values: Array
    left: Array
    square: float


@dataclass(frozen=True)
class Columns:
    """Columns that are fitted to a difference of predictions.

    Attributes
    ----------
    common : ndarray, shape (n_numbers, n_common)
        Of what every model fits, in standard deviations of the prior.
    free : ndarray, shape (n_numbers, n_free)
        Of the rival's own values, without a prior.
    names : tuple of str
        Those values.
    simulated : int
        Leading columns of `common` that are parameters of the arm.
    """

    common: Array
    free: Array
    names: tuple[str, ...]
    simulated: int

    def product(self, values: Array, *, simulated: bool) -> Array:
        """Change of the predictions by some values; `simulated` leaves out what no simulation has: the nuisances."""
        common = values[: self.common.shape[1]].copy()
        if simulated:
            common[self.simulated :] = 0.0
        return np.asarray(self.common @ common + self.free @ values[self.common.shape[1] :], dtype=np.float64)

    def fitted(self, delta: Array, weight: Array) -> Fitted:
        """Fit the columns to a difference, each number of which has a weight."""
        n, k = self.common.shape[1], self.free.shape[1]
        columns = np.hstack([self.common, self.free]) * weight[:, None]
        # Values without a prior in units of what they do, so that they are as well scaled as the rest.
        unit = np.append(np.ones(n), np.maximum(np.linalg.norm(columns[:, n:], axis=0), 1e-300))
        prior = np.hstack([np.eye(n), np.zeros((n, k))])
        rows = np.vstack([columns / unit, prior])
        right = np.concatenate([delta * weight, np.zeros(n)])
        solution = np.linalg.lstsq(rows, right, rcond=1e-12)[0]
        left = right - rows @ solution
        # The prior's part counts: values that the rival would need and that are not trusted speak against it.
        return Fitted(solution / unit, left[: len(delta)], float(left @ left))
