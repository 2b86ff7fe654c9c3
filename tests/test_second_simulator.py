"""armgap's dynamics and effects against a simulator that shares no code with them: the same torques make the same motion."""

from __future__ import annotations

import numpy as np
import pytest

from armgap import Arm, Log, diagnose, simulate
from armgap.simulation import Effect

pytest.importorskip("numba")

from second_simulator.cases import Machine, draw_machine, draw_pushes, run
from second_simulator.motions import DWELLS, PEAK_SPEEDS, REACH, draw_reference, moves
from second_simulator.scoring import PARAMETERS, intervals, is_push, laws

#: Both integrators and their steps [rad]; encoders are taken out.
SAME = 2e-7

#: Laws that the two state otherwise, and the share of their doing by which motions may differ: an asymmetry that is rounded with the rest of
#: friction or is not, a load with or without Coriolis torques, a loss that jumps where a step does not end.
OTHERWISE = {"coulomb_asymmetry": 0.03, "load_dependent_friction": 0.1, "gear_efficiency": 0.03}

#: Effect and its values in armgap; the same in the second simulator.
EFFECTS = [
    (("coulomb_asymmetry", 1, {"delta": 0.4}), {"asymmetry": 0.4}),
    (("torque_offset", 2, {"offset": 0.2}), {"offset": 0.2}),
    (("stribeck", 2, {"amplitude": 0.3, "velocity": 0.5}), {"stribeck": 0.3, "stribeck_velocity": 0.5}),
    (("quadratic_drag", 1, {"c": 0.3}), {"quadratic": 0.3}),
    (("cubic_drag", 2, {"c3": 0.05}), {"cubic": 0.05}),
    (("load_dependent_friction", 1, {"mu": 0.05}), {"load": 0.05}),
    (("position_dependent_friction", 2, {"a": 0.2, "b": -0.1}), {"cos_friction": 0.2, "sin_friction": -0.1}),
    (("viscous_asymmetry", 1, {"delta": 0.2}), {"viscous_asymmetry": 0.2}),
    (("gear_efficiency", 2, {"loss": 0.1}), {"efficiency_loss": 0.1}),
    (("torque_gain", 1, {"gain": 0.9}), {"gain": 0.9}),
    (("torque_saturation", 1, {"level": 12.0}), {"saturation": 12.0}),
    (("torque_dead_zone", 2, {"level": 0.2}), {"dead_zone": 0.2}),
    (("torque_ripple", 1, {"amplitude": 0.8, "n": 11.0, "phase": 0.4}), {"ripple": 0.8, "ripple_n": 11.0, "ripple_phase": 0.4}),
    (("joint_spring", 2, {"k": 0.9, "q0": 0.2}), {"spring": 0.9, "spring_q0": 0.2}),
    (("rotor_inertia", 2, {"inertia": 0.05}), {"armature": 0.05}),
]  # fmt: skip


@pytest.fixture(scope="module")
def machine() -> Machine:
    rng = np.random.default_rng(8)
    machine = next(m for m in iter(lambda: draw_machine(rng), None) if m.design == "large")
    machine.period = 0.002
    machine.step[:] = 1e-12
    for p in machine.joints:
        p["width"] = 0.02
    return machine


def arm_of(machine: Machine) -> Arm:
    theta = machine.theta
    return Arm(
        "second",
        "two-link",
        9.81,
        machine.period,
        theta,
        0.1 * np.abs(theta),
        link_length=np.array([machine.arm[2], 0.3]),
    )


def compared(machine: Machine, effects: list[Effect]) -> float:
    """Largest difference of what encoders show over a second [rad]."""
    return float(np.max(np.abs(difference(machine, effects, arm_of(machine), 0.02))))


def difference(machine: Machine, effects: list[Effect], arm: Arm, smoothing: float) -> np.ndarray:
    """What encoders show over a second in both simulators; the first samples decide where both start."""
    made = run(machine, draw_reference(np.random.default_rng(3), machine, 1.0), 0, np.zeros(2))
    log = simulate(
        arm,
        made.t,
        made.tau,
        q0=made.true_q[0],
        effects=effects,
        encoder=False,
        smoothing=smoothing,
        tolerance=1e-8 if smoothing else 1e-6,
    )
    return log.q - made.q


def with_transmission(machine: Machine, joint: int, encoder: int, width: float = 0.02, **values: float) -> Machine:
    """The machine with a rotor, a shaft or play on one joint."""
    joints = [{**p, "width": width} for p in machine.joints]
    joints[joint - 1].update(values)
    sides = [float(encoder) if j == joint else 0.0 for j in (1, 2)]
    return Machine(**{**vars(machine), "joints": joints, "sides": sides})


def test_the_arm_itself(machine: Machine) -> None:
    assert compared(machine, []) < SAME


@pytest.mark.parametrize(("here", "there"), EFFECTS, ids=[here[0] for here, _ in EFFECTS])
def test_an_effect(machine: Machine, here: tuple[str, int, dict[str, float]], there: dict[str, float]) -> None:
    name, joint, values = here
    with_it = Machine(**{**vars(machine), "joints": [dict(p) for p in machine.joints]})
    with_it.joints[joint - 1].update(there)
    doing = compared(with_it, [])
    assert doing > 1e3 * SAME, "the effect does nothing here"
    assert compared(with_it, [Effect(name, joint, values)]) < max(SAME, OTHERWISE.get(name, 0.0) * doing)


@pytest.mark.parametrize(
    ("name", "value"), [("payload", {"mass": 0.8, "distance": 0.25}), ("base_tilt", {"angle": 0.1})]
)
def test_an_effect_of_the_whole_arm(machine: Machine, name: str, value: dict[str, float]) -> None:
    with_it = Machine(**{**vars(machine), **({"payload": (0.8, 0.25)} if name == "payload" else {"tilt": 0.1})})
    assert compared(with_it, []) > 1e3 * SAME
    assert compared(with_it, [Effect(name, None, value)]) < SAME


@pytest.mark.parametrize("joint", [1, 2])
@pytest.mark.parametrize("encoder", [0, 1])
@pytest.mark.parametrize("friction", [0, 1])
def test_a_shaft_with_encoder_and_friction_on_either_side(
    machine: Machine, joint: int, encoder: int, friction: int
) -> None:
    rotor, stiffness, damping = 0.03, 190.0, 1.5
    values = {"rotor": rotor, "shaft": stiffness, "shaft_damping": damping, "friction_at_motor": float(friction)}
    with_it = with_transmission(machine, joint, encoder, **values)
    shaft = {"stiffness": stiffness, "damping": damping, "rotor_inertia": rotor, "rotor_rides": float(joint == 2)}
    sides = {"encoder_at_motor": float(encoder), "friction_at_motor": float(friction)}
    assert compared(with_it, []) > 1e3 * SAME
    assert compared(with_it, [Effect("joint_elasticity", joint, {**shaft, **sides})]) < SAME


@pytest.mark.parametrize("encoder", [0, 1])
@pytest.mark.parametrize("friction", [0, 1])
def test_play_with_encoder_and_friction_on_either_side(machine: Machine, encoder: int, friction: int) -> None:
    """Rigid flanks and dry friction here, stiff flanks and friction of a small width there: motions agree to a part of what play does."""
    joint, gap, width = 1, 0.02, 2e-3
    rotor = 0.15 * float(machine.inertia[joint - 1])
    flanks = {"shaft": rotor * 1500.0**2, "shaft_damping": 0.6 * rotor * 1500.0}
    values = {"rotor": rotor, "play": gap, "friction_at_motor": float(friction), **flanks}
    with_it = with_transmission(machine, joint, encoder, width, **values)
    nominal = Machine(**{**vars(machine), "rotor": [rotor, 0.0]})
    share = {"gap": gap, "rotor_share": rotor / float(nominal.inertia[0]), "riding": 1.0}
    sides = {"encoder_at_motor": float(encoder), "friction_at_motor": float(friction)}
    effect = Effect("backlash", joint, {**share, **sides})
    doing, left = (float(np.std(difference(with_it, e, arm_of(nominal), 0.0)[:, 0])) for e in ([], [effect]))
    assert left < 0.2 * doing


def test_a_push_moves_its_joint_and_is_scored_by_log_joint_time_and_sign(machine: Machine) -> None:
    reference = draw_reference(np.random.default_rng(3), machine, 2.0)
    push = {"log": "train-1", "joint": 2, "time": 1.0, "width": 0.05, "impulse": -0.4}
    row = np.array([[push["joint"] - 1, push["time"], push["width"], push["impulse"]]])
    bare, pushed = (run(machine, reference, 0, np.zeros(2), rows) for rows in (None, row))
    before, after = bare.t < push["time"] - 5 * push["width"], np.abs(bare.t - 1.03) < 0.02
    assert np.array_equal(bare.q[before], pushed.q[before])
    assert (pushed.true_dq - bare.true_dq)[after, 1].max() < -0.1

    def named(**other: object) -> dict[str, object]:
        values = {"log": "train-1 (0 to 1.5 s)", "joint": 2, "time": 1.1, "impulse": -0.3} | other
        parameters = {name: {"value": values[name]} for name in ("time", "impulse")}
        return {"effect": "external_pulse", "log": values["log"], "joint": values["joint"], "parameters": parameters}

    assert is_push(named(), push)
    for other in ({"joint": 1}, {"time": 1.3}, {"impulse": 0.3}, {"log": "train-2"}):
        assert not is_push(named(**other), push)


def test_a_gaussian_push_is_a_bell_of_its_impulse(machine: Machine) -> None:
    pushed = Machine(**{**vars(machine), "step": np.full(2, 2e-5)})
    impulse, time, width = -1.2, 2.0, 0.06
    row = np.array([[1.0, time, width, impulse]])
    references = [draw_reference(np.random.default_rng(seed), machine, 5.0) for seed in (3, 4)]
    made = [run(pushed, r, 0, np.zeros(2), rows) for r, rows in zip(references, (None, row), strict=True)]
    logs = [Log(name, r.t, r.q, r.tau, None) for name, r in zip(("train", "pushed"), made, strict=True)]
    found = diagnose(logs[:1], arm_of(machine), holdout=logs[1:])
    (cause,) = found.causes
    assert (cause.effect, cause.joint, cause.log, cause.shape) == ("external_pulse", 2, "pushed", "bell")
    size = cause.parameters["impulse"]
    assert size.value == pytest.approx(impulse, rel=0.08)
    assert abs(size.value - impulse) < 4.0 * size.sigma
    assert cause.parameters["duration"].value == pytest.approx(np.sqrt(12.0) * width, rel=0.1)


def test_pushes_are_above_friction_and_apart(machine: Machine) -> None:
    rows = np.concatenate([draw_pushes(np.random.default_rng(seed), machine, 10.0) for seed in range(40)])
    assert 30 < len(rows) < 90
    peaks = np.abs(rows[:, 3]) / (rows[:, 2] * np.sqrt(2 * np.pi))
    levels = np.array([machine.joints[int(j)]["coulomb"] for j in rows[:, 0]])
    assert np.all((peaks > 1.49 * levels) & (peaks < 4.01 * levels))


def test_intervals_hold_the_true_value_or_not():
    """An interval of 1.96 standard deviations around the value holds the true one; a deviation that is unknown always does."""

    def record(off: float, sigma: float | None) -> dict:
        fitted = {name: {"value": 1.0, "sigma": 0.1} for name in PARAMETERS} | {
            "theta1": {"value": 1.0 + off, "sigma": sigma}
        }
        return {
            "strength": 0.05,
            "theta": [1.0] * len(PARAMETERS),
            "parameters": {"refit": fitted, "with_causes": fitted},
        }

    lines = intervals([record(0.19, 0.1), record(0.2, 0.1), record(9.0, None), {"strength": None}])
    assert len(lines) == 4
    assert all("3 arms, 0.963 hold (theta1 0.67, theta2 1.00" in line for line in lines)
    assert intervals([]) == []


def test_a_law_is_right_on_its_joint_over_its_variables_and_within_its_band() -> None:
    x, y = np.array([-0.6, 0.1, 0.8]), np.array([-2.0, 0.0, 3.0])
    torque = 0.5 * x[:, None] * np.abs(y)

    def record(effect: str, *entries: dict[str, object]) -> dict[str, object]:
        hidden = [{"effect": effect, "joint": 2, "parameters": {effect: 0.5}}] if effect else []
        return {"family": "outside" if effect else "null", "effects": hidden, "unnamed": list(entries)}

    def entry(joint: int, shift: float) -> dict[str, object]:
        off = np.zeros((3, 3))
        off[0, 0] = shift
        sigma = np.full((3, 3), 0.1).tolist()
        grid = {
            "variable": "q2",
            "x": y.tolist(),
            "y": x.tolist(),
            "torque": (torque + 7.0 + off).T.tolist(),
            "sigma": sigma,
        }
        return {"joint": joint, "variable": "dq2", "law": {"x": [], "torque": [], "sigma": []}, "grid": grid}

    over_time = {"joint": 2, "variable": "t", "law": {"x": [0.0, 5.0], "torque": [-1.25, 0.5], "sigma": [0.1, 0.1]}}
    text = laws([
        record("product", entry(2, 0.0)), record("product", entry(2, 9.0), entry(1, 0.0)), record("product", over_time), record("drift", over_time),
        record("random_torque"), record("", over_time), record(""),
    ])  # fmt: skip
    assert "of 4 the joint and one or all of the variables are right in 3, all variables in 3" in text
    assert "1 of 3 within their band" in text
    assert "2 further entries; of 2 arms without an effect 1 have entries" in text


def test_moves_keep_to_their_reach_and_speed_and_dwell_between() -> None:
    t = 0.002 * np.arange(5000)
    for seed in range(10):
        q = moves(np.random.default_rng(seed), t)
        speed = np.abs(np.gradient(q, t))
        assert np.abs(q).max() <= REACH + 1e-12
        assert speed.max() <= 1.001 * PEAK_SPEEDS[1]
        dwells = np.diff(np.flatnonzero(np.diff(np.concatenate([[0], speed < 1e-9, [0]]).astype(int))))[::2] * 0.002
        assert len(dwells) > 4
        assert dwells[1:-1].min() > DWELLS[0] - 0.01
