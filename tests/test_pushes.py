"""Smooth, long pushes on an arm whose model leaves several effects out: found beside that remainder, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from armgap import Arm, Diagnosis, Log, diagnose, simulate
from armgap.cli.demo import CASE_FOLDER
from armgap.simulation import Effect
from swings import off, sines

REAL = np.array([0.105, 0.031, 0.049, 2.1, 1.5, 0.004, 0.004, 0.2, 0.15])
SIGMA = np.array([0.011, 0.004, 0.005, 0.23, 0.16, 0.01, 0.01, 0.08, 0.06])
OFF = np.array([0.5, -0.5, 0.4, 0.7, -0.4, -0.3, 0.3, 0.6, -0.6])  # of a sigma
TRUE = Arm("double pendulum", "two-link", 9.81, 0.002, REAL, sigma=SIGMA)
ARM = replace(TRUE, theta=REAL + OFF * SIGMA)
UNMODELLED = [
    Effect("rotor_inertia", 2, {"inertia": 0.003}),
    Effect("stribeck", 1, {"amplitude": 0.05, "velocity": 0.3}),
    Effect("torque_ripple", 1, {"amplitude": 0.06, "n": 6.0, "phase": 0.3}),
    Effect("torque_ripple", 2, {"amplitude": 0.05, "n": 6.0, "phase": 1.0}),
    Effect("actuator_delay", 2, {"delay": 0.004}),
]
PUSHES = ((1, 2.6, 0.1, 0.75), (2, 5.4, 0.09, -0.65))  # joint, centre s, standard deviation s, height N m


def bells(t: NDArray[np.float64]) -> NDArray[np.float64]:
    push = np.zeros((len(t), 2))
    for joint, centre, width, height in PUSHES:
        push[:, joint - 1] += height * np.exp(-0.5 * ((t - centre) / width) ** 2)
    return push


def run(seed: int, *, pushed: bool) -> Log:
    """Eight seconds of a multisine; the log holds the torque without the pushes."""
    t = np.arange(4000) * TRUE.sample_period
    draw = np.random.default_rng(seed).uniform(size=(3, 2, 5))
    phase = np.multiply.outer(t, 2.0 + 8.0 * draw[1]) + 2 * np.pi * draw[2]
    tau = ((0.15 + 0.25 * draw[0]) * np.sin(phase)).sum(axis=2)
    given = tau + bells(t) if pushed else tau
    log = simulate(TRUE, t, given, effects=UNMODELLED, noise=1e-4, seed=seed, name="log")
    return replace(log, tau=tau)


def judged(log: Log) -> Diagnosis:
    """What is found with no cause allowed: pushes, as candidates."""
    return diagnose(log, ARM, max_causes=0)


@pytest.fixture(scope="module")
def pushed() -> list[Diagnosis]:
    return [judged(run(seed, pushed=True)) for seed in (3, 4, 5)]


def test_pushes_are_found_on_their_joint_at_their_time(pushed: list[Diagnosis]) -> None:
    """All but one of six, none elsewhere."""
    heights = {joint: height * width * np.sqrt(2 * np.pi) for joint, _, width, height in PUSHES}
    centres = {joint: centre for joint, centre, *_ in PUSHES}
    assert sum(len(found.candidates) for found in pushed) >= 5
    for found in pushed:
        assert {c.effect for c in found.candidates} == {"external_pulse"}
        assert len({c.joint for c in found.candidates}) == len(found.candidates)
        for push in found.candidates:
            assert push.parameters["time"].value == pytest.approx(centres[push.joint], abs=0.1)
            assert push.parameters["impulse"].value == pytest.approx(heights[push.joint], rel=0.35)


def test_a_push_beside_a_remainder_keeps_some_doubt_and_belongs_to_its_log(pushed: list[Diagnosis]) -> None:
    """The gap that stays casts its doubt on every push, less on one far above the other pulses of its log."""
    for cause in (cause for found in pushed for cause in found.candidates):
        assert cause.log == "log"
        assert 0.4 < cause.probability < 0.95


def test_the_same_motion_without_pushes_shows_none() -> None:
    found = judged(run(3, pushed=False))
    assert found.causes == found.candidates == ()
    assert found.verdict == "unexplained"


def test_an_end_that_is_met_again_and_again_is_no_push() -> None:
    """A joint that hits something at one end of its travel: named as several pushes if each is looked at alone."""
    free = run(4, pushed=False)
    stop = {"position": float(np.quantile(free.q[:, 0], 0.9)), "stiffness": 60.0, "damping": 0.1}
    met = [*UNMODELLED, Effect("contact", 1, stop)]
    log = simulate(TRUE, free.t, free.tau, effects=met, noise=1e-4, seed=4, name="log", tolerance=1e-5)
    assert judged(replace(log, tau=free.tau)).candidates == ()


def limited(arm: Arm, reached_in: str, *pushes: Effect) -> tuple[Diagnosis, float]:
    """A limit of joint 2's torque that one log of two reaches once or twice, with `pushes` in that log; and its level [N m]."""
    t = np.arange(3000) * arm.sample_period
    strong, weak = sines(t, 21), 0.7 * sines(t, 22)
    level = 0.85 * np.abs(strong[:, 1]).max()
    assert level > np.abs(weak[:, 1]).max()
    limit = Effect("torque_saturation", 2, {"level": level})
    reaches = simulate(off(arm), t, strong, effects=[limit, *pushes], noise=1e-5, seed=0)
    other = simulate(off(arm), t, weak, effects=[limit], noise=1e-5, seed=1)
    training, holdout = (reaches, other) if reached_in == "training" else (other, reaches)
    trusted = replace(arm, sigma=arm.theta * np.repeat([0.05, 0.2], [5, 4]))
    return diagnose(training, trusted, holdout=holdout), level


@pytest.mark.parametrize("reached_in", ["training", "holdout"])
def test_a_limit_that_one_log_reaches_once_or_twice_is_not_taken_for_pushes(arm: Arm, reached_in: str) -> None:
    found, level = limited(arm, reached_in)
    [cause] = found.causes
    assert (cause.effect, cause.joint) == ("torque_saturation", 2)
    assert cause.parameters["level"].value == pytest.approx(level, rel=1e-3)
    assert cause.parameters["level"].sigma < 1e-3 * level


@pytest.mark.parametrize("reached_in", ["training", "holdout"])
def test_such_a_limit_is_named_beside_a_push(arm: Arm, reached_in: str) -> None:
    push = Effect("external_pulse", 1, {"impulse": 1.5, "time": 3.0, "duration": 0.06})
    found, level = limited(arm, reached_in, push)
    causes = {(c.effect, c.joint): c.parameters for c in found.causes}
    assert set(causes) == {("torque_saturation", 2), ("external_pulse", 1)}
    assert causes["torque_saturation", 2]["level"].value == pytest.approx(level, rel=1e-3)
    assert causes["external_pulse", 1]["impulse"].value == pytest.approx(1.5, rel=1e-2)


@pytest.mark.parametrize("joint", [1, 2])
def test_a_push_back_from_the_end_of_the_travel_is_no_stop(arm: Arm, joint: int) -> None:
    """Where the joint comes farthest in any log, so that no other motion contradicts a stop; only the form of the push does."""
    t = np.arange(3000) * arm.sample_period
    other, torque = (
        simulate(arm, t, scale * sines(t, seed), noise=1e-5, seed=seed) for seed, scale in ((21, 0.7), (22, 1.0))
    )
    k = int(np.argmax(torque.q[:, joint - 1]))
    assert torque.q[k, joint - 1] > max(0.0, other.q[:, joint - 1].max())
    push = Effect("external_pulse", joint, {"impulse": -0.5, "time": float(t[k]), "duration": 0.06})
    pushed = simulate(arm, t, sines(t, 22), effects=[push], noise=1e-5, seed=22)
    [cause] = diagnose(other, arm, holdout=pushed).causes
    assert (cause.effect, cause.joint) == ("external_pulse", joint)
    assert cause.probability > 0.9


def test_values_of_one_log_that_differ_are_not_taken_for_pushes(arm: Arm) -> None:
    """Friction that grew between two logs."""
    t = np.arange(3000) * arm.sample_period
    grown = replace(arm, theta=arm.theta * np.r_[np.ones(len(arm.theta) - 4), np.full(4, 1.3)])
    training = simulate(arm, t, sines(t, 13), noise=1e-5, seed=1)
    holdout = simulate(grown, t, sines(t, 14), noise=1e-5, seed=2)
    assert "external_pulse" not in {c.effect for c in diagnose(training, arm, holdout=holdout).causes}


@pytest.mark.parametrize(("joint", "impulse"), [(1, 0.05), (2, 0.02)])
def test_a_push_too_light_for_the_residual_torque_is_found_in_the_window_it_moves(joint: int, impulse: float) -> None:
    """Lost in the noise of accelerations, and of no consequence to the whole log; predictions of one window miss by it."""
    arm = Arm.read(CASE_FOLDER / "arm.toml")
    t = np.arange(2400) * arm.sample_period
    push = Effect("external_pulse", joint, {"impulse": impulse, "time": 3.3, "duration": 0.07})
    training, holdout = (
        simulate(arm, t, sines(t, seed), effects=effects, noise=1e-5, seed=seed, name=f"run {seed}")
        for seed, effects in ((1, [push]), (2, []))
    )
    [cause] = diagnose(training, arm, holdout=holdout).causes
    assert (cause.effect, cause.joint, cause.log) == ("external_pulse", joint, "run 1")
    assert cause.probability > 0.9
    for name, value in push.parameters.items():
        estimate = cause.parameters[name]
        assert abs(estimate.value - value) < 3.0 * estimate.sigma
        assert estimate.value == pytest.approx(value, rel=0.03)


def test_a_hit_of_two_samples_is_a_push_on_an_arm_without_impacts() -> None:
    arm = Arm.read(CASE_FOLDER / "arm.toml")
    t = np.arange(2400) * arm.sample_period
    hit = Effect("external_pulse", 2, {"impulse": 0.05, "time": 3.3, "duration": 0.004})
    training, holdout = (
        simulate(arm, t, sines(t, seed), effects=effects, noise=1e-5, seed=seed)
        for seed, effects in ((1, [hit]), (2, []))
    )
    [cause] = diagnose(training, arm, holdout=holdout).causes
    assert (cause.effect, cause.joint) == ("external_pulse", 2)
    assert cause.parameters["impulse"].value == pytest.approx(0.05, rel=0.02)
    assert cause.parameters["time"].value == pytest.approx(3.3, abs=2e-3)
