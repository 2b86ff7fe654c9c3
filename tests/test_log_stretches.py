"""Long logs: what is chosen moves, varies, keeps to the budget and is said."""

from __future__ import annotations

import numpy as np
import pytest

from armgap import Arm, Log, diagnose, simulate
from armgap.log.stretches import choose, thinned


def long_log(quiet: float = 0.8, name: str = "long") -> Log:
    """Two hundred seconds at 200 Hz; a joint moves in the first part of every 20 s, faster each time."""
    t = np.arange(40_000) * 0.005
    go = (t % 20) < 20 * (1 - quiet)
    level = 1 + t // 20
    q = np.where(go, np.sin(level * (t % 20)), 0.0)
    return Log.from_arrays(
        t, np.round(q / 1e-4) * 1e-4, np.where(go, level * np.cos(level * (t % 20)), 0.01), name=name
    )


def test_what_fits_stays_whole():
    log = long_log()
    assert choose([log], budget=len(log)) == [log]


def test_the_budget_holds_and_rest_is_left_out():
    log = long_log()
    parts = choose([log], budget=6000)
    assert 3000 < sum(len(part) for part in parts) <= 6000
    assert all(np.ptp(part.q) > 0.5 for part in parts)
    levels = {int(1 + part.t[0] // 20) for part in parts}
    assert len(levels) >= 5  # several speeds, not one of them again and again
    for part in parts:
        first = int(np.searchsorted(log.t, part.t[0]))
        np.testing.assert_array_equal(part.q, log.q[first : first + len(part)])
        np.testing.assert_array_equal(part.t, log.t[first : first + len(part)])  # on the clock of the whole log
    [said] = [f.message for f in parts[0].findings if f.kind == "stretches"]
    assert f"of 40000 samples over 200 s, {sum(len(p) for p in parts)} in {len(parts)} stretches" in said
    assert choose([log], budget=6000)[0].name == parts[0].name


def test_a_thinned_log_has_the_torques_impulse_and_first_moment():
    t = np.cumsum(np.random.default_rng(1).uniform(0.9e-3, 1.1e-3, 1000))
    log = Log.from_arrays(t, np.sin(t), np.cos(7 * t), dq=np.cos(t), name="dense")
    thin, t = thinned(log, 3), log.t
    assert len(thin) == 333
    for values in ("t", "q", "dq"):
        np.testing.assert_array_equal(getattr(thin, values), getattr(log, values)[:999:3])
    ends = np.append(t[1:], t[-1] + log.sample_period)
    h, mid = ends - t, 0.5 * (t + ends)
    for first, last in ((0, 3), (600, 603)):
        k, own = first // 3, slice(first, last)
        whole = ends[last - 1] - t[first]
        assert thin.tau[k, 0] * whole == pytest.approx(h[own] @ log.tau[own, 0], rel=1e-12)
        centre = t[first] + 0.5 * whole
        assert thin.moment[k, 0] == pytest.approx((h * (mid - centre))[own] @ log.tau[own, 0], rel=1e-9, abs=1e-15)
    assert thinned(log, 1) is log
    references = Log.from_arrays(t, np.sin(t), None, q_ref=np.sin(t), name="references")
    assert thinned(references, 3) is references


def test_no_stretch_spans_a_gap():
    log = long_log(quiet=0.0)
    keep = np.ones(len(log), dtype=bool)
    keep[1000:1100] = False
    holed = Log.from_arrays(log.t[keep], log.q[keep], log.tau[keep], name="holed")
    for part in choose([holed], budget=20_000):
        assert np.diff(part.t).max() < 0.006


def test_several_logs_share_the_budget():
    logs = [long_log(), long_log(quiet=0.5, name="other")]
    parts = choose(logs, budget=8000)
    assert sum(len(part) for part in parts) <= 8000
    assert len({part.name for part in parts}) == len(parts)


@pytest.mark.slow
def test_a_long_log_is_diagnosed_by_its_stretches(monkeypatch, tmp_path):
    from armgap.log import stretches

    (tmp_path / "arm.toml").write_text(
        'kind = "pendulum"\nsample_period = 0.005\n[inertial]\ntheta = [0.5, 4.0]\n'
        "[friction]\nviscous = [0.1]\ncoulomb = [0.3]\n[encoder]\ncounts_per_rev = [200000]\n"
    )
    arm = Arm.read(tmp_path / "arm.toml")
    t = np.arange(16_000) * 0.005
    tau = np.where(t % 20 < 5, 4 * np.sin(3 * t) + 2 * np.sin(7.3 * t), 0.0)
    from armgap.simulation import Effect

    log = simulate(arm, t, tau, effects=[Effect("torque_offset", 1, {"offset": 0.4})], name="long")
    monkeypatch.setattr(stretches.choose, "__defaults__", (3000,))
    result = diagnose(log, arm, max_causes=1)
    assert result.verdict == "effect"
    assert any("stretches are used" in remark for remark in result.remarks)
    assert all(entry["samples"] <= 3000 for entry in result.extra.get("logs", []) if "samples" in entry)


@pytest.mark.parametrize("budget", [400, 1000])
def test_small_budgets(budget):
    parts = choose([long_log()], budget=budget)
    assert 0 < sum(len(part) for part in parts) <= budget
