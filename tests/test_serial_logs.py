"""Checks of serial arms' logs against each other and against time: late torques, limited drives, loads, walls, logs of different states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from armgap import Arm, Log, simulate
from armgap.arm.corrections import Corrections
from armgap.check.serial.contradictions import contradictions
from armgap.check.serial.late_torques import late_torques
from armgap.check.serial.logs_differ import logs_differ
from armgap.errors import OptionError
from armgap.simulation import Effect
from test_serial_diagnosis import PERIOD, THREE, torques

SECONDS = 8.0


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    path = tmp_path_factory.mktemp("serial") / "arm.toml"
    path.write_text(THREE)
    return Arm.read(path)


def log(arm: Arm, number: int, *effects: Effect) -> Log:
    t, tau = torques(number, SECONDS)
    return simulate(arm, t, tau, effects=effects, noise=2e-6, seed=number, tolerance=1e-8, name=f"log-{number}")


@pytest.fixture(scope="module")
def quiet(arm: Arm) -> list[Log]:
    return [log(arm, number) for number in range(3)]


def heavier(arm: Arm, mass: float) -> Arm:
    """The arm with a mass on its last link [kg], 0.2 m from the last joint and 0.1 m off its axis."""
    theta = arm.theta.copy()
    x, y = 0.1, -0.2
    theta[20:30] += mass * np.array([1.0, x, y, 0.0, y * y, -x * y, x * x, 0.0, 0.0, x * x + y * y])
    return replace(arm, theta=theta)


@pytest.mark.parametrize("samples", [2, 5])
def test_torques_late_in_the_file_are_shifted_back(samples: int, quiet: list[Log], arm: Arm) -> None:
    late = [Corrections(shift={"tau": samples * PERIOD}).on_log(log) for log in quiet]
    corrections, [check] = late_torques(late, arm, repair=True)
    assert (check.check, check.severity) == ("time_shift", "repaired")
    assert corrections.shift["tau"] == pytest.approx(-samples * PERIOD, abs=0.6 * PERIOD)
    corrections, [check] = late_torques(late, arm, repair=False)
    assert (check.severity, corrections.shift) == ("warning", {})


def test_torques_in_time_or_early_are_not_late(quiet: list[Log], arm: Arm) -> None:
    early = [Corrections(shift={"tau": -3 * PERIOD}).on_log(log) for log in quiet]
    assert late_torques(quiet, arm, repair=True)[1] == late_torques(early, arm, repair=True)[1] == []


def test_a_limited_drive_is_no_other_unit(arm: Arm) -> None:
    limited = [log(arm, number, Effect("torque_saturation", 2, {"level": 1.5})) for number in range(3)]
    corrections, checks = contradictions(limited, arm)
    assert (checks, corrections) == ([], Corrections())


def test_a_load_is_no_other_unit(arm: Arm) -> None:
    loaded = [log(heavier(arm, 4.0), number) for number in range(3)]
    corrections, checks = contradictions(loaded, arm)
    assert (checks, corrections) == ([], Corrections())


@pytest.mark.parametrize("direction", ["+x", "-y"])
def test_an_arm_on_a_wall(direction: str, arm: Arm) -> None:
    wall = Corrections(gravity=direction).on_arm(arm)  # type: ignore[arg-type]
    assert wall.gravity == pytest.approx(9.81)
    corrections, [check] = contradictions([log(wall, number) for number in range(3)], arm)
    assert (check.check, check.severity) == ("gravity_direction", "error")
    assert check.remedies[0] == f"--gravity {direction}"
    assert corrections.gravity == direction


def test_a_pendulum_has_no_axes_for_gravity() -> None:
    pendulum = Arm("bench", "pendulum", 9.81, 0.004, np.array([0.1, 1.0, 0.1, 0.1]), sigma=np.full(4, 0.1))
    with pytest.raises(OptionError, match=r"\+x"):
        Corrections(gravity="+x").on_arm(pendulum)


def test_logs_of_different_states_are_said(quiet: list[Log], arm: Arm) -> None:
    assert logs_differ(quiet, arm) == []
    assert logs_differ(quiet[:1], arm) == []
    loaded = log(heavier(arm, 1.5), 4)
    [check] = logs_differ([*quiet, loaded], arm)
    assert (check.check, check.severity, check.log) == ("logs_differ", "warning", loaded.name)
    assert "log-4 differs from the other logs" in check.message
    [check] = logs_differ([quiet[0], loaded], arm)
    assert check.log is None
    assert "differ from each other" in check.message


def test_dense_logs_are_compared_over_more_than_a_second(arm: Arm) -> None:
    def dense(number: int) -> Log:
        """A log at 2.5 kHz under random torques of 3 % of its own, which it does not hold."""
        t, tau = torques(number, SECONDS)
        _, disturbance = torques(100 + number, SECONDS)
        moved = simulate(arm, t, tau + 0.03 * disturbance, noise=2e-6, seed=number, tolerance=1e-8)
        fine = np.arange(10 * (len(t) - 1) + 1) * PERIOD / 10
        q = CubicSpline(t, moved.q)(fine)
        return Log.from_arrays(fine, q, np.repeat(tau, 10, axis=0)[: len(fine)], name=f"dense-{number}")

    assert logs_differ([dense(number) for number in range(3)], arm) == []
