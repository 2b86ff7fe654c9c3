"""Reference motions of a plan: design variables and sizes of effects give motions and values within the limits."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from armgap.arm import MotionLimits
from armgap.planning.motion import build, count
from armgap.planning.open_questions.sizes import levels

PEAKS = 1e-3  # what a peak between two samples may exceed those at the samples by


def test_stops_beyond_the_diagnosed_range_lie_on_either_side_of_zero():
    scales = SimpleNamespace(
        seen_low=[-2.0], seen_high=[-1.0], low=[-3.0], high=[1.0], torque=[2.0], position=[0.5], speed=[1.0]
    )
    found = levels("contact", 1, scales)
    for stop in found:
        upper = (stop["position"] >= 0) == (stop["stiffness"] > 0)
        assert upper == (stop["position"] > -1.0), stop
    positions = [stop["position"] for stop in found]
    assert min(positions) > -3.0
    assert max(positions) < 1.0
    assert {p > -1.0 for p in positions} == {True, False}
    assert any(-1.0 < p < 0.0 for p in positions)


@pytest.mark.parametrize("seed", range(12))
def test_any_numbers_give_a_motion_within_limits_at_rest_at_both_ends(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    low, high = -rng.uniform(0.1, 3.0, n), rng.uniform(0.1, 3.0, n)
    limits = MotionLimits(low, high, rng.uniform(0.2, 6.0, n), rng.uniform(1.0, 60.0, n))
    motion = build(rng.uniform(0, 1, count(n)), np.zeros(n), limits, rng.uniform(2.0, 12.0), 0.002)
    t = np.linspace(0.0, motion.duration, 20_001)
    q, dq, ddq = motion.at(t)
    assert np.all(q <= high + PEAKS)
    assert np.all(q >= low - PEAKS)
    assert np.all(np.abs(dq) <= limits.speed * (1 + PEAKS))
    assert np.all(np.abs(ddq) <= limits.acceleration * (1 + PEAKS))
    for end in (0, -1):
        assert np.all(q[end] == 0)
        assert np.all(dq[end] == 0)
        assert np.all(ddq[end] == 0)
    assert np.max(np.ptp(q, axis=0)) > 0
