"""Linear least squares: parameters of arm and rival, the arm's with their prior, fitted to a difference of predictions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Columns", "Fitted"]

Array = NDArray[np.float64]


class Fitted(NamedTuple):
    """Result of a fit to a difference of predictions: values, remaining difference in standard deviations, and its square plus that of the prior."""

    values: Array
    left: Array
    square: float


@dataclass(frozen=True)
class Columns:
    """Regressor columns that are fitted to a difference of predictions.

    Attributes
    ----------
    common : ndarray, shape (n_numbers, n_common)
        Columns of the values that every model fits, in standard deviations of the prior.
    free : ndarray, shape (n_numbers, n_free)
        Columns of the rival's own values, without a prior.
    names : tuple of str
        Names of the rival's own values.
    simulated : int
        Leading columns of `common` that are parameters of the arm.
    """

    common: Array
    free: Array
    names: tuple[str, ...]
    simulated: int

    def product(self, values: Array, *, simulated: bool) -> Array:
        """Return the change of the predictions by some values; `simulated` leaves out nuisances, which no simulation has."""
        common = values[: self.common.shape[1]].copy()
        if simulated:
            common[self.simulated :] = 0.0
        return np.asarray(self.common @ common + self.free @ values[self.common.shape[1] :], dtype=np.float64)

    def fitted(self, delta: Array, weight: Array) -> Fitted:
        """Return the weighted least-squares fit of the columns to a difference of predictions."""
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
