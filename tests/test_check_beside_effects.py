"""Checks of the input beside strong effects and small motions: what an effect explains better, or no motion shows, is no defect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armgap import Arm
from armgap.check import Corrections, examine, time_shift
from armgap.check.contradiction import BETTER, Refit
from swings import swing


def test_an_error_beyond_the_motion_confirms_no_other_reading() -> None:
    balancing = Refit(np.ones(4), np.ones(4), np.array([0.006, 0.015]), np.array([0.002, 0.005]))
    exchanged = Refit(np.ones(4), np.ones(4), np.array([0.005, 0.002]), np.array([0.005, 0.002]))
    assert exchanged.against(balancing) < BETTER
    assert exchanged.against(balancing.bounded_by_motion()) == pytest.approx(1.0)


def test_a_shift_that_explains_less_than_an_effect_without_it_was_none() -> None:
    def gap(*after: float) -> dict[str, object]:
        return {"after": list(after)}

    assert time_shift.explains_better(gap(7e-5), gap(3e-3))
    assert not time_shift.explains_better(gap(3e-3), gap(3e-3))
    assert not time_shift.explains_better(gap(1e-3, 4e-3), gap(2e-3, 2e-3))


def test_a_payload_is_no_other_unit_where_friction_stands(pendulum: Arm) -> None:
    def checked(*logs: object) -> list[str]:
        return [check.check for check in examine(logs[:1], logs[1:], pendulum).checks]

    carrying = replace(pendulum, theta=pendulum.theta * np.array([3.0, 3.0, 1.0, 1.0]))
    assert checked(*(swing(carrying, seed) for seed in (1, 2))) == []
    other_unit = Corrections(factor={"tau": 1 / 3})
    assert checked(*(other_unit.on_log(swing(pendulum, seed)) for seed in (1, 2))) == ["torque_unit"]
