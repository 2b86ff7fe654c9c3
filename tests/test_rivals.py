"""Causes beside each other: what would do as well in another's place, and two that share a gap."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from armgap import Arm, Diagnosis, diagnose, seed_torque, simulate
from armgap.simulation import Effect
from swings import swing

NOISE_RAD = 1e-5
LATE = {"actuator_lag": "time_constant", "actuator_delay": "delay"}


@pytest.fixture(params=["actuator_lag", "actuator_delay"])
def late(request, pendulum) -> Callable[[float], Diagnosis]:
    """Diagnoses of a pendulum whose torque comes late by this time, s: late and rounded, or only late."""

    def of(size: float) -> Diagnosis:
        effect = Effect(request.param, 1, {LATE[request.param]: size})
        training, holdout = (swing(pendulum, seed, effect, noise=NOISE_RAD) for seed in (1, 2))
        return diagnose(training, pendulum, holdout=holdout)

    of.hidden = request.param
    return of


def test_what_would_do_nearly_as_well_is_not_called_absent(late):
    result = late(0.0005)
    [named] = [c.effect for c in result.causes]
    [other] = [r for r in result.ruled_out if r.effect in LATE]
    assert {named, other.effect} == set(LATE)
    assert (other.status, other.bound) == ("undecided", None)
    assert "in place of" in other.why


def test_what_would_do_worse_is_called_absent(late):
    result = late(0.01)
    assert [c.effect for c in result.causes] == [late.hidden]
    [other] = [r for r in result.ruled_out if r.effect in LATE]
    assert other.status == "absent"
    assert other.bound.value < 1e-4


@pytest.fixture(scope="module")
def pair(arm: Arm) -> Diagnosis:
    """An encoder that is off at joint 1 and a gear at joint 2; each leaves the other's share of the gap."""
    t = np.arange(2400) * arm.sample_period
    hidden = [Effect("encoder_offset", 1, {"offset": -0.05}), Effect("gear_efficiency", 2, {"loss": 0.2})]
    other = np.column_stack([45 * np.sin(9 * t) + 20 * np.sin(17 * t), 6 * np.sin(15 * t + 1) + 4 * np.sin(31 * t)])
    training = simulate(arm, t, seed_torque(t), effects=hidden, name="training")
    return diagnose(training, arm, holdout=simulate(arm, t, other, effects=hidden, name="holdout"))


def test_both_of_a_pair_are_named(pair):
    assert {(c.effect, c.joint) for c in pair.causes} == {("encoder_offset", 1), ("gear_efficiency", 2)}
    assert all(c.probability > 0.5 for c in pair.causes)
