"""Identification: an independent implementation of the paper's schemes, the exact variant against the truth, and laws of the estimator."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter, savgol_filter

from armgap import Arm, Log, identify, seed_torque, simulate
from armgap.errors import ColumnError, OptionError
from armgap.estimation.identification import SCHEMES, velocity
from armgap.simulation import Effect

CUTOFF_RAD_S = 50.0
P0 = 1000.0
# Joint 1 of Table I: 7.17 N m forward, 8.049 N m backward.
ASYMMETRY = Effect("coulomb_asymmetry", 1, {"delta": (7.17 - 8.049) / 2})

Array = NDArray[np.float64]


def seed_run(arm: Arm, t: Array | None = None, *, real: bool) -> Log:
    """The paper's run; `real` adds the asymmetric friction and the encoder counts."""
    t = np.arange(4000) * arm.sample_period if t is None else t
    effects = [ASYMMETRY] if real else []
    return simulate(arm, t, seed_torque(t), effects=effects, encoder=real, sensor=True, name="seed")


@pytest.fixture(scope="module")
def ideal(arm: Arm) -> Log:
    return seed_run(arm, real=False)


@pytest.fixture(scope="module")
def real(arm: Arm) -> Log:
    return seed_run(arm, real=True)


def deviation(arm: Arm, log: Log, **options: object) -> Array:
    """Relative deviation of the arm's own parameters from the truth."""
    found = identify(log, arm, **options)  # type: ignore[arg-type]
    return found.theta[: len(arm.theta)] / arm.theta - 1


# The paper's pair, section 5.1, as an independent filter routine applies it.


def low(x: Array, h: float) -> Array:
    a = np.exp(-h * CUTOFF_RAD_S)
    return lfilter([0.0, 1 - a], [1.0, -a], x)


def high(x: Array, h: float) -> Array:
    return lfilter([CUTOFF_RAD_S, -CUTOFF_RAD_S], [1.0, -np.exp(-h * CUTOFF_RAD_S)], x - x[0])


def paper_rows(log: Log, dq: Array, scheme: str) -> tuple[Array, Array]:
    """Regressors and outputs of section 5, written out term by term: rows of shape (n_errors, 9)."""
    h = log.sample_period
    (q1, q2), (v1, v2), (tau1, tau2) = log.q.T, dq.T, log.tau.T
    energy = [v1**2 / 2, np.cos(q2) * v1 * (v1 + v2), v2 * (v1 + v2 / 2), 1 - np.cos(q1), 1 - np.cos(q1 + q2)]
    lost = [v1**2, v2**2, np.abs(v1), np.abs(v2)]
    power = tau1 * v1 + tau2 * v2
    if scheme == "filtered-power":
        return np.column_stack([*(high(e, h) for e in energy), *(low(w, h) for w in lost)]), low(power, h)
    if scheme == "supplied-energy":
        integrals = [np.concatenate([[0.0], np.cumsum(x[1:] + x[:-1]) * h / 2]) for x in (*lost, power)]
        return np.column_stack([*(e - e[0] for e in energy), *integrals[:4]]), integrals[4]
    zero = np.zeros_like(q1)
    swing = low(np.sin(q1 + q2), h)
    first = [high(v1, h), high(np.cos(q2) * (2 * v1 + v2), h), high(v2, h), low(np.sin(q1), h), swing]
    first += [low(v1, h), zero, low(np.sign(v1), h), zero]
    mixed = high(np.cos(q2) * v1, h) + low(np.sin(q2) * v1 * (v1 + v2), h)
    second = [zero, mixed, high(v1 + v2, h), zero, swing, zero, low(v2, h), zero, low(np.sign(v2), h)]
    psi = np.stack([np.column_stack(first), np.column_stack(second)], axis=1)
    return psi.reshape(-1, 9), np.column_stack([low(tau1, h), low(tau2, h)]).ravel()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_papers_schemes_against_equations_written_out(arm: Arm, real: Log, scheme: str) -> None:
    dq = np.vstack([np.zeros(2), np.diff(real.q, axis=0) / np.diff(real.t)[:, None]])
    psi, y = paper_rows(real, dq, scheme)
    expected = np.linalg.solve(psi.T @ psi + np.eye(9) / P0, psi.T @ y)
    found = identify(real, arm, scheme=scheme, filters="paper", velocity="backward", cutoff=CUTOFF_RAD_S, p0=P0)
    assert found.theta == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("velocities", ["central", "midpoint", "sensor"])
def test_exact_filters_good_velocities_and_asymmetry_give_all_nine(
    arm: Arm, real: Log, scheme: str, velocities: str
) -> None:
    found = identify(real, arm, scheme=scheme, filters="exact", velocity=velocities, asymmetry=True)
    assert np.abs(found.theta[:9] / arm.theta - 1).max() < 0.01
    assert found.theta[9] == pytest.approx(ASYMMETRY.parameters["delta"], abs=0.03)
    assert abs(found.theta[10]) < 0.02


def test_papers_filters_bias_what_passes_the_derivative(arm: Arm, ideal: Log) -> None:
    for velocities in ("backward", "sensor"):
        options = {"filters": "paper", "velocity": velocities, "cutoff": CUTOFF_RAD_S}
        dynamic = deviation(arm, ideal, scheme="filtered-dynamic", **options)
        power = deviation(arm, ideal, scheme="filtered-power", **options)
        assert -0.065 < dynamic[0] < -0.05
        assert (1 + power[3]) / (1 + dynamic[3]) == pytest.approx(0.940, abs=0.005)
    wide = deviation(arm, ideal, scheme="filtered-dynamic", filters="paper", velocity="sensor", cutoff=100 * np.pi)
    assert wide[0] == pytest.approx(-0.30, abs=0.01)


@pytest.mark.parametrize("cutoff", [50.0, 314.0])
@pytest.mark.parametrize("scheme", ["filtered-dynamic", "filtered-power"])
def test_exact_filters_leave_inertias_within_three_per_mille(arm: Arm, ideal: Log, scheme: str, cutoff: float) -> None:
    off = deviation(arm, ideal, scheme=scheme, filters="exact", velocity="sensor", cutoff=cutoff)
    assert np.abs(off[:3]).max() < 0.003


def test_backward_differences_cost_viscous_friction_and_central_ones_do_not(arm: Arm, ideal: Log) -> None:
    late = deviation(arm, ideal, scheme="filtered-dynamic", filters="exact", velocity="backward")
    good = deviation(arm, ideal, scheme="filtered-dynamic", filters="exact", velocity="central")
    online = deviation(arm, ideal, scheme="filtered-dynamic", filters="exact", velocity="midpoint")
    assert late[5] == pytest.approx(-0.29, abs=0.02)
    assert late[6] == pytest.approx(-0.19, abs=0.02)
    assert np.abs(good[5:7]).max() < 0.01
    assert np.abs(online[5:7]).max() < 0.01


def test_asymmetric_friction_passes_for_gravity_unless_it_is_in_the_model(arm: Arm, real: Log) -> None:
    options = {"scheme": "filtered-dynamic", "filters": "exact", "velocity": "central"}
    assert deviation(arm, real, **options)[3] == pytest.approx(-0.016, abs=0.002)
    assert abs(deviation(arm, real, asymmetry=True, **options)[3]) < 0.002


def test_slow_torque_noise_moves_the_integrals_more_than_the_filters(arm: Arm, real: Log) -> None:
    # Torque noise of about 1 Hz, 3 % of the amplitude of the torques. Median over the draws: single ones scatter.
    def moved(scheme: str, seed: int) -> Array:
        rng = np.random.default_rng(seed)
        wander = lfilter(
            [1.0], [1.0, -np.exp(-2 * np.pi * real.sample_period)], rng.standard_normal(real.tau.shape), axis=0
        )
        tau = real.tau + wander / wander.std(axis=0) * np.array([2.0, 0.2])
        noisy = simulate(arm, real.t, tau, effects=[ASYMMETRY])
        log = dataclasses.replace(real, q=noisy.q, dq=None)
        history = identify(log, arm, scheme=scheme, filters="paper").history[1200:, 4:9]
        return np.ptp(history, axis=0) / arm.theta[4:]

    ratio = np.median([moved("supplied-energy", s) / moved("filtered-power", s) for s in range(9)], axis=0)
    assert ratio.min() > 1.5, ratio


def test_uneven_sample_times(arm: Arm) -> None:
    h = arm.sample_period * np.random.default_rng(5).uniform(0.5, 1.5, 4000)
    log = seed_run(arm, np.cumsum(h), real=True)
    for velocities in ("midpoint", "central"):
        found = identify(log, arm, scheme="filtered-dynamic", velocity=velocities, asymmetry=True)
        assert np.abs(found.theta[:9] / arm.theta - 1).max() < 0.01


@pytest.mark.parametrize("velocities", ["midpoint", "backward"])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_estimate_is_causal(arm: Arm, real: Log, scheme: str, velocities: str) -> None:
    part = dataclasses.replace(real, t=real.t[:300], q=real.q[:300], tau=real.tau[:300], dq=None)
    whole = identify(real, arm, scheme=scheme, velocity=velocities)
    assert np.array_equal(identify(part, arm, scheme=scheme, velocity=velocities).history, whole.history[:300])


@pytest.mark.parametrize(
    ("kind", "theta", "swing"),
    [("axis", (12.0, 0.0, 30.0, 8.0), 40.0), ("pendulum", (0.1, 3.0, 0.05, 0.2), 1.0)],
)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_arms_with_one_joint(arm: Arm, kind: str, theta: tuple[float, ...], swing: float, scheme: str) -> None:
    truth = np.array(theta)
    one = Arm(kind, kind, 9.81, 0.002, truth, 0.1 * truth + 0.01)
    t = np.arange(5000) * 0.002
    tau = swing * (np.sin(5 * t) + 0.7 * np.sin(13 * t + 1))
    log = simulate(one, t, tau)
    found = identify(log, one, scheme=scheme).theta
    assert np.abs(found - truth).max() < 0.01 * truth.max()


def test_a_trusted_start_with_a_small_covariance_stays(arm: Arm, real: Log) -> None:
    start = 1.1 * arm.theta
    kept = identify(real, arm, theta0=start, p0=1e-12)
    assert kept.theta == pytest.approx(start, rel=1e-3)


def test_forgetting_follows_a_change(arm: Arm) -> None:
    heavy = dataclasses.replace(arm, theta=arm.theta * np.array([1, 1, 1, 1, 1, 1.5, 1, 1, 1]))
    t = np.arange(4000) * arm.sample_period
    tau = seed_torque(t)
    first = simulate(arm, t[:2000], tau[:2000], encoder=False, sensor=True)
    assert first.dq is not None
    # The second half takes up where the first ends, one period later.
    bridge = simulate(arm, t[:2001], tau[:2001], encoder=False, sensor=True)
    assert bridge.dq is not None
    second = simulate(heavy, t[2000:], tau[2000:], q0=bridge.q[-1], dq0=bridge.dq[-1], encoder=False)
    log = Log.from_arrays(t, np.vstack([first.q, second.q]), tau)
    plain, fading = (identify(log, arm, scheme="filtered-dynamic", forgetting=mu) for mu in (1.0, 0.998))
    assert fading.theta[5] == pytest.approx(heavy.theta[5], rel=0.05)
    assert abs(plain.theta[5] / heavy.theta[5] - 1) > 0.1


def test_velocity_against_other_libraries(real: Log) -> None:
    t, q = real.t, real.q
    assert velocity(t, q, "central") == pytest.approx(np.gradient(q, t, axis=0), abs=1e-9)
    smooth = savgol_filter(q, 7, 3, deriv=1, delta=real.sample_period, axis=0)
    assert velocity(t, q, "local-cubic", 3)[3:-3] == pytest.approx(smooth[3:-3], abs=1e-8)
    late = velocity(t, q, "backward")
    assert (late[0] == 0).all()
    assert late[1:] == pytest.approx(np.diff(q, axis=0) / np.diff(t)[:, None], abs=1e-12)


def test_result_as_json(arm: Arm, real: Log) -> None:
    found = identify(real, arm, asymmetry=True)
    data = json.loads(found.to_json())
    assert data["schema"] == "armgap.identification/1"
    assert list(data["parameters"]) == [*arm.parameter_names, "asymmetry1", "asymmetry2"]
    assert data["parameters"]["theta4"]["value"] == found.theta[3]
    assert data["parameters"]["asymmetry1"]["unit"] == "N m"
    assert (data["updates"], data["rejected"]) == (found.updates, 0)
    assert found.history.shape == (len(real.t), 11)
    assert np.isfinite(found.sigma).all()


@pytest.mark.parametrize("scheme", ["filtered-dynamic", "filtered-power"])
def test_estimates_that_noise_biases_are_told(arm: Arm, real: Log, scheme: str) -> None:
    good = identify(real, arm, scheme=scheme, asymmetry=True)
    assert good.notes == ()
    # Velocity noise of 0.1 rad/s, as the real arm's: inertias come out low by many times their sigma.
    noise = np.random.default_rng(4).normal(0.0, 3.5e-4, real.q.shape)
    noisy = identify(dataclasses.replace(real, q=real.q + noise), arm, scheme=scheme, asymmetry=True)
    assert (noisy.theta[0] - arm.theta[0]) / noisy.sigma[0] < -5
    assert "theta1" in noisy.notes[0]
    assert json.loads(noisy.to_json())["notes"] == list(noisy.notes)


def test_the_papers_filters_are_told_by_their_dependence_on_the_cutoff(arm: Arm, ideal: Log) -> None:
    found = identify(ideal, arm, scheme="filtered-dynamic", filters="paper", velocity="sensor")
    assert found.notes[0].startswith("theta1, theta2, theta3 depend on the cut-off")
    energy = identify(ideal, arm, scheme="supplied-energy")
    assert (energy.cutoff_drift, energy.notes) == (None, ())


@pytest.mark.parametrize(
    "option",
    [
        {"scheme": "guess"},
        {"filters": "none"},
        {"velocity": "sideways"},
        {"cutoff": 0.0},
        {"cutoff": float("nan")},
        {"forgetting": 0.0},
        {"forgetting": 1.01},
        {"p0": -1.0},
        {"theta0": [1.0, 2.0]},
        {"theta0": [float("nan")] * 9},
    ],
    ids=str,
)
def test_impossible_options(arm: Arm, real: Log, option: dict[str, object]) -> None:
    with pytest.raises(OptionError, match=next(iter(option))):
        identify(real, arm, **option)  # type: ignore[arg-type]


def test_sensor_velocities_that_a_log_does_not_hold(arm: Arm, real: Log) -> None:
    with pytest.raises(ColumnError, match="dq1"):
        identify(dataclasses.replace(real, dq=None), arm, velocity="sensor")
