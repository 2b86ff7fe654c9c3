"""The online estimator from Python: the same numbers as `identify`, sample by sample or over arrays."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import armgap
from armgap import Arm, Estimator, Log, identify
from armgap.errors import OptionError

SCHEMES = ("filtered-dynamic", "supplied-energy", "filtered-power")

# Times and periods differ in the last digits of the clock.
CLOCK = 1e-9


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("filters", ["paper", "exact"])
def test_same_numbers_as_a_whole_log(arm: Arm, seed_log: Log, scheme: str, filters: str):
    whole = identify(seed_log, arm, scheme=scheme, filters=filters, velocity="midpoint")
    run = Estimator(arm, scheme=scheme, filters=filters).run(seed_log.q, seed_log.tau, t=seed_log.t)
    np.testing.assert_array_equal(run.theta, whole.history)


def test_one_by_one_is_all_at_once(arm: Arm, seed_log: Log):
    one, all_at_once = Estimator(arm), Estimator(arm)
    outcomes = [one.update(q, tau, h=0.0025) for q, tau in zip(seed_log.q, seed_log.tau, strict=True)]
    run = all_at_once.run(seed_log.q, seed_log.tau, h=0.0025)
    np.testing.assert_array_equal(one.theta, run.theta[-1])
    np.testing.assert_array_equal(one.sigma, all_at_once.sigma)
    assert outcomes == [armgap.estimation.estimator.OUTCOMES[k] for k in run.outcome]
    assert outcomes[:3] == ["starting", "starting", "updated"]
    assert (one.updates, one.rejected) == (len(seed_log.t) - 2, 0)


def test_periods_and_times_agree(arm: Arm, seed_log: Log):
    by_time = Estimator(arm).run(seed_log.q, seed_log.tau, t=seed_log.t).theta[-1]
    by_period = Estimator(arm).run(seed_log.q, seed_log.tau, h=0.0025).theta[-1]
    np.testing.assert_allclose(by_time, by_period, rtol=CLOCK)


def test_sensor_velocities_and_asymmetry(arm: Arm, seed_log: Log):
    estimator = Estimator(arm, asymmetry=True, scheme="filtered-dynamic")
    estimator.run(seed_log.q, seed_log.tau, seed_log.dq, h=0.0025)
    assert estimator.parameter_names[-2:] == ("asymmetry1", "asymmetry2")
    np.testing.assert_allclose(estimator.theta[:9], arm.theta, rtol=0.02)
    assert np.abs(estimator.theta[9:]).max() < 0.05
    assert estimator.errors.shape == (2,)
    assert estimator.update(seed_log.q[0], seed_log.tau[0], h=0.0025) == "rejected"


@pytest.mark.parametrize("form", ["plain", "factorized"])
@pytest.mark.parametrize("single", [False, True])
def test_forms_and_precisions(arm: Arm, seed_log: Log, form, single: bool):
    reference = Estimator(arm).run(seed_log.q, seed_log.tau, h=0.0025).theta[-1]
    theta = Estimator(arm, form=form, single=single).run(seed_log.q, seed_log.tau, h=0.0025).theta[-1]
    np.testing.assert_allclose(theta, reference, rtol=0.02 if single else CLOCK)


def test_bad_samples_are_rejected_and_counted(arm: Arm, seed_log: Log):
    estimator = Estimator(arm)
    estimator.run(seed_log.q[:100], seed_log.tau[:100], h=0.0025)
    before = estimator.theta
    assert estimator.update([np.nan, 0.0], [0.0, 0.0], h=0.0025) == "rejected"
    assert estimator.update([0.0, 0.0], [0.0, np.inf], h=0.0025) == "rejected"
    assert estimator.update([0.0, 0.0], [0.0, 0.0], h=-1.0) == "rejected"
    np.testing.assert_array_equal(estimator.theta, before)
    assert estimator.rejected == 3


def test_a_copy_goes_its_own_way(arm: Arm, seed_log: Log):
    estimator = Estimator(arm)
    estimator.run(seed_log.q[:400], seed_log.tau[:400], h=0.0025)
    twin = estimator.copy()
    np.testing.assert_array_equal(twin.theta, estimator.theta)
    twin.run(seed_log.q[400:], seed_log.tau[400:], h=0.0025)
    assert not np.array_equal(twin.theta, estimator.theta)
    assert twin.parameter_names == estimator.parameter_names


def test_excitation_and_alarm(arm: Arm, seed_log: Log):
    # While the arm is held still nothing is learned; when its torque changes without a motion, the alarm goes off.
    estimator = Estimator(arm, scheme="filtered-dynamic", settling=300, learning=400, floor=0.1, forgetting=0.999)
    estimator.run(seed_log.q, seed_log.tau, h=0.0025)
    moving = estimator.excitation
    assert estimator.alarm < 1
    still = np.repeat(seed_log.q[-1:], 3000, axis=0)
    torque = np.repeat(seed_log.tau[-1:], 3000, axis=0)
    estimator.run(still, torque + np.array([20.0, 4.0]), h=0.0025)
    assert estimator.excitation < 0.5 * moving
    push = estimator.run(still[:40], torque[:40] + np.array([60.0, 9.0]), h=0.0025)
    assert (push.outcome == 0).all()
    assert estimator.alarm > 1


def test_other_threads_go_on_meanwhile(arm: Arm, seed_log: Log):
    q, tau = np.tile(seed_log.q, (200, 1)), np.tile(seed_log.tau, (200, 1))
    done = threading.Event()
    worker = threading.Thread(target=lambda: (Estimator(arm).run(q, tau, h=0.0025), done.set()))
    worker.start()
    turns = 0
    while not done.is_set():
        turns += 1
    worker.join()
    assert turns > 0


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"scheme": "power"}, "scheme"),
        ({"filters": "none"}, "filters"),
        ({"form": "square-root"}, "form"),
        ({"cutoff": 0.0}, "cutoff"),
        ({"cutoff": np.nan}, "cutoff"),
        ({"forgetting": 1.01}, "forgetting"),
        ({"p0": -1.0}, "p0"),
        ({"theta0": [1.0, 2.0]}, "theta0"),
        ({"learning": 1}, "learning"),
        ({"settling": -1}, "settling"),
        ({"between": 1.0}, "between"),
        ({"memory": 0.5}, "memory"),
        ({"floor": -1.0}, "floor"),
    ],
)
def test_impossible_options(options, word: str):
    with pytest.raises(OptionError, match=word):
        Estimator("two-link", **options)


def test_impossible_samples():
    estimator = Estimator("two-link")
    with pytest.raises(OptionError, match="arm"):
        Estimator("snake")
    with pytest.raises(OptionError, match="`t` or `h`"):
        estimator.update([0, 0], [0, 0])
    with pytest.raises(OptionError, match="`q`"):
        estimator.update([0], [0, 0], h=0.1)
    with pytest.raises(OptionError, match="`tau`"):
        estimator.run(np.zeros((5, 2)), np.zeros((4, 2)), h=0.1)
    with pytest.raises(OptionError, match="`t` has shape"):
        estimator.run(np.zeros((5, 2)), np.zeros((5, 2)), t=0.1)
