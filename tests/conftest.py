"""Fixtures that several tests share: arms, logs, and calls of the command line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import three_joints
from armgap import Arm, Log, seed_torque, simulate
from swings import PENDULUM

# Reyes and Kelly (1997), Table I, with the encoders and torque limits of section 5; friction of joint 1 at its mean.
TABLE_ONE = """\
name = "Reyes-Kelly direct-drive arm"
kind = "two-link"
gravity = 9.81
sample_period = 0.0025

[links]
mass = [23.902, 3.880]
length = [0.45, 0.30]
com = [0.091, 0.048]
inertia = [1.266, 0.093]

[friction]
viscous = [2.288, 0.175]
coulomb = [7.6095, 1.734]

[encoder]
counts_per_rev = [1024000, 655360]

[actuator]
torque_limit = [200.0, 15.0]
"""


#: Test files that take more than a few seconds (`pytest --durations=0`); `make check` leaves them out.
SLOW = {
    "test_back_into_simulator", "test_commanded", "test_crosswise", "test_custom_effects", "test_demo", "test_docs", "test_docs_blocks",
    "test_docs_site", "test_export_serial", "test_fleet", "test_fleet_drift", "test_hidden_states", "test_log_damaged",
    "test_odd_input", "test_output", "test_plan", "test_progress", "test_pushes", "test_report", "test_report_browser", "test_reproduce",
    "test_rivals", "test_rounded_friction", "test_second_simulator", "test_serial_diagnosis", "test_serial_identification",
    "test_serial_trial", "test_trial", "test_trial_baselines", "test_trial_command", "test_trial_physics",
    "test_trial_scoring", "test_verdicts", "test_where",
}  # fmt: skip


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Skip the import of slow test files where their tests are deselected, because it takes as long as many tests."""
    return True if config.option.markexpr == "not slow" and collection_path.stem in SLOW else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests in slow files with the marker `slow`."""
    for item in items:
        if item.path.stem in SLOW:
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def arm_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("arm") / "arm.toml"
    path.write_text(TABLE_ONE)
    return path


@pytest.fixture(scope="session")
def arm(arm_file: Path) -> Arm:
    return Arm.read(arm_file)


@pytest.fixture(scope="session")
def pendulum(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    path = tmp_path_factory.mktemp("pendulum") / "pendulum.toml"
    path.write_text(PENDULUM)
    return Arm.read(path)


@pytest.fixture(scope="session")
def seed_log(arm: Arm) -> Log:
    """Return a log of two seconds of the arm of Table I under the torques of Reyes and Kelly (1997), with measured velocities."""
    t = np.arange(800) * arm.sample_period
    return simulate(arm, t, seed_torque(t), sensor=True, name="seed")


@pytest.fixture
def frame(seed_log: Log) -> pl.DataFrame:
    """Return the columns of `seed_log` as a table."""
    return seed_log.to_polars()


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Return a function that runs the command line in this process and returns status, standard output and standard error."""
    from armgap.cli import main

    def call(*arguments: str | Path) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main([str(a) for a in arguments])
        out, err = capsys.readouterr()
        return int(stop.value.code or 0), out, err

    return call


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def three(here: Path) -> Path:
    """Return a folder with the URDF and the arm file of `three_joints`."""
    (here / "three.urdf").write_text(three_joints.URDF)
    (here / "arm.toml").write_text(three_joints.ARM)
    return here
