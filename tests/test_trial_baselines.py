"""The baselines of the blind trial: they speak the library's names, and find what is plain to see."""

from __future__ import annotations

import importlib
import sys

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="MuJoCo is missing: pip install 'armgap[trial]'")
pytest.importorskip("scipy", reason="regression baselines need scipy: pip install 'armgap[trial-baselines]'")

import armgap
from armgap import Arm, seed_torque, simulate
from armgap.simulation import Effect
from armgap.trial.baselines import BASELINES
from armgap.trial.baselines.mujoco_model import build_spec
from armgap.trial.baselines.regression import RegressionData, motion, regression_data, regressor
from armgap.trial.baselines.signatures import COUPLED, PER_ARM, PER_JOINT, ROTARY, signatures
from armgap.trial.cases.sealed import SealedCase
from armgap.trial.cases.windows import Mechanism, cut, misses
from armgap.trial.methods import methods
from armgap.trial.simulation.engine import TrialEngineMissingError

SIZES = {
    "quadratic_drag": {"c": 0.15},
    "torque_offset": {"offset": 0.4},
    "torque_dead_zone": {"level": 1.0},
}


def sealed(arm: Arm, *hidden: Effect, seconds: float = 5.0) -> SealedCase:
    logs = []
    for scale, name in ((1.0, "train-1"), (0.85, "holdout-1")):
        t = np.arange(round(seconds / 0.0025)) * 0.0025
        tau = scale * seed_torque(scale * t)
        logs.append(simulate(arm, t, tau, effects=hidden, name=name))
    return SealedCase("case-0000", arm, (logs[0],), (logs[1],))


def first(case: SealedCase, name: str) -> tuple[str, int | None] | None:
    causes = methods()[name].answer(case).causes
    return causes[0].name if causes else None


def test_signatures_are_of_the_library_and_cover_it():
    known = {e["name"] for e in armgap.effects()}
    covered = PER_JOINT.keys() | PER_ARM.keys() | {"coulomb_asymmetry"}  # the same signature as torque_offset
    assert covered == known
    assert covered >= ROTARY | COUPLED


def test_regressor_times_parameters_is_the_torque_that_was_applied(arm):
    """Y theta = tau on the arm's own simulation, wherever the joints move."""
    case = sealed(arm)
    made = regression_data(case)
    error = made.tau - made.base @ arm.theta
    assert np.sqrt(np.mean(error**2)) < 0.05 * np.sqrt(np.mean(made.tau**2))


def test_regressor_is_linear_in_acceleration(arm):
    rng = np.random.default_rng(0)
    q, dq, a, b = rng.standard_normal((4, 5, 2))
    still = regressor(arm, q, dq, 0 * a)
    np.testing.assert_allclose(
        regressor(arm, q, dq, a + b) - still,
        regressor(arm, q, dq, a) + regressor(arm, q, dq, b) - 2 * still,
        atol=1e-12,
    )


def test_smoothing_is_exact_for_cubics():
    t = np.arange(200) * 0.002
    q = np.column_stack([t**3 - t**2, 0.5 * t])
    x = motion(armgap.Log("cubic", t, q, np.ones_like(q), None))
    np.testing.assert_allclose(x.dq[:, 0], 3 * t**2 - 2 * t, atol=1e-9)
    np.testing.assert_allclose(x.ddq[:, 0], 6 * t - 2, atol=1e-6)


@pytest.mark.parametrize("name", sorted(SIZES))
def test_true_signature_explains_the_residual(name, arm):
    """With the arm's true values, the torque an effect takes is its signature times its size."""
    case = sealed(arm, Effect(name, 2, SIZES[name]))
    made: RegressionData = regression_data(case)
    residual = made.tau - made.base @ arm.theta
    own = [s for s in signatures(arm, made, made.motions[0]) if (s.effect, s.joint) == (name, 2)]
    explained = max(
        1
        - np.sum((residual - s.columns @ np.linalg.lstsq(s.columns, residual, rcond=None)[0]) ** 2)
        / np.sum(residual**2)
        for s in own
    )
    assert explained > 0.6


@pytest.mark.parametrize("baseline", ["stepwise", "frols"])
def test_regression_baselines_find_a_plain_effect(baseline, arm):
    if baseline == "frols":
        pytest.importorskip("sysidentpy", reason="pip install 'armgap[trial-baselines]'")
    assert first(sealed(arm, Effect("torque_dead_zone", 2, {"level": 1.0})), baseline) == ("torque_dead_zone", 2)


def test_correlation_finds_what_is_left_after_re_estimation(arm):
    assert first(sealed(arm, Effect("actuator_delay", 2, {"delay": 0.006})), "correlation") == ("actuator_delay", 2)


def test_constant_guess_does_not_look(arm):
    assert first(sealed(arm, seconds=2.0), "constant") == ("stribeck", 1)


@pytest.mark.parametrize("kind", ["two-link", "pendulum"])
def test_masses_of_the_mujoco_model_move_as_the_base_parameters_do(kind, arm, tmp_path):
    """The engine's inertia matrix and bias forces times nothing but the arm file's theta."""
    import mujoco

    if kind == "pendulum":
        path = tmp_path / "arm.toml"
        path.write_text(
            'kind = "pendulum"\nsample_period = 0.0025\n[inertial]\ntheta = [0.3, 8.0]\n[friction]\nviscous = [0.1]\ncoulomb = [0.5]\n'
        )
        arm = Arm.read(path)
    model = build_spec(arm).compile()
    d = mujoco.MjData(model)
    rng = np.random.default_rng(1)
    for _ in range(5):
        d.qpos[:], d.qvel[:], a = rng.standard_normal((3, arm.n_joints))
        mujoco.mj_forward(model, d)
        full = np.zeros((arm.n_joints, arm.n_joints))
        mujoco.mj_fullM(model, d, full)
        n = arm.n_inertial
        expected = regressor(arm, d.qpos[None], d.qvel[None], a[None])[0, :, :n] @ arm.theta[:n]
        np.testing.assert_allclose(full @ a + d.qfrc_bias, expected, rtol=1e-6, atol=1e-6)


def test_mujoco_sysid_finds_an_offset(arm, monkeypatch):
    pytest.importorskip("absl", reason="pip install 'armgap[trial-baselines]'")
    module = importlib.import_module("armgap.trial.baselines.sysid")
    monkeypatch.setattr(module, "_FITTED_WINDOWS", 4)
    monkeypatch.setattr(module, "ITERATIONS", 4)
    case = sealed(arm, Effect("torque_offset", 2, {"offset": 1.0}), seconds=3.0)
    answer = methods()["sysid"].answer(case)
    assert answer.verdict == "effect"
    assert ("torque_offset", 2) in [c.name for c in answer.causes]
    assert {c.effect for c in answer.causes} <= methods()["sysid"].expresses <= {e["name"] for e in armgap.effects()}


@pytest.mark.parametrize(
    ("name", "package"), [("frols", "sysidentpy.model_structure_selection"), ("sysid", "mujoco.sysid")]
)
def test_a_baseline_that_is_not_installed_says_so_in_one_line(name, package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(TrialEngineMissingError, match=r"pip install 'armgap\[trial-baselines\]'"):
        methods()[name].check()


def test_every_baseline_says_how_it_is_set():
    assert len({m.name for m in BASELINES}) == len(BASELINES) == len(methods()) - 1
    assert all(m.settings and not m.settings.endswith(".") for m in methods().values())


def test_windows_of_the_true_model_miss_by_the_encoder_only(arm):
    log = sealed(arm, seconds=2.0).training[0]
    m = Mechanism(arm.kind, arm.gravity, tuple(arm.link_length))
    error = misses(m, arm.theta, cut(log.t, log.q, log.tau))
    assert np.median(np.abs(error) / arm.encoder_step) < 10
