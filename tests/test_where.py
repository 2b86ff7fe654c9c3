"""On which joint a gap lies that nothing in the library explains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armgap import Arm, Diagnosis, Log, diagnose, simulate
from armgap.cli.demo import CASE_FOLDER
from armgap.simulation import Effect
from swings import off, sines


def wavy(tau: np.ndarray) -> np.ndarray:
    """A drive whose gain rises and falls with the command."""
    return tau * (1 - 0.1 * np.cos(10 * tau / np.abs(tau).max()))


def diagnosed(joint: int, noise: float, counts: bool) -> Diagnosis:
    """An arm with such a drive on one joint and slightly other values than its file's."""
    arm = Arm.read(CASE_FOLDER / "arm.toml")
    arm = arm if counts else replace(arm, counts_per_rev=None)
    real, t = off(arm), np.arange(4000) * arm.sample_period

    def log(seed: int) -> Log:
        commanded = sines(t, seed)
        given = commanded.copy()
        given[:, joint - 1] = wavy(commanded[:, joint - 1])
        moved = simulate(real, t, given, noise=noise, encoder=counts, seed=seed, name=f"run {seed}")
        return replace(moved, tau=commanded)

    return diagnose(log(1), arm, holdout=log(2))


@pytest.mark.parametrize("joint", [1, 2])
@pytest.mark.parametrize(("noise", "counts"), [(0.0, True), (2e-5, True), (0.0, False)])
def test_the_joint_with_the_residual_torque_is_the_first_place(joint, noise, counts):
    result = diagnosed(joint, noise, counts)
    assert result.verdict == "unexplained"
    assert result.where[0].joint == joint
    assert sum(place.share for place in result.where) == pytest.approx(1.0)


def test_a_log_of_fifty_samples_per_second_shows_where() -> None:
    arm = replace(Arm.read(CASE_FOLDER / "arm.toml"), sample_period=0.02, counts_per_rev=None)
    t = np.arange(500) * arm.sample_period
    effect = Effect("cubic_drag", 1, {"c3": 3.0})
    given = [
        simulate(arm, t, sines(t, seed), effects=[effect], noise=2e-5, seed=seed, name=str(seed)) for seed in (1, 2)
    ]
    result = diagnose(given[0], arm, holdout=given[1])
    regimes = result.to_dict()["regimes"]
    assert regimes
    assert all(sum(regime["count"]) > 100 for regime in regimes)
    position = next(r for r in regimes if r["variable"] == "q1")
    travel = np.ptp(given[1].q[:, 0])
    assert position["edges"][-1] - position["edges"][0] > 0.8 * travel
