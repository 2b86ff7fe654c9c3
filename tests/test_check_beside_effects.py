"""Checks of the input beside strong effects and small motions: what an effect explains better, or no motion shows, is no defect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from armgap import Arm, Log
from armgap.arm.load import payload_change
from armgap.check import Corrections, examine, time_shift, torque_unit
from armgap.check.contradiction import BETTER, Refit
from armgap.check.equation_error import EquationError, Rows
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


def tracked(theta: Sequence[float], seed: int) -> Log:
    """Four sines per joint, and the torques along them of the two-link arm `theta` with friction, by Lagrange's equations."""
    t = 0.0025 * np.arange(4000)[:, None, None]
    draw = np.random.default_rng(seed)
    w, phase, size = (draw.uniform(low, high, (2, 4)) for low, high in ((1.0, 7.5), (0.0, 6.28), (0.1, 0.45)))
    q, dq, ddq = ((size * w**k * np.sin(w * t + phase + 0.5 * k * np.pi)).sum(axis=2) for k in range(3))
    a, c, b, g1, g2, *friction = theta
    cos, sin = np.cos(q[:, 1]), np.sin(q[:, 1])
    weight = g2 * np.sin(q.sum(axis=1))
    first = (a + 2 * c * cos) * ddq[:, 0] + (b + c * cos) * ddq[:, 1] - c * sin * (2 * dq[:, 0] + dq[:, 1]) * dq[:, 1]
    second = (b + c * cos) * ddq[:, 0] + b * ddq[:, 1] + c * sin * dq[:, 0] ** 2
    tau = np.column_stack([first + g1 * np.sin(q[:, 0]) + weight, second + weight])
    tau += dq * friction[:2] + np.tanh(dq / 0.01) * friction[2:]
    return Log(f"motion {seed}", t[:, 0, 0], q, tau)


def test_a_payload_as_heavy_as_the_link_is_no_other_unit(arm: Arm) -> None:
    theta = np.array([0.129, 0.018, 0.01, 4.709, 0.589, 0.05, 0.02, 0.5, 0.15])
    friction = 0.5 * np.where(np.arange(9) < 5, 0.2, 1.0)
    small = replace(arm, theta=theta, sigma=theta * friction, link_length=np.array([0.3, 0.25]))

    def factor(change: np.ndarray) -> dict[str, float]:
        logs = [tracked(small.theta + change, seed) for seed in (1, 2)]
        found = torque_unit.find(EquationError([Rows.of(log, small) for log in logs], small), logs, small)
        return {} if found is None else dict(found.corrections.factor)

    assert factor(payload_change(small, 0.6, 0.22)) == {}
    assert factor(payload_change(small, 2.0, 0.22)) == {}
