"""Base parameters and online estimators of serial arms: against Pinocchio, numpy and motion made by MuJoCo."""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

import armgap
from armgap import Arm, Estimator, Log, identify, read_model
from armgap.errors import OptionError
from armgap.estimation.base_columns import base_parameters

sys.path.insert(0, str(Path(__file__).parent))

Array = NDArray[np.float64]
Run = Callable[..., tuple[int, str, str]]

CUTOFF_RAD_S, P0 = 50.0, 1000.0
#: Rounding of least squares over thousands of samples, relative to the largest parameter.
ROUNDING = 1e-8
#: Error of an estimate as a share of torque or power: torques held over a sample, and friction of MuJoCo, which slips a little before it
#: slides.
ACCURACY = 0.02
PERIOD = 0.004

#: Share of the longest column of a regressor below which a column is rounding.
VISIBLE = 1e-9

#: Description, tip, and number of base parameters: inertial, with rotors, with viscous and Coulomb friction and offsets.
RANKS = [
    ("ur_description/urdf/ur10_robot.urdf", None, (36, 40, 58)),
    ("panda_description/urdf/panda.urdf", "panda_hand", (43, 48, 69)),
    ("so_arm_description/urdf/so101.urdf", "gripper_link", (31, 34, 49)),
]


@pytest.fixture(scope="module")
def robots() -> Path:
    """Folder of the package's descriptions."""
    try:
        package = metadata.distribution("example-robot-data")
    except metadata.PackageNotFoundError:
        pytest.skip("the package example-robot-data is not installed (extra dev)")
    return Path(str(package.locate_file("cmeel.prefix/share/example-robot-data/robots")))


def pinocchio_model(arm: Arm) -> tuple[Any, Any]:
    """The arm as a model of Pinocchio, joint by joint."""
    pin = pytest.importorskip("pinocchio")
    chain, model, parent = arm.chain, pin.Model(), 0
    assert chain is not None
    for j in range(arm.n_joints):
        of = pin.JointModelRevoluteUnaligned if chain.rotary[j] else pin.JointModelPrismaticUnaligned
        place = pin.SE3(np.array(chain.rotation[j]), np.array(chain.translation[j]))
        parent = model.addJoint(parent, of(np.array(chain.axis[j])), place, f"joint{j}")
        link = pin.Inertia.FromDynamicParameters(np.array(arm.theta[10 * j : 10 * j + 10]))
        model.appendBodyToJoint(parent, link, pin.SE3.Identity())
    model.gravity = pin.Motion(np.array(chain.gravity), np.zeros(3))
    return model, model.createData()


def torque_regressor(arm: Arm, model: Any, data: Any, states: tuple[Array, Array, Array]) -> Array:
    """Regressor over 14 n parameters at rows of positions, velocities and accelerations, shape (rows, n, 14 n)."""
    pin, n = pytest.importorskip("pinocchio"), arm.n_joints
    out = np.zeros((len(states[0]), n, 14 * n))
    for k, (q, dq, ddq) in enumerate(zip(*states, strict=True)):
        out[k, :, : 10 * n] = pin.computeJointTorqueRegressor(model, data, q, dq, ddq)
        for kind, values in enumerate((ddq, dq, np.sign(dq), np.ones(n))):
            out[k, :, (10 + kind) * n : (11 + kind) * n] = np.diag(values)
    return out


@pytest.mark.parametrize(("file", "tip", "ranks"), RANKS, ids=[Path(f).stem for f, _, _ in RANKS])
def test_base_parameters_are_those_of_pinocchios_regressor(
    file: str, tip: str | None, ranks: tuple[int, int, int], robots: Path
) -> None:
    arm = read_model(robots / file, tip=tip)
    model, data = pinocchio_model(arm)
    rng, n = np.random.default_rng(5), arm.n_joints
    states = tuple(rng.uniform(-size, size, (60, n)) for size in (3.0, 2.0, 5.0))
    whole = torque_regressor(arm, model, data, states).reshape(-1, 14 * n)  # type: ignore[arg-type]
    for rank, fixed, asymmetry, columns in (
        (ranks[0], ("rotor", "viscous", "coulomb"), False, 10 * n),
        (ranks[1], ("viscous", "coulomb"), False, 11 * n),
        (ranks[2], (), True, 14 * n),
    ):
        base = base_parameters(arm, fixed=fixed, asymmetry=asymmetry)
        length = np.linalg.norm(whole[:, :columns], axis=0)
        seen = length > VISIBLE * length.max()
        assert np.linalg.matrix_rank(whole[:, :columns][:, seen] / length[seen], tol=1e-6) == rank == len(base.columns)
        kept, rest = whole[:, base.columns], whole[:, base.dependent]
        np.testing.assert_allclose(kept @ base.combination, rest, atol=1e-9 * np.abs(whole).max())
        theta = np.concatenate([arm.theta, rng.normal(size=n)])
        theta[[i for i in range(14 * n) if i not in base.columns and i not in base.dependent]] = 0.0
        np.testing.assert_allclose(kept @ base.of(theta), whole @ theta, atol=1e-9 * np.abs(whole @ theta).max())
        assert len(set(base.names)) == len(base.names)
    assert len(base_parameters(arm).columns) == ranks[2] - n


# Motion of MuJoCo


@dataclass(frozen=True)
class Recorded:
    """Motion of an arm.

    Attributes
    ----------
    arm : armgap.Arm
        The arm, with the true values in `theta`.
    log : armgap.Log
        Ten seconds, with encoders.
    regressor, dq : ndarray, shape (n_rows, n, 14 n) and (n_rows, n)
        Torque regressor and velocities at some true states.
    """

    arm: Arm
    log: Log
    regressor: Array
    dq: Array

    def share(self, error: Array, columns: tuple[int, ...], *, power: bool = False) -> float:
        """Torque that such an error of base parameters makes, of all joints, as a share of their torque, RMS; or power."""
        off = self.regressor[:, :, list(columns)] @ error
        whole = self.regressor[:, :, : 13 * self.arm.n_joints] @ self.arm.theta
        if power:
            off, whole = (np.sum(x * self.dq, axis=1) for x in (off, whole))
        return float(np.sqrt(np.mean(off**2) / np.mean(whole**2)))


@pytest.fixture(scope="module", params=["Panda-like", "R-P-R"])
def recorded(request: pytest.FixtureRequest) -> Recorded:
    """Ten seconds of an arm under position control."""
    pytest.importorskip("mujoco", reason="the extra trial is not installed")
    from serial_trial.arms import FAMILIES, draw_robot
    from serial_trial.case import arm_of
    from serial_trial.effects import Null
    from serial_trial.motion import draw_controller, draw_reference, simulate

    rng = np.random.default_rng(11)
    robot = draw_robot(rng, request.param, len(FAMILIES[request.param].rows))
    samples = round(10.0 / PERIOD)
    reference = draw_reference(robot, samples, PERIOD, rng)
    controller = draw_controller("pd", robot, reference, PERIOD, rng)
    run = simulate(robot, robot, Null(None), reference, controller, np.zeros((samples, robot.n)), PERIOD)
    arm = arm_of(robot, PERIOD, "published")
    rows = slice(50, -50, 10)
    return Recorded(
        arm,
        Log.from_arrays(run.t, run.q, run.tau, name="run", arm=arm),
        torque_regressor(arm, *pinocchio_model(arm), (run.true_q[rows], run.true_dq[rows], run.true_ddq[rows])),
        run.true_dq[rows],
    )


@pytest.mark.parametrize("scheme", armgap.estimation.identification.SCHEMES)
def test_estimates_converge_to_the_true_base_parameters(recorded: Recorded, scheme: Any) -> None:
    arm, log = recorded.arm, recorded.log
    estimator = Estimator(arm, scheme=scheme)
    run = estimator.run(log.q, log.tau, t=log.t)
    assert estimator.base is not None
    truth, power = estimator.base.of(arm.theta), scheme != "filtered-dynamic"
    tenths = [run.theta[k * (len(log.t) - 1) // 10] for k in range(11)]
    off = [recorded.share(theta - truth, estimator.base.columns, power=power) for theta in tenths]
    assert off[-1] < ACCURACY
    assert off[-1] < min(off[1:4])


def test_fixed_parameters_keep_the_arms_values(recorded: Recorded) -> None:
    arm, log = recorded.arm, recorded.log
    n = arm.n_joints
    links = arm.parameter_names[: 10 * n]
    estimator = Estimator(arm, scheme="filtered-dynamic", fixed=links)
    estimator.run(log.q, log.tau, t=log.t)
    assert estimator.parameter_names == arm.parameter_names[10 * n :]
    base = estimator.base
    assert base is not None
    assert base.fixed == links
    assert recorded.share(estimator.theta - arm.theta[10 * n :], base.columns) < ACCURACY
    # Wrong values of fixed parameters are wrong torques.
    theta = arm.theta.copy()
    theta[10 * n - 10 : 10 * n] *= 2
    wrong = Estimator(dataclasses.replace(arm, theta=theta), scheme="filtered-dynamic", fixed=links)
    wrong.run(log.q, log.tau, t=log.t)
    assert recorded.share(wrong.theta - arm.theta[10 * n :], base.columns) > 2 * ACCURACY


# The same filtered regressors, built from Pinocchio's by scipy's filters


class Rows:
    """Momentum, what is left of the torque without its rate, and energy over 11 n parameters, at rows of states."""

    def __init__(self, arm: Arm, q: Array, dq: Array) -> None:
        pin = pytest.importorskip("pinocchio")
        model, data = pinocchio_model(arm)
        n, still = arm.n_joints, np.zeros(arm.n_joints)
        rotors = np.stack([np.diag(v) for v in dq])

        def torque(q: Array, dq: Array, ddq: Array) -> Array:
            return np.array(pin.computeJointTorqueRegressor(model, data, q, dq, ddq))

        def momentum(q: Array, dq: Array) -> Array:
            return torque(q, still, dq) - torque(q, still, still)

        def rate(q: Array, dq: Array) -> Array:
            # Five-point rule along the motion.
            s = 1e-3
            at = [momentum(q + k * s * dq, dq) for k in (-2, -1, 1, 2)]
            return np.asarray((at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * s))

        def energy(q: Array, dq: Array) -> Array:
            kinetic = np.array(pin.computeKineticEnergyRegressor(model, data, q, dq)).ravel()
            return kinetic + np.array(pin.computePotentialEnergyRegressor(model, data, q)).ravel()

        rest = [torque(q, dq, still) - rate(q, dq) for q, dq in zip(q, dq, strict=True)]
        self.momentum = np.concatenate([[momentum(*s) for s in zip(q, dq, strict=True)], rotors], axis=2)
        self.rest = np.concatenate([rest, np.zeros((len(q), n, n))], axis=2)
        self.energy = np.concatenate([[energy(*s) for s in zip(q, dq, strict=True)], dq**2 / 2], axis=1)


def _friction(values: Array) -> Array:
    """A row per joint with its own entry, shape (rows, n, n)."""
    return np.asarray(values[:, :, None] * np.eye(values.shape[1]))


def filtered_rows(arm: Arm, log: Log, scheme: str, filters: str) -> tuple[Array, Array]:
    """Rows over 13 n parameters, and outputs, of all samples but the first; velocities are those of the log."""
    assert log.dq is not None
    h, q, dq, tau = float(log.t[1] - log.t[0]), log.q, log.dq, log.tau
    a = np.exp(-h * CUTOFF_RAD_S)
    rows = Rows(arm, q, dq)

    def held(x: Array) -> Array:
        return np.asarray(lfilter([0.0, 1 - a], [1.0, -a], x, axis=0))

    if filters == "paper":

        def derivative(x: Array) -> Array:
            return np.asarray(lfilter([CUTOFF_RAD_S, -CUTOFF_RAD_S], [1.0, -a], x - x[0], axis=0))

        if scheme == "filtered-dynamic":
            inertial = derivative(rows.momentum) + held(rows.rest)
            psi = np.concatenate([inertial, _friction(held(dq)), _friction(held(np.sign(dq)))], axis=2)
            return psi[1:], held(tau)[1:]
        lost, power = np.concatenate([dq**2, np.abs(dq)], axis=1), np.sum(tau * dq, axis=1)
        if scheme == "filtered-power":
            psi = np.concatenate([derivative(rows.energy), held(lost)], axis=1)
            return psi[1:, None], held(power)[1:, None]
        both = np.column_stack([lost, power])
        integrals = np.concatenate([np.zeros((1, both.shape[1])), np.cumsum(both[1:] + both[:-1], axis=0) * h / 2])
        psi = np.concatenate([rows.energy - rows.energy[0], integrals[:, :-1]], axis=1)
        return psi[1:, None], integrals[1:, -1:]

    mean = (1 - a) / (h * CUTOFF_RAD_S)

    def ramp(x: Array, start: Array | float = 0.0) -> Array:
        # The ramp's filter over y - start, which begins at zero.
        return np.asarray(lfilter([1 - mean, mean - a], [1.0, -a], x - start, axis=0) + start)

    def steady(x: Array) -> Array:
        return ramp(x, x[0])

    low = steady(rows.momentum)
    # From rest: the first input counts from the first interval on.
    rest = np.asarray(lfilter([1 - mean, mean - a], [1.0, -a], rows.rest, axis=0))
    rest -= (1 - mean) * rows.rest[0] * (a ** np.arange(len(q)))[:, None, None]
    viscous = np.asarray(lfilter([1 - mean, mean - a], [1.0, -a], dq, axis=0))
    viscous -= (1 - mean) * dq[0] * (a ** np.arange(len(q)))[:, None]
    coulomb = np.zeros_like(dq)
    for k in range(1, len(q)):
        start, end = dq[k - 1], dq[k]
        crossing = np.where(start * end < 0, start / np.where(start == end, 1.0, start - end), 1.0)
        after = np.exp(-h * CUTOFF_RAD_S * (1 - crossing))
        sign = np.where(start != 0, np.sign(start), np.sign(end))
        turned = np.where(start * end < 0, np.sign(end), sign)
        coulomb[k] = a * coulomb[k - 1] + sign * (after - a) + turned * (1 - after)
    inertial = (rows.momentum - low) * CUTOFF_RAD_S + rest
    psi = np.concatenate([inertial, _friction(viscous), _friction(coulomb)], axis=2)
    return psi[1:], held(tau)[1:]


@pytest.mark.parametrize("form", ["plain", "factorized"])
@pytest.mark.parametrize(
    ("scheme", "filters"),
    [
        ("filtered-dynamic", "exact"),
        ("filtered-dynamic", "paper"),
        ("filtered-power", "paper"),
        ("supplied-energy", "paper"),
    ],
)
def test_the_last_estimate_is_batch_least_squares(recorded: Recorded, scheme: Any, filters: Any, form: Any) -> None:
    arm, log = recorded.arm, recorded.log
    h = float(log.t[1] - log.t[0])
    count = 800
    q, tau, t = log.q[:count], log.tau[:count], log.t[:count]
    dq = np.gradient(log.q, h, axis=0)[:count]
    log = Log.from_arrays(t, q, tau, dq=dq, name="run", arm=arm)
    estimator = Estimator(arm, scheme=scheme, filters=filters, form=form)
    estimator.run(q, tau, dq, h=h)
    assert estimator.base is not None
    psi, y = filtered_rows(arm, log, scheme, filters)
    matrix = psi[:, :, list(estimator.base.columns)].reshape(-1, len(estimator.base.columns))
    # Equations (20) and (21) from P(0) = p0 I are least squares with a prior of that variance.
    stacked = np.vstack([matrix, np.eye(matrix.shape[1]) / np.sqrt(P0)])
    batch = np.linalg.lstsq(stacked, np.concatenate([y.ravel(), np.zeros(matrix.shape[1])]), rcond=None)[0]
    off = np.abs(estimator.theta - batch).max() / np.abs(batch).max()
    assert off < ROUNDING, off
    r = np.linalg.inv(np.linalg.qr(stacked)[1])
    np.testing.assert_allclose(np.diag(estimator.covariance), np.sum(r**2, axis=1), rtol=1e-6)


# From Python and the command line


def test_checkpoints_precisions_and_one_by_one(recorded: Recorded) -> None:
    arm, log = recorded.arm, recorded.log
    single = Estimator(arm, single=True, scheme="filtered-dynamic")
    double = Estimator(arm, scheme="filtered-dynamic")
    whole = double.run(log.q, log.tau, h=PERIOD)
    single.run(log.q, log.tau, h=PERIOD)
    base = double.base
    assert base is not None
    assert recorded.share(single.theta - double.theta, base.columns) < ACCURACY
    again = Estimator(arm, scheme="filtered-dynamic")
    for q, tau in zip(log.q[:40], log.tau[:40], strict=True):
        again.update(q, tau, h=PERIOD)
    twin = again.copy()
    np.testing.assert_array_equal(twin.theta, whole.theta[39])
    assert twin.update(log.q[40], log.tau[40], h=PERIOD) == "updated"
    np.testing.assert_array_equal(twin.theta, whole.theta[40])
    np.testing.assert_array_equal(again.theta, whole.theta[39])
    assert twin.errors.shape == (arm.n_joints,)


def test_identify_reports_combinations(recorded: Recorded) -> None:
    arm, log = recorded.arm, recorded.log
    found = identify(log, arm, scheme="filtered-dynamic", asymmetry=True)
    assert found.base is not None
    assert len(found.theta) == len(found.base.columns) == len(found.parameter_units)
    np.testing.assert_allclose(found.nominal[: -arm.n_joints], found.base.of(arm.theta)[: -arm.n_joints])
    assert np.isnan(found.nominal[-arm.n_joints :]).all()
    data = json.loads(found.to_json())["parameters"]
    assert [data[name]["combination"] for name in found.parameter_names] == list(found.base.texts)
    assert any("+" in text for text in found.base.texts)


def test_command_line(recorded: Recorded, tmp_path: Path, run: Run) -> None:
    arm, log = recorded.arm, recorded.log
    (tmp_path / "arm.toml").write_text(arm.to_toml())
    log.write(tmp_path / "run.parquet")
    words = ("identify", str(tmp_path / "run.parquet"), "--arm", str(tmp_path / "arm.toml"))
    code, out, err = run(
        *words, "--scheme", "filtered-dynamic", "--fixed", "rotor", "--json", str(tmp_path / "out.json")
    )
    assert code == 0, err
    (result,) = json.loads((tmp_path / "out.json").read_text())
    assert not any(name.startswith("rotor") for name in result["parameters"])
    assert "Base parameters" in out
    assert "coulomb1" in out
    code, out, err = run(*words, "--fixed", "rotors")
    assert code != 0
    assert "no parameter is called `rotors`" in err


def test_what_cannot_be_fixed() -> None:
    with pytest.raises(OptionError, match="kind `two-link`"):
        Estimator("two-link", fixed=["theta1"])
    with pytest.raises(OptionError, match="known: axis"):
        Estimator("serial")
