"""Baseline by stepwise regression on torque residuals by BIC, checked on the holdout.

In every step the effect (with the best shape of its grid) that lowers BIC most is added; BIC counts a term per coefficient and
one for the choice among shapes, twice the logarithm of their number. The arm's parameters are
re-estimated each time with the arm file's sigmas as prior. Of the effects that lower BIC by more than ten, the first is added
that also lowers the residual power on the holdout by two percent (not required of external pulses). At most four are named.

References
----------
Schwarz (1978), Ann. Stat. 6, 461-464. Kass and Raftery (1995), J. Am. Stat. Assoc. 90, 773-795: a difference of ten is
very strong evidence, and exp(-BIC/2) weighs models.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from armgap.trial.answers import Answer, NamedCause
from armgap.trial.baselines.regression import Array, regression_data
from armgap.trial.baselines.signatures import Signature, signatures
from armgap.trial.cases.sealed import SealedCase
from armgap.trial.methods import Method

__all__ = ["STEPWISE"]

#: Stepwise regression: largest number of causes, pushes included; smallest decrease of BIC by a cause; and upper bound of the
#: ratio of the residual powers on the holdout with and without a cause.
MAX_CAUSES, EVIDENCE, HELD_OUT = 4, 10.0, 0.98
#: Effects that act in one log only, so that the holdout cannot confirm them.
EVENTS = ("external_pulse",)


@dataclass
class _Problem:
    """Least squares with a prior: training rows, holdout rows, and the columns chosen so far."""

    columns: Array
    target: Array
    held: Array
    held_target: Array
    rows: int

    def fit(self, extra: Array) -> tuple[float, Array]:
        """Return the residual power and the coefficients of the fit with `extra` columns added."""
        all_columns = np.hstack([self.columns, extra])
        coefficients = np.asarray(np.linalg.lstsq(all_columns, self.target, rcond=None)[0], dtype=np.float64)
        left = self.target - all_columns @ coefficients
        return float(left @ left), coefficients

    def bic(self, extra: Array, terms: int) -> float:
        """Return the BIC of a model with `terms` terms in addition to the arm's parameters."""
        power, _ = self.fit(extra)
        return self.rows * float(np.log(max(power, 1e-300) / self.rows)) + terms * float(np.log(self.rows))

    def judged(self, extra: Array, held_extra: Array) -> float:
        """Return the residual power on the holdout of the fit with `extra` columns added."""
        _, coefficients = self.fit(extra)
        left = self.held_target - np.hstack([self.held, held_extra]) @ coefficients
        return float(left @ left)


def answer(case: SealedCase) -> Answer:
    """Return an answer with the effects that stepwise selection keeps."""
    problem, candidates = _problem(case)
    chosen: list[NamedCause] = []
    price = _price([s for s, _ in candidates])
    terms, now = 0, problem.bic(problem.columns[:, :0], 0)
    for _ in range(MAX_CAUSES):
        taken = {c.effect + str(c.joint) for c in chosen}
        scored = [
            (problem.bic(_padded(s, problem), terms + s.columns.shape[1]) + price[(s.effect, s.joint)], s, held)
            for s, held in candidates
            if s.effect + str(s.joint) not in taken
        ]
        left = _confirmed(problem, sorted(scored, key=lambda x: x[0]), now - EVIDENCE)
        if not left:
            break
        _, s, held = left[0]
        chosen.append(NamedCause(s.effect, s.joint, _weight(left, s)))
        problem.columns = np.hstack([problem.columns, _padded(s, problem)])
        problem.held = np.hstack([problem.held, held.columns])
        terms += s.columns.shape[1]
        now = problem.bic(problem.columns[:, :0], terms)
    return Answer("stepwise", "effect" if chosen else "none", tuple(chosen))


#: BIC of the model with a candidate added, and the candidate's signature in training and in holdout rows.
ScoredCandidate = tuple[float, Signature, Signature]


def _confirmed(problem: _Problem, scored: list[ScoredCandidate], limit: float) -> list[ScoredCandidate]:
    """Return the candidates, sorted by BIC, from the first that the holdout confirms on; empty if none below the BIC limit is confirmed."""
    for i, (value, s, held) in enumerate(scored):
        if value > limit:
            break
        if _holds(problem, s, held):
            return scored[i:]
    return []


def _problem(case: SealedCase) -> tuple[_Problem, list[tuple[Signature, Signature]]]:
    made = regression_data(case)
    held = regression_data(case, made.scale, held_out=True)
    ref = made.motions[0]
    pairs = list(zip(signatures(case.arm, made, ref), signatures(case.arm, held, ref), strict=True))
    prior = np.diag(1.0 / case.arm.sigma)
    problem = _Problem(
        np.vstack([made.base, prior]),
        np.concatenate([made.tau, case.arm.theta / case.arm.sigma]),
        held.base,
        held.tau,
        len(made.tau),
    )
    return problem, pairs


def _price(candidates: list[Signature]) -> dict[tuple[str, int | None], float]:
    """Return the BIC penalty for the choice among an effect's shapes, by effect and joint."""
    count = Counter((s.effect, s.joint) for s in candidates)
    return {key: 2.0 * float(np.log(n)) for key, n in count.items()}


def _padded(s: Signature, problem: _Problem) -> Array:
    """Return the signature's columns with zero in the rows of the prior."""
    padded = np.zeros((len(problem.target), s.columns.shape[1]))
    padded[: len(s.columns)] = s.columns
    return padded


def _holds(problem: _Problem, s: Signature, held: Signature) -> bool:
    if s.effect in EVENTS:
        return True
    none = problem.columns[:, :0]
    before = problem.judged(none, problem.held[:, :0])
    return problem.judged(_padded(s, problem), held.columns) < HELD_OUT * before


def _weight(scored: list[ScoredCandidate], chosen: Signature) -> float:
    """Return the posterior weight, 0 to 1, of an effect among all candidates: ``exp(-BIC/2)`` of its best shape over the sum for all."""
    best: dict[tuple[str, int | None], float] = {}
    for value, s, _ in scored:
        key = (s.effect, s.joint)
        best[key] = min(value, best.get(key, np.inf))
    least = min(best.values())
    weights = {key: float(np.exp(-0.5 * (value - least))) for key, value in best.items()}
    return weights[(chosen.effect, chosen.joint)] / sum(weights.values())


STEPWISE = Method(
    "stepwise",
    "stepwise BIC",
    "forward selection on torque residuals by BIC, arm re-estimated in every step with the arm file's sigmas as prior; an effect "
    "stays if BIC falls by more than 10 and the held-out residual by 2 %; at most four, weights exp(-BIC/2) as probabilities",
    answer,
)
