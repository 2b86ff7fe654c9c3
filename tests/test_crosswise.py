"""Training logs that do not show what the holdout does: every log is cut into stretches learnt from and judged on by turns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from armgap import Arm, Diagnosis, Log, diagnose, simulate
from armgap.cli.demo import CASE_FOLDER
from armgap.report import render_html
from armgap.simulation import Effect
from swings import sines

CROSSWISE = "training and holdout logs show different gaps"
NOISE_RAD = 1e-5
WIDE_SEED = 3


def reaching(stop: float, *others: Effect, gently: bool = True) -> Sequence[Log]:
    """Two runs of an arm with a stop on joint 2, the second wide enough to meet it; the first stays clear of it if it is gentle."""
    arm = Arm.read(CASE_FOLDER / "arm.toml")
    t = np.arange(2400) * arm.sample_period
    contact = Effect("contact", 2, {"position": stop, "stiffness": 40.0, "damping": 0.5})
    first, second = (
        simulate(arm, t, scale * sines(t, seed), effects=[contact, *others], noise=NOISE_RAD, seed=seed, tolerance=1e-6)
        for seed, scale in ((1, 0.4) if gently else (WIDE_SEED, 1.0), (2, 1.0))
    )
    assert (first.q[:, 1].max() < stop) == gently
    assert second.q[:, 1].max() > stop
    return first, second


def diagnosed(logs: Sequence[Log]) -> Diagnosis:
    """The second log held out."""
    return diagnose(logs[0], Arm.read(CASE_FOLDER / "arm.toml"), holdout=logs[1])


@pytest.fixture(scope="module")
def beside_an_offset() -> Diagnosis:
    """A stop that only the holdout meets, and an offset that both logs show."""
    return diagnosed(reaching(0.5, Effect("torque_offset", 1, {"offset": 1.0})))


def test_what_only_the_holdout_shows_is_named(beside_an_offset):
    causes = {(c.effect, c.joint): c for c in beside_an_offset.causes}
    assert set(causes) == {("contact", 2), ("torque_offset", 1)}
    assert all(c.probability > 0.95 for c in causes.values())
    assert causes["contact", 2].parameters["stiffness"].value == pytest.approx(40.0, rel=0.01)
    assert causes["torque_offset", 1].parameters["offset"].value == pytest.approx(1.0, rel=0.01)


def test_it_is_said_that_the_logs_were_cut():
    """A spring whose torque grows with the third power hardly acts in the training log, and no pushes can take its place."""
    arm = Arm.read(CASE_FOLDER / "arm.toml")
    t = np.arange(2400) * arm.sample_period
    spring = Effect("hardening_spring", 2, {"cubic": 5.0, "k": 0.0, "q0": 0.0})
    result = diagnosed(
        [
            simulate(arm, t, scale * sines(t, seed), effects=[spring], noise=NOISE_RAD, seed=seed, tolerance=1e-6)
            for seed, scale in ((1, 0.15), (2, 1.0))
        ]
    )
    assert [(c.effect, c.joint) for c in result.causes] == [("hardening_spring", 2)]
    assert any(r.startswith(CROSSWISE) for r in result.remarks)
    assert CROSSWISE in render_html(result)


def test_where_the_training_logs_show_it_nothing_is_cut():
    result = diagnosed(reaching(0.5, gently=False))
    assert [(c.effect, c.joint) for c in result.causes] == [("contact", 2)]
    assert not any(r.startswith(CROSSWISE) for r in result.remarks)


@pytest.mark.parametrize(("stop", "stiffness"), [(0.8, 8.0), (0.7, 8.0), (0.9, 5.0)])
def test_a_stop_met_by_the_holdout_alone_is_not_taken_for_pushes(stop, stiffness):
    """Beside a spring on the other joint nothing but the few hits was left, which pushes explain as well."""
    result = diagnosed(reaching(stop, Effect("joint_spring", 1, {"k": stiffness, "q0": 0.2})))
    causes = {(c.effect, c.joint): c for c in result.causes}
    assert set(causes) == {("joint_spring", 1), ("contact", 2)}
    assert all(c.probability > 0.9 for c in causes.values())
    assert causes["contact", 2].parameters["position"].value == pytest.approx(stop, rel=1e-3)
    assert causes["contact", 2].parameters["stiffness"].value == pytest.approx(40.0, rel=0.01)
