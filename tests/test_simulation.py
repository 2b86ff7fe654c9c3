"""Simulation: the paper's torques, effects by name, the encoder, and what is refused."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from armgap import Arm, _native, effects, seed_torque, simulate
from armgap.errors import OptionError
from armgap.simulation import Effect

FORMATS = [
    "coulomb_asymmetry",
    "torque_offset",
    "stribeck",
    "quadratic_drag",
    "torque_gain",
    "actuator_lag",
    "actuator_delay",
    "payload",
    "base_tilt",
    "rotor_inertia",
]


def smooth(arm: Arm) -> Arm:
    """The arm without dry friction and encoder."""
    theta = arm.theta.copy()
    theta[-arm.n_joints :] = 0
    return dataclasses.replace(arm, theta=theta, counts_per_rev=None)


def test_seed_torque_at_start_and_late():
    # Equations (31) and (32) by hand; late, the ramps have reached 29 and 1.2 N m.
    start = [68 * np.sin(0.1) + 9 * np.sin(0.15), 8 * np.sin(0.08) + 2 * np.sin(0.34)]
    np.testing.assert_allclose(seed_torque([0.0])[0], start)
    t = np.linspace(100, 100 + 2 * np.pi, 200001)[:-1]  # a whole number of periods of every sine
    np.testing.assert_allclose(seed_torque(t).mean(axis=0), [29.0, 1.2], atol=1e-3)


def test_pendulum_swings_with_its_period(tmp_path):
    """Small swings of I ddq + m g l sin q = 0 have the angular frequency sqrt(m g l / I)."""
    arm = Arm("p", "pendulum", 9.81, 1e-3, np.array([0.5, 8.0, 0.0, 0.0]), np.ones(4))
    t = np.arange(4000) * 1e-3
    log = simulate(arm, t, np.zeros(len(t)), q0=[1e-3])
    np.testing.assert_allclose(log.q[:, 0], 1e-3 * np.cos(4.0 * t), atol=1e-8)


def test_held_still_below_the_coulomb_level(arm):
    t = np.arange(400) * arm.sample_period
    below = np.tile(0.9 * arm.theta[-2:], (len(t), 1))
    np.testing.assert_array_equal(simulate(arm, t, below).q, 0.0)
    assert np.abs(simulate(arm, t, 1.5 * below).q[-1]).max() > 1e-3


def test_energy_taken_up_equals_work_done(arm):
    """Without friction the energy of the arm is the work of its torques at every sample."""
    free = smooth(arm)
    theta = free.theta.copy()
    theta[5:] = 0
    free = dataclasses.replace(free, theta=theta)
    t = np.arange(4000) * 2.5e-4
    log = simulate(free, t, seed_torque(t), sensor=True)
    q, dq = log.q, log.dq
    assert dq is not None
    c1, c12, c2 = np.cos(q[:, 0]), np.cos(q.sum(axis=1)), np.cos(q[:, 1])
    th = theta
    kinetic = 0.5 * th[0] * dq[:, 0] ** 2 + th[1] * c2 * dq[:, 0] * dq.sum(axis=1)
    kinetic += th[2] * dq[:, 1] * (dq[:, 0] + 0.5 * dq[:, 1])
    energy = kinetic + th[3] * (1 - c1) + th[4] * (1 - c12)
    work = np.concatenate([[0.0], np.cumsum((log.tau[:-1] * np.diff(q, axis=0)).sum(axis=1))])
    np.testing.assert_allclose(energy, work, atol=1e-7 * np.abs(work).max())


def test_positions_are_whole_encoder_counts(arm, seed_log):
    counts = seed_log.q / arm.encoder_step
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    fine = simulate(arm, seed_log.t, seed_log.tau, encoder=False)
    assert 0.4 < np.max(np.abs(fine.q - seed_log.q) / arm.encoder_step) <= 0.5 + 1e-9


def test_noise_has_its_size_and_seed(arm, seed_log):
    a, b, c = (simulate(arm, seed_log.t, seed_log.tau, encoder=False, noise=1e-4, seed=s).q for s in (1, 1, 2))
    clean = simulate(arm, seed_log.t, seed_log.tau, encoder=False).q
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a, c)
    # 1600 values: their standard deviation is within 10 % at more than five sigma.
    assert (a - clean).std() == pytest.approx(1e-4, rel=0.1)


def test_asymmetric_friction_is_an_offset_while_the_joint_moves(arm):
    """The known identity: friction fc + delta forwards and fc - delta backwards resists like an offset of -delta."""
    t = np.arange(200) * arm.sample_period
    tau = np.tile([60.0, 0.0], (len(t), 1))
    asymmetric = simulate(arm, t, tau, effects=[Effect("coulomb_asymmetry", 1, {"delta": 0.44})], encoder=False)
    offset = simulate(arm, t, tau, effects=[Effect("torque_offset", 1, {"offset": -0.44})], encoder=False)
    assert (np.diff(asymmetric.q[:, 0]) > 0).all()
    np.testing.assert_allclose(asymmetric.q, offset.q, atol=1e-8)


#: Motors that swing on a shaft of a real arm's stiffness, and play of a real gear.
STIFF = {
    "joint_elasticity": {"stiffness": 5e3, "damping": 5.0, "rotor_inertia": 0.1},
    "backlash": {"gap": 2e-3, "rotor_share": 0.1, "riding": 1.0},
}


def test_effects_of_the_format_exist_and_each_changes_the_motion(arm, seed_log):
    known = {e["name"]: e for e in effects()}
    assert set(FORMATS) <= set(known)
    arm = dataclasses.replace(arm, link_length=np.array([0.45, 0.3]))
    plain = simulate(arm, seed_log.t, seed_log.tau, encoder=False).q
    for name, effect in known.items():
        values = {p["name"]: _typical(p) for p in effect["parameters"]} | STIFF.get(name, {})
        joint = 1 if effect["scope"] == "joint" else None
        changed = simulate(
            arm, seed_log.t, seed_log.tau, effects=[Effect(name, joint, values)], encoder=False, tolerance=1e-6
        ).q
        assert np.abs(changed - plain).max() > 1e-5, name


def _typical(parameter: dict[str, float]) -> float:
    """A value away from the neutral one and inside the bounds; thresholds that are never reached come within reach."""
    neutral, upper = parameter["neutral"], parameter["upper"]
    if neutral > 1e6:
        return 0.05
    return max(parameter["lower"], neutral + min(0.05, 0.5 * (upper - neutral)))


@pytest.mark.parametrize(
    ("text", "effect"),
    [
        ("stribeck:2:amplitude=0.5,velocity=0.2", Effect("stribeck", 2, {"amplitude": 0.5, "velocity": 0.2})),
        ("base_tilt::angle=-3e-2", Effect("base_tilt", None, {"angle": -0.03})),
        (" torque_gain:1: gain = 0.9 ", Effect("torque_gain", 1, {"gain": 0.9})),
    ],
)
def test_effects_are_read_from_the_command_line(text, effect):
    assert Effect.parse(text) == effect


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"tau": np.zeros((10, 3))}, "tau"),
        ({"t": np.zeros(10)}, "increase"),
        ({"q0": [0.0]}, "q0"),
        ({"noise": -1.0}, "noise"),
        ({"tau": np.full((10, 2), np.nan)}, "finite"),
    ],
)
def test_what_cannot_be_simulated_is_refused(change, says, arm):
    arguments = {"t": np.arange(10) * 0.01, "tau": np.zeros((10, 2))} | change
    with pytest.raises(OptionError, match=says):
        simulate(arm, **arguments)


def test_the_seed_torques_of_ten_seconds_are_simulated_by_default(tmp_path):
    """Dry friction that sticks and slides leaves 1.5e-9 rad at the smallest steps, more than the tolerance of a second."""
    path = tmp_path / "arm.toml"
    path.write_text(
        'kind = "two-link"\nsample_period = 0.002\n[inertial]\ntheta = [1.3254, 0.3, 0.165, 27.6642, 5.886]\n'
        "[friction]\nviscous = [1.0, 0.4]\ncoulomb = [3.0, 1.0]\n"
    )
    arm = Arm.read(path)
    t = np.arange(5000) * arm.sample_period
    assert len(simulate(arm, t, seed_torque(t))) == 5000
    with pytest.raises(
        OptionError, match=r"steps are halved; allow more with tolerance \(--tolerance\), which is 1e-12"
    ):
        simulate(arm, t, seed_torque(t), tolerance=1e-12)
    with pytest.raises(OptionError, match="tolerance"):
        simulate(arm, t, seed_torque(t), tolerance=0.0)


def windowed(
    effects_: list[tuple[str, int | None, dict[str, float]]], **options: object
) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Two overlapping windows of a double arm's motion, from different starts."""
    theta, t, tau, starts = double_motion()
    rows = [(0, 61), (40, 101)]
    return _native.simulate_windows(
        "two-link", 9.81, [1.0, 1.0], theta, t, tau, rows, 51, starts, -starts, effects_, 1e-7, [], **options
    )


def double_motion() -> tuple[list[float], np.ndarray, np.ndarray, np.ndarray]:
    """Parameters, times, torques, and two starts of a double arm."""
    theta = [3.0, 0.2, 0.15, 30.0, 1.0, 1.0, 0.1, 2.0, 0.5]
    t = 4e-3 * np.arange(101)
    return theta, t, np.stack([8 * np.sin(5 * t), np.cos(9 * t)], axis=1), np.array([[0.1, -0.4], [0.5, 0.2]])


def test_windows_are_simulations_from_their_own_starts():
    theta, t, tau, starts = double_motion()
    spring = ("joint_spring", 2, {"k": 3.0, "q0": 0.1})
    q, dq, substeps = windowed([spring])
    assert q.shape == dq.shape == (2, 51, 2)
    for w, rows in enumerate((slice(0, 61), slice(40, 101))):
        alone = _native.simulate(
            "two-link", 9.81, [1.0, 1.0], theta, t[rows], tau[rows], starts[w], -starts[w], [spring], 1e-7, []
        )
        np.testing.assert_array_equal(q[w], alone[0][-51:])
        np.testing.assert_array_equal(dq[w], alone[1][-51:])
    # The sub-steps that met the tolerance give the same motion within it, in one run each.
    again, _, used = windowed([spring], substeps=substeps)
    assert used == substeps
    assert 0 < np.abs(again - q).max() < 1e-7


def test_a_window_needs_samples_and_an_arm_that_is_not_too_stiff():
    stiff = ("joint_elasticity", 2, {"stiffness": 1e5, "damping": 0.0, "rotor_inertia": 1e-4})
    with pytest.raises(ValueError, match="so stiff that it needs"):
        windowed([stiff], max_substeps=32)
    theta, t, tau, starts = double_motion()
    fixed = ("two-link", 9.81, [1.0, 1.0], theta, t, tau)
    with pytest.raises(ValueError, match="`rows` needs windows of 51"):
        _native.simulate_windows(*fixed, [(0, 50), (0, 102)], 51, starts, starts, [])
    with pytest.raises(ValueError, match="`substeps` needs 2 values"):
        windowed([], substeps=[1])
    with pytest.raises(ValueError, match="`theta` needs 9 values"):
        _native.simulate_windows(
            "two-link", 9.81, [1.0, 1.0], theta[:3], t, tau, [(0, 51)], 51, starts[:1], starts[:1], []
        )
