"""The words of results and options are types, and the program uses no others."""

from __future__ import annotations

import pytest

import armgap
import report_cases as cases
from armgap import Arm, Estimator, identify, literals
from armgap.check.check import NAMES, SEVERITIES
from armgap.diagnosis.comparison import compare
from armgap.errors import OptionError
from armgap.report.advice import next_steps
from armgap.report.words import answers, verdict


def test_results_use_the_words_that_the_types_list() -> None:
    for case in cases.CASES.values():
        found = case()
        assert found.verdict in literals.VERDICTS
        assert {r.status for r in found.ruled_out} <= set(literals.STATUSES)
    changed = compare(cases.named(), cases.none())
    assert changed.outcome in literals.GAP_OUTCOMES
    assert {c.status for c in changed.causes} <= set(literals.CAUSE_STATUSES)


@pytest.mark.parametrize("word", literals.VERDICTS)
def test_every_verdict_has_its_words_everywhere(word) -> None:
    data = cases.named().to_dict() | {"verdict": word}
    assert verdict(data) != word
    assert len(answers(data)) == 3
    assert next_steps(data)


def test_every_scheme_and_variant_is_accepted_and_others_are_refused(pendulum: Arm) -> None:
    log = cases.swing(1)
    for scheme in literals.SCHEMES:
        for filters in literals.FILTERS:
            assert identify(log, pendulum, scheme=scheme, filters=filters).scheme == scheme
            Estimator(pendulum, scheme=scheme, filters=filters)
    with pytest.raises(OptionError, match="scheme"):
        identify(log, pendulum, scheme="power")  # type: ignore[arg-type]
    with pytest.raises(OptionError, match="filters"):
        Estimator(pendulum, filters="none")  # type: ignore[arg-type]


def test_the_types_are_public() -> None:
    from typing import get_args

    assert get_args(armgap.Verdict) == literals.VERDICTS
    assert get_args(armgap.Status) == literals.STATUSES
    assert get_args(armgap.Scheme) == literals.SCHEMES
    assert get_args(armgap.Filters) == literals.FILTERS
    assert get_args(armgap.Severity) == SEVERITIES
    assert get_args(armgap.CheckName) == NAMES
