"""Baseline by FROLS of SysIdentPy: forward orthogonal least squares over the effects' signatures, model order by BIC.

The columns of the arm's regressor are projected out of the torques and of all signatures, so that FROLS explains the
residual torque of the re-estimated arm. Terms enter as inputs of a NFIR model of degree one without lag. The probability of a named
effect is the share of the residual's power that its terms remove (the sum of their error reduction ratios).

References
----------
Chen, Billings and Luo (1989), Int. J. Control 50, 1873-1896. Lacerda et al. (2020), J. Open Source Software 5(54), 2384.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import warnings
from typing import Any

import numpy as np

from armgap.trial.answers import Answer, NamedCause
from armgap.trial.baselines.regression import Array, regression_data
from armgap.trial.baselines.signatures import Signature, signatures
from armgap.trial.cases.sealed import SealedCase
from armgap.trial.methods import Method
from armgap.trial.simulation.engine import TrialEngineMissingError

__all__ = ["FROLS"]

#: Largest numbers of terms among which BIC selects in FROLS and of causes named, and smallest share of the residual's power of a named cause.
TERMS, MAX_CAUSES, _MIN_CAUSE_SHARE = 8, 4, 0.05


def answer(case: SealedCase) -> Answer:
    """Return an answer with the effects of the terms that FROLS keeps, by descending share of the residual's power."""
    made = regression_data(case)
    q, _ = np.linalg.qr(made.base)
    found = signatures(case.arm, made, made.motions[0])
    columns = np.hstack([s.columns for s in found])
    owner = [s for s in found for _ in range(s.columns.shape[1])]
    left, candidates = made.tau - q @ (q.T @ made.tau), columns - q @ (q.T @ columns)
    power = np.linalg.norm(candidates, axis=0)
    kept = np.flatnonzero(power > 1e-6 * np.linalg.norm(columns, axis=0))
    chosen, shares = _select(candidates[:, kept] / power[kept], left / np.std(left))
    return _named([owner[int(kept[i])] for i in chosen], shares)


def _named(terms: list[Signature], shares: list[float]) -> Answer:
    total: dict[tuple[str, int | None], float] = {}
    for s, share in zip(terms, shares, strict=True):
        key = (s.effect, s.joint)
        total[key] = total.get(key, 0.0) + share
    best = sorted(((share, key) for key, share in total.items() if share >= _MIN_CAUSE_SHARE), key=lambda x: -x[0])[
        :MAX_CAUSES
    ]
    causes = tuple(NamedCause(effect, joint, min(max(share, 0.0), 1.0)) for share, (effect, joint) in best)
    return Answer("frols", "effect" if causes else "none", causes)


def _select(candidates: Array, target: Array) -> tuple[list[int], list[float]]:
    """Return the chosen columns and their error reduction ratios, by FROLS."""
    library = _library()
    model = library.FROLS(
        order_selection=True,
        info_criteria="bic",
        n_info_values=min(TERMS, candidates.shape[1]),
        n_terms=None,
        xlag=[[1]] * candidates.shape[1],
        ylag=1,
        model_type="NFIR",
        basis_function=library.Polynomial(degree=1),
        estimator=library.LeastSquares(),
    )
    # A term of lag one at row k is the candidate's row k - 1: shift the candidates by one row.
    shifted = np.vstack([candidates[1:], candidates[-1:]])
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        model.fit(X=shifted, y=target.reshape(-1, 1))
    # Column 0 of the regression matrix of FROLS is the constant.
    terms = [(int(i) - 1, float(r)) for i, r in zip(model.pivv, model.err, strict=False) if int(i) > 0]
    return [i for i, _ in terms], [r for _, r in terms]


def _library() -> Any:
    try:
        return _Library()
    except ImportError as error:
        raise TrialEngineMissingError("sysidentpy", "the baseline frols", "trial-baselines") from error


class _Library:
    """The functions of SysIdentPy that the baseline uses."""

    def __init__(self) -> None:
        selection = importlib.import_module("sysidentpy.model_structure_selection")
        self.FROLS: Any = selection.FROLS
        self.Polynomial: Any = importlib.import_module("sysidentpy.basis_function").Polynomial
        self.LeastSquares: Any = importlib.import_module("sysidentpy.parameter_estimation").LeastSquares


def _check() -> None:
    _library()


FROLS = Method(
    "frols",
    "SysIdentPy FROLS",
    f"sysidentpy.FROLS over the same signatures with the arm's columns projected out, up to {TERMS} terms by BIC; effects whose terms "
    f"remove at least {_MIN_CAUSE_SHARE:.0%} of the residual's power, that share as probability",
    answer,
    check=_check,
)
