"""Contradictions between logs and arm file: each defect put into a log is said, with its remedy; a sound log is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armgap import Arm, Log, diagnose, simulate
from armgap.check import CORRECTIONS, NAMES, Check, Corrections, dead_stretch, examine, stage, time_shift, torque_unit
from armgap.check.contradiction import READINGS, Refit
from armgap.check.equation_error import EquationError, Rows, bounds
from armgap.check.stage import unexplained_columns
from armgap.diagnosis.diagnosis import _hidden_delay
from armgap.diagnosis.prepared_input import prepare
from armgap.errors import ColumnError, OptionError
from armgap.simulation import Effect
from swings import carried, off, sines, swing


@pytest.fixture(scope="module")
def swings(pendulum: Arm) -> list[Log]:
    return [swing(off(pendulum), seed) for seed in (1, 2)]


@pytest.fixture(scope="module")
def two_links(arm: Arm) -> list[Log]:
    t = np.arange(2400) * arm.sample_period
    return [simulate(off(arm), t, sines(t, seed), noise=2e-5, seed=seed, name=f"run {seed}") for seed in (3, 4)]


def read_as(logs: list[Log], **given: object) -> list[Log]:
    corrections = Corrections.parse(**given)
    return [corrections.on_log(log) for log in logs]


def checked(logs: list[Log], arm: Arm, **options: bool) -> tuple[Check, ...]:
    return examine(logs[:1], logs[1:], arm, **options).checks


def test_sound_logs_are_left_alone(swings: list[Log], pendulum: Arm, two_links: list[Log], arm: Arm) -> None:
    assert checked(swings, pendulum) == ()
    assert checked(two_links, arm) == ()


@pytest.mark.parametrize(
    ("defect", "name", "remedies"),
    [
        ({"flip": "tau1"}, "torque_sign", {"--flip tau1", "--flip q1"}),
        ({"zero": "q1=180deg"}, "position_zero", {"--zero q1=180deg", "--gravity reversed"}),
        ({"zero": "q1=-90deg"}, "position_zero", {"--zero q1=90deg"}),
        ({"zero": "q1=90deg"}, "position_zero", {"--zero q1=-90deg"}),
    ],
)
def test_defects_of_a_pendulum(
    swings: list[Log], pendulum: Arm, defect: dict[str, str], name: str, remedies: set[str]
) -> None:
    [check] = checked(read_as(swings, **defect), pendulum)
    assert (check.check, check.severity) == (name, "error")
    assert remedies == set(check.remedies)


@pytest.mark.parametrize(
    ("defect", "name", "remedy"),
    [
        ({"flip": "tau1"}, "torque_sign", "--flip tau1"),
        pytest.param({"flip": "tau2"}, "torque_sign", "--flip tau2", marks=pytest.mark.slow),
        pytest.param({"flip": "tau1,tau2"}, "torque_sign", "--flip tau1,tau2", marks=pytest.mark.slow),
        ({"flip": "q1"}, "position_sign", "--flip q1"),
        pytest.param({"flip": "q2"}, "position_sign", "--flip q2", marks=pytest.mark.slow),
        ({"swap": ["q1,q2"]}, "joint_order", "--swap q1,q2"),
        pytest.param({"swap": ["tau1,tau2"]}, "joint_order", "--swap tau1,tau2", marks=pytest.mark.slow),
        ({"relative": "q2"}, "relative_angle", "--absolute q2"),
        ({"zero": "q2=90deg"}, "position_zero", "--zero q2=-90deg"),
    ],
)
def test_defects_of_a_two_link_arm(
    two_links: list[Log], arm: Arm, defect: dict[str, object], name: str, remedy: str
) -> None:
    [check] = checked(read_as(two_links, **defect), arm)
    assert (check.check, check.severity) == (name, "error")
    assert remedy in check.remedies


def test_the_remedy_is_applied(swings: list[Log], pendulum: Arm) -> None:
    found = examine(*([log] for log in read_as(swings, flip="tau1")), pendulum)
    assert found.contradictory
    np.testing.assert_array_equal(found.training[0].tau, swings[0].tau)


def test_gravity_of_the_arm_file(swings: list[Log], pendulum: Arm) -> None:
    turned = replace(pendulum, theta=pendulum.theta * [1, -1, 1, 1])
    [check] = checked(swings, turned)
    assert check.check == "gravity_sign"
    assert "--gravity reversed" in check.remedies


def test_gravity_compensated_torques(swings: list[Log], pendulum: Arm) -> None:
    weight = off(pendulum).theta[1]
    compensated = [replace(log, tau=log.tau - weight * np.sin(log.q)) for log in swings]
    [check] = checked(compensated, pendulum)
    assert (check.check, check.severity) == ("gravity_missing", "error")


@pytest.mark.parametrize("factor", [12.5, 0.02])
def test_a_factor_on_a_torque_column(two_links: list[Log], arm: Arm, factor: float) -> None:
    [check] = checked(read_as(two_links, factor={"tau2": factor}), arm)
    assert (check.check, check.severity, check.joint) == ("torque_unit", "repaired", 2)
    found = float(check.remedy.removeprefix("--factor tau2="))
    assert found * factor == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize(
    "hidden",
    [
        (Effect("joint_spring", 1, {"k": 300.0, "q0": 0.2}), Effect("joint_spring", 2, {"k": 80.0, "q0": 0.2})),
        (Effect("hardening_spring", 2, {"k": 10.0, "q0": 0.1, "cubic": 400.0}),),
    ],
)
def test_strong_springs_are_no_other_reading_of_the_columns(arm: Arm, hidden: tuple[Effect, ...]) -> None:
    logs = carried(arm, *hidden)
    low, high = bounds(arm)
    assert EquationError([Rows.of(log, arm) for log in logs], arm).fit(low, high).share.max() > 0.3, "not strong"
    assert checked(logs, arm) == ()


def test_parameters_that_are_all_three_times_off_are_left_to_the_fit(swings: list[Log], pendulum: Arm) -> None:
    scaled = replace(pendulum, theta=3 * pendulum.theta, sigma=3 * pendulum.sigma)
    assert [c.severity for c in checked(swings, scaled)] == ["warning"]


def test_a_commanded_position_in_the_torque_column(pendulum: Arm) -> None:
    t = np.arange(2000) * pendulum.sample_period
    logs = []
    for seed in (1, 2):
        draw = np.random.default_rng(seed)
        speed, phase = 2 * np.pi * draw.uniform(0.2, 1.5, 4), draw.uniform(0, 6, 4)
        reference = 0.3 * np.sin(np.outer(t, speed) + phase).sum(axis=1)
        late = 0.3 * np.sin(np.outer(t - 0.02, speed) + phase).sum(axis=1)
        logs.append(Log(f"servo {seed}", t, late[:, None] + draw.normal(0, 2e-4, (len(t), 1)), reference[:, None]))
    [check] = checked(logs, pendulum)
    assert (check.check, check.severity) == ("torque_is_position", "error")


def test_a_shift_that_delays_of_all_joints_undo_was_none(two_links: list[Log], arm: Arm) -> None:
    def delays(*values: float) -> list[dict[str, object]]:
        named = enumerate(values, start=1)
        return [{"effect": "actuator_delay", "joint": j, "parameters": {"delay": {"value": v}}} for j, v in named]

    assert time_shift.taken_back(delays(0.0061, 0.0059), 2, -0.006)
    assert not time_shift.taken_back(delays(0.0061), 2, -0.006), "a delay of one drive is an effect"
    assert not time_shift.taken_back(delays(0.001, 0.001), 2, -0.006), "what is left of a sample"
    assert not time_shift.taken_back(delays(0.006, 0.006), 2, 0.0), "nothing was shifted"
    as_read = prepare(two_links[:1], two_links[1:], arm, Corrections(), {"horizon": 0.25}, repair=True)
    late = Corrections(shift={"tau": -2 * arm.sample_period})
    shifted = replace(as_read, training=[late.on_log(log) for log in as_read.training], shift=late.shift["tau"])
    [again] = shifted.without_shift().training
    rows = np.searchsorted(as_read.training[0].t, again.t - 1e-9)
    np.testing.assert_array_equal(again.tau, as_read.training[0].tau[rows])
    assert len(again) > len(as_read.training[0]) - 10


@pytest.mark.parametrize("samples", [pytest.param(1, marks=pytest.mark.slow), 3])
def test_torques_that_come_late_in_the_file(two_links: list[Log], arm: Arm, samples: int) -> None:
    late = [replace(log, tau=np.vstack([log.tau[:samples], log.tau[:-samples]])) for log in two_links]
    [check] = checked(late, arm)
    assert (check.check, check.severity) == ("time_shift", "repaired")
    assert float(check.remedy.removeprefix("--shift tau=")) == pytest.approx(-samples * arm.sample_period)
    assert [c.severity for c in checked(late, arm, repair=False)] == ["warning"]


@pytest.mark.slow
def test_torques_that_come_early_are_seen_by_predictions(two_links: list[Log], arm: Arm) -> None:
    assert time_shift.early(two_links[:1], two_links[1:], arm, 0.25) is None
    early = [replace(log, tau=np.vstack([log.tau[3:], np.repeat(log.tau[-1:], 3, axis=0)])) for log in two_links]
    check = time_shift.early(early[:1], early[1:], arm, 0.25)
    assert check is not None
    assert (check.check, check.severity) == ("time_shift", "warning")
    assert float(check.remedy.removeprefix("--shift tau=")) == pytest.approx(3 * arm.sample_period)
    given = prepare(early[:1], early[1:], arm, Corrections(), {"horizon": 0.25}, repair=True)
    gap = {"horizon_s": 0.25}
    assert _hidden_delay({"verdict": "unexplained", "causes": [], "gap": gap}, given) == [check]
    late = [{"effect": effect, "joint": j} for j, effect in enumerate(("actuator_lag", "actuator_delay"), start=1)]
    assert _hidden_delay({"verdict": "effect", "causes": late, "gap": gap}, given) == [check]
    assert _hidden_delay({"verdict": "effect", "causes": late[:1], "gap": gap}, given) == [], "one drive's own lag"
    said = replace(given, checks=(check,))
    assert _hidden_delay({"verdict": "unexplained", "causes": [], "gap": gap}, said) == [], "said already"


def test_torques_played_backwards_are_another_arm_s(two_links: list[Log], arm: Arm) -> None:
    backwards = [replace(log, tau=np.ascontiguousarray(log.tau[::-1])) for log in two_links]
    [check] = checked(backwards, arm)
    assert (check.check, check.severity) == ("joint_order", "error")
    assert check.remedy.startswith("--columns ")


def test_a_diagnosis_that_still_misses_the_motion_asks_for_the_columns_again(two_links: list[Log], arm: Arm) -> None:
    backwards = [replace(log, tau=np.ascontiguousarray(log.tau[::-1])) for log in two_links]
    [check] = unexplained_columns(backwards[:1], backwards[1:], arm, 0.25, 0.9)
    assert (check.check, check.severity) == ("joint_order", "error")
    assert unexplained_columns(backwards[:1], backwards[1:], arm, 0.25, 0.1) == []
    assert unexplained_columns(two_links[:1], two_links[1:], arm, 0.25, 0.9) == []


def test_a_joint_that_friction_holds_where_predictions_are_judged_contradicts_nothing(
    two_links: list[Log], arm: Arm, monkeypatch: pytest.MonkeyPatch
) -> None:
    read, rest = Refit.within_limits, np.array([False, True])

    def at_rest(*given: object) -> Refit:
        found = read(*given)  # type: ignore[arg-type]
        return replace(found, motion=np.where(rest, 1e-7, found.motion), error=np.where(rest, 1e-7, found.error))

    monkeypatch.setattr(Refit, "within_limits", at_rest)
    backwards = [replace(log, tau=np.ascontiguousarray(log.tau[::-1])) for log in two_links]
    assert [check.joint for check in checked(backwards, arm)] == [1]
    beside = [replace(log, tau=np.column_stack([log.tau[:, 0], log.tau[::-1, 1]])) for log in two_links]
    assert not any(check.joint == 2 for check in checked(beside, arm))


def test_a_size_of_all_torques_that_predictions_refute_is_not_said(two_links: list[Log], arm: Arm) -> None:
    corrections = Corrections(factor={"tau": 3.0})
    checks = tuple(torque_unit.said(corrections.factor, "warning", shared=True))
    factors = torque_unit.Factors(corrections, -5.0, checks, doubtful=True)
    for scale, said in ((1.0, False), (3.0, True)):
        file = replace(arm, theta=scale * arm.theta, sigma=0.01 * arm.theta)
        now = stage.Examined(two_links[:1], two_links[1:], file, (), Corrections())
        assert stage._prefers(factors, [], now, 0.25) is said


def test_what_a_factor_leaves_unexplained_is_left_to_predictions(two_links: list[Log], arm: Arm) -> None:
    amperes = [replace(log, tau=log.tau / 12.0) for log in two_links]
    rng = np.random.default_rng(7)
    noisy = [replace(log, tau=log.tau + 0.4 * log.tau.std(axis=0) * smooth(rng, len(log))) for log in amperes]
    for logs, doubtful in ((amperes, False), (noisy, True)):
        found = torque_unit.find(EquationError([Rows.of(log, arm) for log in logs], arm), logs, arm)
        assert found is not None
        assert found.doubtful is doubtful


def smooth(rng: np.random.Generator, n: int) -> np.ndarray:
    """Two columns of slow noise of variance one."""
    x = np.cumsum(rng.standard_normal((n + 100, 2)), axis=0)
    x = x[100:] - x[:-100]
    return np.asarray((x - x.mean(axis=0)) / x.std(axis=0))


@pytest.mark.filterwarnings("error")
def test_a_joint_that_was_not_driven_has_no_factor(two_links: list[Log], arm: Arm) -> None:
    idle = [replace(log, tau=log.tau * [0.0, 1.0]) for log in two_links]
    found = torque_unit.find(EquationError([Rows.of(log, arm) for log in idle], arm), idle, arm)
    assert found is None or "tau1" not in found.corrections.factor


def test_columns_share_the_factor_of_the_joint_that_knows_it() -> None:
    common = torque_unit._common(np.array([50.0, 65.0]), np.array([0.004, 0.29]))
    assert common == pytest.approx(50.0, rel=0.01)
    assert torque_unit._common(np.array([49.0, 51.0]), np.array([1e-5, 1e-6])) == pytest.approx(50.0, rel=0.01)


def test_a_joint_whose_torque_is_mostly_noise_hides_no_factor(two_links: list[Log], arm: Arm) -> None:
    rng = np.random.default_rng(5)
    fast = [np.column_stack([np.zeros(len(log)), rng.standard_normal(len(log))]) for log in two_links]
    size = 4.0 * np.std(two_links[0].tau[:, 1])
    amperes = [replace(log, tau=(log.tau + size * x) / 12.0) for log, x in zip(two_links, fast, strict=True)]
    found = torque_unit.find(EquationError([Rows.of(log, arm) for log in amperes], arm), amperes, arm)
    assert found is not None
    assert found.doubtful
    assert set(found.corrections.factor) == {"tau"}
    assert found.corrections.factor["tau"] == pytest.approx(12.0, rel=0.05)
    assert "torque_unit" in [check.check for check in checked(amperes, arm)]


def test_halves_that_do_not_agree_leave_a_late_torque_to_predictions(two_links: list[Log], arm: Arm) -> None:
    training, holdout = two_links[:1], two_links[1:]
    assert time_shift.confirmed(0, training, holdout, arm, 0.25) is None
    late = [replace(log, tau=np.vstack([log.tau[:2], log.tau[:-2]])) for log in two_links]
    found = time_shift.confirmed(0, late[:1], late[1:], arm, 0.25)
    assert found is not None
    assert found.shift["tau"] == pytest.approx(-2 * arm.sample_period)


def test_a_factor_is_told_from_inertias_and_weights(two_links: list[Log], arm: Arm) -> None:
    friction = np.arange(len(arm.theta)) >= arm.n_inertial
    wrong = replace(arm, theta=np.where(friction, 0.2, 1.0) * arm.theta, sigma=np.where(friction, 5.0, 1.0) * arm.sigma)
    amperes = [replace(log, tau=log.tau / 12.0) for log in two_links]
    factors = [
        float(c.remedy.removeprefix("--factor tau=").split()[0])
        for c in checked(amperes, wrong)
        if c.check == "torque_unit"
    ]
    assert factors
    assert all(abs(factor / 12.0 - 1) < 0.1 for factor in factors)


def test_a_stretch_without_torque(two_links: list[Log], arm: Arm) -> None:
    def without(log: Log) -> Log:
        tau = log.tau.copy()
        tau[400:1000] = 0.0
        return replace(log, tau=tau)

    found = checked([without(two_links[0]), two_links[1]], arm)
    assert {c.check for c in found} == {"dead_stretch"}
    assert found[0].rows == ((400, 999),)
    assert found[0].log == "run 3"


def test_a_joint_that_moves_only_as_it_is_read_otherwise_is_predicted_no_better() -> None:
    def refit(error: list[float], motion: list[float]) -> Refit:
        return Refit(np.ones(4), np.ones(4), np.array(error), np.array(motion))

    # Joint 2 stands still relative to link 1, and moves with it when it is taken to count from the world.
    still, moving = refit([0.010, 0.001], [0.14, 0.0005]), refit([0.010, 0.008], [0.14, 0.14])
    assert moving.relative < 0.2 * still.relative
    assert moving.against(still) > 1.0
    # Degrees make of the same motion one that is 57 times as large.
    degrees = refit([0.57, 0.57], [8.0, 8.0])
    assert refit([0.01, 0.01], [0.14, 0.14]).against(degrees, rescaled=True) == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("first", [300, 8600])
def test_a_stretch_without_torque_anywhere_in_a_long_log(pendulum: Arm, first: int) -> None:
    t = np.arange(9600) * 1e-3
    tau = 0.5 * np.sin(3 * t) + 0.2 * np.sin(7 * t)
    log = simulate(off(pendulum), t, tau, noise=1e-5, seed=1, name="long")
    assert dead_stretch.find([log], pendulum) == []
    tau = log.tau.copy()
    tau[first : first + 600] = 0.0
    [check] = dead_stretch.find([replace(log, tau=tau)], pendulum)
    assert check.rows == ((first, first + 599),)


def test_a_clipped_command_is_no_dead_stretch(pendulum: Arm) -> None:
    t = np.arange(4000) * 1e-3
    log = simulate(off(pendulum), t, 0.9 * np.sin(3 * t), noise=1e-5, seed=1, name="clipped")
    assert dead_stretch.find([replace(log, tau=np.clip(log.tau, -0.3, 0.3))], pendulum) == []


@pytest.mark.parametrize(("k", "cubic", "q0"), [(3.0, 30.0, 0.3), (20.0, 3000.0, 0.05)])
def test_a_strong_spring_is_no_other_arm(pendulum: Arm, k: float, cubic: float, q0: float) -> None:
    spring = Effect("hardening_spring", 1, {"k": k, "q0": q0, "cubic": cubic})
    assert checked([swing(off(pendulum), seed, spring, noise=1e-5) for seed in (1, 2)], pendulum) == ()


def test_a_free_swing_is_no_dead_stretch(pendulum: Arm) -> None:
    t = np.arange(2000) * pendulum.sample_period
    tau = np.where(t < 4, 0.5 * np.sin(3 * t) + 0.2 * np.sin(7 * t), 0.0)
    logs = [simulate(off(pendulum), t, s * tau, noise=2e-4, seed=k, name=f"run {k}") for k, s in enumerate((1.0, -0.8))]
    assert checked(logs, pendulum) == ()


def test_the_verdict_of_contradictory_input(swings: list[Log], pendulum: Arm) -> None:
    train, holdout = read_as(swings, flip="tau1")
    result = diagnose(train, pendulum, holdout=holdout)
    assert result.verdict == "input"
    assert result.causes == ()
    assert result.checks[0].check == "torque_sign"
    # The figures are those with the remedy applied.
    assert max(result.gap.refit) < 5e-3


def test_corrections_are_options_and_lines_of_the_arm_file(pendulum: Arm, tmp_path: object) -> None:
    given = Corrections.parse(
        flip=["tau1"],
        zero={"q1": "180deg"},
        factor={"tau": 2},
        shift={"tau": "-0.005s"},
        skip=["run:0-1.5"],
        unit="deg",
    )
    text = replace(pendulum, corrections=given).to_toml()
    path = tmp_path / "arm.toml"  # type: ignore[operator]
    path.write_text(text)
    assert Arm.read(path).corrections == given


def test_every_correction_undoes_its_defect(two_links: list[Log]) -> None:
    [log, _] = two_links
    for there, back in (
        ({"flip": "q1,tau2"}, {"flip": "q1,tau2"}),
        ({"zero": "q1=90deg"}, {"zero": "q1=-90deg"}),
        ({"swap": ["q1,q2"]}, {"swap": ["q1,q2"]}),
        ({"absolute": "q2"}, {"relative": "q2"}),
        ({"factor": "tau1=4"}, {"factor": "tau1=0.25"}),
    ):
        [again] = read_as(read_as([log], **there), **back)
        np.testing.assert_allclose(again.q, log.q, atol=1e-12)
        np.testing.assert_allclose(again.tau, log.tau, atol=1e-12)


@pytest.mark.parametrize(
    "given",
    [
        {"flip": "speed1"},
        {"zero": "q1"},
        {"zero": "q1=left"},
        {"swap": ["q1,tau1"]},
        {"factor": "tau1=0"},
        {"shift": "tau=soon"},
        {"skip": "2-1"},
        {"gravity": "up"},
        {"unit": "gon"},
        {"mirror": "q1"},
    ],
)
def test_corrections_that_are_none(given: dict[str, object]) -> None:
    with pytest.raises(OptionError):
        Corrections.parse(**given)


def test_a_column_that_is_not_there(swings: list[Log]) -> None:
    with pytest.raises(ColumnError, match="q2"):
        Corrections.parse(flip="q2").on_log(swings[0])


def test_bounded_least_squares_is_the_least(two_links: list[Log], arm: Arm) -> None:
    """No random parameters within the bounds explain the torques better."""
    flipped = read_as(two_links, flip="tau1")
    base = EquationError([Rows.of(log, arm) for log in flipped], arm)
    low, high = bounds(arm)
    fit = base.fit(low, high)
    assert np.all(fit.theta >= low - 1e-9)
    assert np.all(fit.theta <= high + 1e-9)
    draw = np.random.default_rng(0)
    ceiling = np.where(np.isfinite(high), high, 3 * arm.theta)

    def cost(theta: np.ndarray) -> float:
        squares = sum(np.sum((r.y - r.psi @ theta) ** 2, axis=0) for r in base.rows)
        return float(np.sum(squares / base.count / base.scale))

    least = cost(fit.theta)
    assert least == pytest.approx(float(fit.share.sum()), rel=1e-6)
    for _ in range(200):
        near = np.clip(fit.theta * draw.normal(1, 0.05, len(low)), low, ceiling)
        assert cost(near) >= least - 1e-9
        assert cost(draw.uniform(low, ceiling)) >= least - 1e-9


def test_every_check_is_offered_somewhere(arm: Arm, pendulum: Arm) -> None:
    """Every name has a module that says it, and every reading is of a known check with a remedy of its own."""
    from pathlib import Path

    import armgap.check

    sources = "".join(p.read_text() for p in Path(armgap.check.__file__).parent.rglob("*.py") if p.name != "check.py")
    assert [name for name in NAMES if f'"{name}"' not in sources] == []

    def turned(a: Arm) -> Arm:
        return replace(a, theta=-a.theta)

    offered = [r for a in (arm, pendulum, turned(pendulum)) for readings in READINGS for r in readings(a, 1.0)]
    assert all(r.check in NAMES and r.remedies and r.corrections for r in offered)
    assert set(CORRECTIONS) >= {
        "flip",
        "zero",
        "swap",
        "absolute",
        "relative",
        "factor",
        "shift",
        "skip",
        "gravity",
        "unit",
    }


def test_a_gain_beside_a_repaired_column_is_what_its_factor_was_off_by() -> None:
    def gain(joint: int, value: float) -> dict[str, object]:
        return {"effect": "torque_gain", "joint": joint, "parameters": {"gain": {"value": value}}}

    assert torque_unit.refined({"tau2": 10.0}, [gain(2, 0.9)], 2) == {"tau2": 9.0}
    assert torque_unit.refined({"tau2": 10.0}, [gain(1, 0.8)], 2) == {"tau2": 12.5}
    assert torque_unit.refined({"tau": 10.0}, [gain(1, 1.1)], 2) == {"tau1": 11.0, "tau2": 10.0}
    assert torque_unit.refined({}, [gain(1, 1.1)], 2) == {}
    assert torque_unit.refined({"tau2": 10.0}, [{"effect": "stribeck", "joint": 2, "parameters": {}}], 2) == {}


def test_equal_delays_of_all_joints_may_be_a_shift_of_the_file() -> None:
    def delay(joint: int, value: float) -> dict[str, object]:
        return {"effect": "actuator_delay", "joint": joint, "parameters": {"delay": {"value": value, "sigma": 1e-5}}}

    check = time_shift.causal([delay(1, 0.005), delay(2, 0.005)], 2, 0.002)
    assert check is not None
    assert (check.severity, check.remedy) == ("warning", "--shift tau=0.005")
    assert time_shift.causal([delay(1, 0.005), delay(2, 0.009)], 2, 0.002) is None
    assert time_shift.causal([delay(1, 0.005)], 2, 0.002) is None
