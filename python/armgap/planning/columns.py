"""Linear least squares: values of the arm, with a prior, and of a rival are fitted to a difference of two models' predictions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Columns", "Fitted"]

Array = NDArray[np.float64]


class Fitted(NamedTuple):
    """Fit to a difference of predictions: values, remaining difference in standard deviations, and sum of its and the prior's squared residuals."""

    values: Array
    left: Array
    square: float


@dataclass(frozen=True)
class Columns:
    """Regressor columns that are fitted to a difference of predictions.

    Attributes
    ----------
    common : ndarray, shape (n_numbers, n_common)
        Derivatives of the predictions by the values that every model fits, per standard deviation of their prior.
    free : ndarray, shape (n_numbers, n_free)
        Derivatives of the predictions by the rival's own values, which have no prior.
    names : tuple of str
        Names of the rival's own values.
    simulated : int
        Number of leading columns of `common` that belong to parameters of the arm; the rest belongs to nuisances.
    """

    common: Array
    free: Array
    names: tuple[str, ...]
    simulated: int

    def product(self, values: Array, *, simulated: bool) -> Array:
        """Return the change of the predictions for changes of the values; if `simulated`, without nuisances, which the simulator does not have."""
        common = values[: self.common.shape[1]].copy()
        if simulated:
            common[self.simulated :] = 0.0
        return np.asarray(self.common @ common + self.free @ values[self.common.shape[1] :], dtype=np.float64)

    def fitted(self, delta: Array, weight: Array) -> Fitted:
        """Return the weighted least-squares fit of the columns to a difference of predictions."""
        n, k = self.common.shape[1], self.free.shape[1]
        columns = np.hstack([self.common, self.free]) * weight[:, None]
        # Columns without a prior are normed, so that they are as well scaled as those with a prior.
        unit = np.append(np.ones(n), np.maximum(np.linalg.norm(columns[:, n:], axis=0), 1e-300))
        prior = np.hstack([np.eye(n), np.zeros((n, k))])
        rows = np.vstack([columns / unit, prior])
        right = np.concatenate([delta * weight, np.zeros(n)])
        solution = np.linalg.lstsq(rows, right, rcond=1e-12)[0]
        left = right - rows @ solution
        # The prior's residuals count: a rival that needs implausible values of the arm is less likely.
        return Fitted(solution / unit, left[: len(delta)], float(left @ left))
