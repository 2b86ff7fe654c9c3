"""Trial cases: the engine's model, its friction, effects, seals, whole trials."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="MuJoCo is missing: pip install 'armgap[trial]'")

from armgap.trial import (
    DEMO_SEED,
    SealError,
    TrialEngineMissingError,
    make_case,
    make_demo_case,
    make_trial,
    open_key,
    plan_trial,
    possible,
)
from armgap.trial.cases.case import NoMotionError, _one, simulated_arm_of
from armgap.trial.cases.key import HiddenEffect, Key
from armgap.trial.effects import REGISTRY, Draw, usage
from armgap.trial.effects.base import JointUsage
from armgap.trial.simulation.actuator import Actuator, DeadZone, Delay, Encoder, Lag, Saturation
from armgap.trial.simulation.arms import AXIS, DIRECT_DRIVE, GEARED, PENDULUM, TrialArm, random_arm
from armgap.trial.simulation.excitation import draw_excitation
from armgap.trial.simulation.plant import Flexure, Plant, PlantConfig, Rotor
from armgap.trial.simulation.simulated_arm import SimulatedArm, run
from armgap.trial.verdict import equivalent

DEMO_CASE = Path(__file__).parents[1] / "python" / "armgap" / "demo_case"

#: Names and parameters of the standard effects.
STANDARD = {
    "coulomb_asymmetry": {"delta"},
    "torque_offset": {"offset"},
    "stribeck": {"amplitude", "velocity"},
    "quadratic_drag": {"c"},
    "load_dependent_friction": {"mu"},
    "position_dependent_friction": {"a", "b"},
    "friction_warmup": {"amplitude", "time_constant"},
    "presliding": {"amplitude", "stiffness"},
    "joint_elasticity": {"stiffness", "damping", "rotor_inertia"},
    "backlash": {"gap"},
    "torque_gain": {"gain"},
    "actuator_lag": {"time_constant"},
    "actuator_delay": {"delay"},
    "torque_saturation": {"level"},
    "torque_ripple": {"amplitude", "n", "phase"},
    "torque_dead_zone": {"level"},
    "payload": {"mass", "distance"},
    "base_tilt": {"angle"},
    "joint_spring": {"k", "q0"},
    "rotor_inertia": {"inertia"},
    "encoder_offset": {"offset"},
    "encoder_eccentricity": {"a", "b"},
    "contact": {"position", "stiffness", "damping"},
    "external_pulse": {"time", "duration", "impulse"},
}


def paper_torques(t: float, _q: list[float]) -> list[float]:
    """Equations (31)-(32) of Reyes and Kelly (1997)."""
    return [
        (1 - math.exp(-0.8 * t)) * 29 + 68 * math.sin(16 * t + 0.1) + 9 * math.sin(20 * t + 0.15),
        (1 - math.exp(-1.8 * t)) * 1.2 + 8 * math.sin(26 * t + 0.08) + 2 * math.sin(12 * t + 0.34),
    ]


def inertia_and_bias(theta, q, dq):
    """M(q) and C dq + g of the two-link arm, from its equations of motion."""
    c2, s2 = math.cos(q[1]), math.sin(q[1])
    M = np.array([[theta[0] + 2 * theta[1] * c2, theta[2] + theta[1] * c2], [theta[2] + theta[1] * c2, theta[2]]])
    coriolis = theta[1] * s2 * np.array([-2 * dq[0] * dq[1] - dq[1] ** 2, dq[0] ** 2])
    g2 = theta[4] * math.sin(q[0] + q[1])
    return M, coriolis + np.array([theta[3] * math.sin(q[0]) + g2, g2])


@pytest.fixture(scope="module")
def paper_run():
    return run(SimulatedArm(PlantConfig(DIRECT_DRIVE)), paper_torques, 4.0)


def test_power_balance_without_friction():
    """Energy gained equals the work of the held torques."""
    arm = replace(DIRECT_DRIVE, viscous=(0.0, 0.0), coulomb=(0.0, 0.0))
    x = run(SimulatedArm(PlantConfig(arm)), lambda t, q: [0.4 * u for u in paper_torques(t, q)], 2.0)
    work = np.sum(x.tau[:-1] * np.diff(x.q_true, axis=0))

    def energy(q, dq):
        M, _ = inertia_and_bias(arm.theta, q, dq)
        height = arm.theta[3] * (1 - math.cos(q[0])) + arm.theta[4] * (1 - math.cos(q.sum()))
        return 0.5 * dq @ M @ dq + height

    assert energy(x.q_true[-1], x.dq_true[-1]) == pytest.approx(work, rel=1e-9)


@pytest.mark.parametrize(("config", "change"), [
    (PlantConfig(DIRECT_DRIVE), {}),
    (PlantConfig(DIRECT_DRIVE, payload=(0.8, 0.2)), {"payload": (0.8, 0.2)}),
    (PlantConfig(DIRECT_DRIVE, armature={1: 0.05}), {"armature": 0.05}),
    (PlantConfig(DIRECT_DRIVE, tilt=0.1), {"tilt": 0.1}),
    (PlantConfig(DIRECT_DRIVE, coupling=(2e-4, -6.0)), {"coupling": (2e-4, -6.0)}),
])  # fmt: skip
def test_engine_has_the_stated_inertia_and_gravity(config, change):
    """M(q) and C dq + g of the engine's model equal the arm's equations at random states."""
    import mujoco

    arm, plant, rng = DIRECT_DRIVE, Plant(config), np.random.default_rng(5)
    theta = np.array(arm.theta)
    if "payload" in change:
        (m, d), l1, g = change["payload"], arm.length[0], arm.gravity
        theta[:5] += [m * (l1**2 + d**2), m * l1 * d, m * d**2, g * m * l1, g * m * d]
    for _ in range(20):
        q, dq = rng.uniform(-2, 2, 2), rng.uniform(-5, 5, 2)
        plant.place(q.tolist(), dq.tolist())
        M, bias = inertia_and_bias(theta, q, dq)
        tilt = change.get("tilt", 0.0)
        bias += inertia_and_bias(theta, q + np.array([tilt, 0.0]), 0 * dq)[1] - inertia_and_bias(theta, q, 0 * dq)[1]
        M[1, 1] += change.get("armature", 0.0)
        inertia, gear = change.get("coupling", (0.0, 0.0))
        M += inertia * np.outer([1, gear], [1, gear])
        full = np.zeros((2, 2))
        mujoco.mj_fullM(plant.model, plant.data, full)
        np.testing.assert_allclose(full, M, rtol=1e-9, atol=1e-8)
        np.testing.assert_allclose(plant.data.qfrc_bias, bias, rtol=1e-8, atol=1e-7)


@pytest.mark.parametrize("arm", [PENDULUM, AXIS, GEARED], ids=["pendulum", "axis", "geared"])
def test_friction_holds_below_its_level_and_gives_way_above(arm):
    def after(factor: float) -> float:
        plant = Plant(PlantConfig(arm))
        for _ in range(800):
            plant.hold([0.0] * (arm.n_joints - 1) + [factor * arm.coulomb[-1]])
        return abs(plant.position()[-1])

    assert after(0.95) < 0.1 * arm.step[-1]
    assert after(1.05) > 100 * arm.step[-1]


def test_closed_play_and_stiff_flexure_leave_the_nominal_arm(paper_run):
    """Both keep the link's mass and inertia: without play, or nearly rigid, the motion is the nominal one."""
    inertia = 0.1 * DIRECT_DRIVE.inertia[1]
    for config in (
        PlantConfig(DIRECT_DRIVE, rotors={1: Rotor(inertia, stiffness=5e4, damping=20.0, part_of_link=True)}),
        PlantConfig(DIRECT_DRIVE, flexure=Flexure(stiffness=5e4, damping=20.0)),
    ):
        x = run(SimulatedArm(config), paper_torques, 1.0)
        assert np.max(np.abs(x.q_true - paper_run.q_true[:400])) < 2e-4


def test_actuator_chain_in_its_order():
    chain = Actuator()
    for stage in (Lag(1e-14), Saturation(3.0), DeadZone(1.0), Delay(0.002)):
        chain.add(stage)
    commands = [0.0] * 3 + [10.0] * 5 + [1.5] * 5
    assert [round(chain(u, 1e-3), 9) for u in commands] == [0.0] * 5 + [3.0] * 5 + [0.5] * 3


def test_lag_gives_the_mean_over_the_step():
    lag, tau, dt = Lag(0.01), 0.01, 0.004
    lag(0.0, dt)
    fine = np.linspace(0, dt, 20001)
    assert lag(1.0, dt) == pytest.approx(np.mean(1 - np.exp(-fine / tau)), rel=1e-4)


def test_encoder_shows_whole_counts():
    encoder = Encoder(step=0.01, offset=0.1, a=0.02, b=0.03)
    shown = encoder(0.5)
    assert shown == pytest.approx(0.5 + 0.1 + 0.02 * math.sin(0.5) + 0.03 * math.cos(0.5), abs=0.005)
    assert shown / 0.01 == pytest.approx(round(shown / 0.01), abs=1e-9)


def test_every_standard_effect_is_there_with_its_parameters():
    library = {name for name, e in REGISTRY.items() if e.family == "library"}
    assert library == set(STANDARD)
    assert sum(e.family == "outside" for e in REGISTRY.values()) >= 4


@pytest.fixture(scope="module")
def moved():
    """A short tracked motion of a random arm of each kind."""
    runs = {}
    for model in ("direct-drive", "pendulum"):
        rng = np.random.default_rng(11)
        arm = random_arm(rng, model, 0.0025)
        motion = draw_excitation(rng, arm, "tracked", 1.0)
        runs[arm.kind] = (arm, motion, run(SimulatedArm(PlantConfig(arm)), motion.source(arm), 2.0))
    return runs


@pytest.mark.parametrize("name", sorted(REGISTRY))
def test_every_effect_moves_the_arm(name, moved):
    """With the size drawn in the middle of its range each effect is worth many encoder steps."""
    entry = REGISTRY[name]
    for joint in range(2 if entry.per_joint else 1):
        arm, motion, plain = moved["two-link"]
        draw = Draw(np.random.default_rng(3), 0.5, arm, joint, usage([plain], joint))
        parameters = entry.draw(draw)
        if name in STANDARD:
            assert set(parameters) == STANDARD[name]
        hidden = HiddenEffect(name, joint + 1 if entry.per_joint else None, parameters)
        x = run(simulated_arm_of(arm, [hidden]), motion.source(arm), 2.0)
        assert np.all(np.isfinite(x.q))
        assert np.max(np.abs(x.q - plain.q) / arm.step) > 20


def test_asymmetry_is_an_offset_of_the_opposite_sign(moved):
    """The exact look-alike, also at rest: bit for bit the same logs."""
    arm, motion, _ = moved["pendulum"]
    logs = [
        run(simulated_arm_of(arm, [HiddenEffect(name, 1, {key: value})]), motion.source(arm), 1.0).q
        for name, key, value in (("coulomb_asymmetry", "delta", 0.2), ("torque_offset", "offset", -0.2))
    ]
    np.testing.assert_array_equal(*logs)


def test_pulse_acts_only_in_its_log(moved):
    arm, motion, plain = moved["pendulum"]
    pulse = HiddenEffect("external_pulse", 1, {"time": 1.0, "duration": 0.1, "impulse": 0.5}, log="train-1")
    elsewhere = run(simulated_arm_of(arm, [pulse], "holdout-1"), motion.source(arm), 2.0)
    here = run(simulated_arm_of(arm, [pulse], "train-1"), motion.source(arm), 2.0)
    np.testing.assert_array_equal(elsewhere.q, plain.q)
    first = np.flatnonzero(np.any(here.q != plain.q, axis=1))[0]
    assert 0.95 <= here.t[first] <= 0.97


@pytest.fixture(scope="module")
def case():
    return make_case(3, [("stribeck", 2)], size=0.6, duration=3.0, style="tracked")


def test_a_seed_decides_everything(case):
    again = make_case(3, [("stribeck", 2)], size=0.6, duration=3.0, style="tracked")
    other = make_case(4, [("stribeck", 2)], size=0.6, duration=3.0, style="tracked")
    assert (again.arm_file, again.key) == (case.arm_file, case.key)
    assert all(np.array_equal(again.logs[name].q, case.logs[name].q) for name in case.logs)
    assert other.key.sha256 != case.key.sha256


def test_training_and_holdout_move_differently(case):
    assert not np.allclose(case.logs["train-1"].q, case.logs["holdout-1"].q, atol=0.05)


def test_written_case_reads_back(case, tmp_path):
    from armgap import Arm, Log

    case.write(tmp_path)
    arm = Arm.read(tmp_path / "arm.toml")
    log = Log.read(tmp_path / "train-1.parquet", arm=arm)
    np.testing.assert_array_equal(log.q, case.logs["train-1"].q)
    np.testing.assert_array_equal(log.tau, case.logs["train-1"].tau)
    assert arm.sealed == case.key.sha256
    assert open_key(tmp_path) == case.key


def test_exact_nominal_is_the_truth():
    exact = make_case(8, model="pendulum", nominal="exact", duration=2.0, style="tracked")
    off = make_case(8, model="pendulum", nominal="off", duration=2.0, style="tracked")
    stated = [float(x) for x in exact.arm_file.split("theta = [")[1].split("]")[0].split(",")]
    assert stated == list(exact.key.theta[:2])
    assert off.arm_file != exact.arm_file
    assert off.key.effects == exact.key.effects == ()


def test_tampering_is_noticed(case, tmp_path):
    case.write(tmp_path)
    key = json.loads((tmp_path / "key.json").read_text())
    key["effects"][0]["joint"] = 1
    (tmp_path / "key.json").write_text(json.dumps(key))
    with pytest.raises(SealError, match=r"key\.json"):
        open_key(tmp_path)


def test_missing_key_and_missing_seal_are_errors(case, tmp_path):
    case.write(tmp_path)
    (tmp_path / "key.json").unlink()
    with pytest.raises(SealError, match=r"key\.json"):
        open_key(tmp_path)
    (tmp_path / "arm.toml").write_text('name = "mine"\n')
    with pytest.raises(SealError, match=r"arm\.toml"):
        open_key(tmp_path)


def test_key_text_is_its_hash(case):
    assert Key.from_json(case.key.to_json()) == case.key
    assert len(case.key.nonce) == 32


def test_impossible_wishes_are_refused():
    for wanted in (("stribeck", 3), ("payload", 1), ("no_such_effect", 1)):
        with pytest.raises(ValueError, match=wanted[0]):
            make_case(1, [wanted])


def test_logs_that_move_on_different_sides_are_refused():
    use = JointUsage(torque=1.0, peak=1.0, slew=1.0, speed=1.0, low=0.0, high=0.1, span=1.0, duration=10.0)
    draw = Draw(np.random.default_rng(0), 0.5, random_arm(np.random.default_rng(0), "pendulum"), 0, use)
    with pytest.raises(NoMotionError, match="in common"):
        _one(draw, "presliding", 1)


def test_missing_engine_is_one_clear_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(TrialEngineMissingError, match=r"pip install 'armgap\[trial\]'") as caught:
        make_case(1)
    assert "\n" not in str(caught.value)


def test_trial_plan_keeps_its_shares_and_covers_every_effect():
    plans = plan_trial(12, 400)
    count = {name: sum(p.family == name for p in plans) for name in {p.family for p in plans}}
    assert count == {"single": 260, "null": 32, "parameters": 28, "pair": 48, "outside": 32}
    assert plan_trial(12, 400) == plans != plan_trial(13, 400)
    assert all(len(p.effects) == {"null": 0, "parameters": 0, "pair": 2}.get(p.family, 1) for p in plans)
    hidden = {e for p in plans if p.family in ("single", "pair") and p.model == "direct-drive" for e in p.effects}
    assert hidden == set(possible("two-link", 2, ("library", "further")))
    with pytest.raises(ValueError, match="tripel"):
        plan_trial(1, 4, {"tripel": 1.0})


def test_case_folders_say_nothing(tmp_path):
    folders = make_trial(5, 2, {"null": 1.0}, folder=tmp_path, duration=2.0)
    assert [f.name for f in folders] == ["case-0000", "case-0001"]
    assert all(open_key(f).effects == () for f in folders)


@pytest.mark.parametrize(("named", "hidden", "same"), [
    (("stribeck", 1), ("stribeck", 1), True),
    (("stribeck", 1), ("stribeck", 2), False),
    (("torque_offset", 2), ("coulomb_asymmetry", 2), True),
    (("torque_offset", 1), ("coulomb_asymmetry", 2), False),
    (("encoder_offset", 1), ("base_tilt", None), True),
    (("encoder_offset", 2), ("base_tilt", None), False),
    (("torque_gain", 1), ("torque_gain", 2), True),
    (("actuator_lag", 1), ("actuator_delay", 1), False),
    (("rotor_inertia", 2), ("rotor_coupling", None), True),
    (("rotor_coupling", None), ("rotor_inertia", 2), False),
])  # fmt: skip
def test_look_alikes(named, hidden, same):
    assert equivalent(named, hidden) is same


def test_sample_case_is_small_sealed_and_of_its_seed():
    files = list(DEMO_CASE.iterdir())
    assert sum(f.stat().st_size for f in files) < 1_000_000
    assert sorted(f.name for f in files) == ["arm.toml", "holdout-1.parquet", "key.json", "train-1.parquet"]
    kept, made = open_key(DEMO_CASE), make_demo_case(DEMO_SEED).key
    assert [(e.effect, e.joint) for e in kept.effects] == [(e.effect, e.joint) for e in made.effects]
    np.testing.assert_allclose(kept.theta, made.theta, rtol=1e-12)


def test_arm_formulas_give_table_two():
    """Physical parameters of Table I to the "Measured" column of Table II."""
    assert isinstance(DIRECT_DRIVE, TrialArm)
    measured = (2.351, 0.084, 0.102, 38.465, 1.825)
    np.testing.assert_allclose(DIRECT_DRIVE.inertial, measured, rtol=2.5e-3)
