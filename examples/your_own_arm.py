"""Your own arm: a CSV with its own names and units, an arm file that maps them, a report for the pull request."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import polars as pl

from armgap import Arm, Log, diagnose, simulate
from armgap.report import diagnosis_report
from armgap.simulation import Effect

ARM_FILE = """\
name = "bench pendulum"
kind = "pendulum"
gravity = 9.81
sample_period = 0.004

[inertial]
theta = [0.05, 0.6]          # inertia about the axis [kg m^2], m g l [N m]

[friction]
viscous = [0.02]
coulomb = [0.1]

[columns]                    # how this rig names its columns
t = "Zeit (ms)"
q1 = "shoulder pos. [deg]"
tau1 = "i_q * k_t"
"""


def record(arm: Arm, path: Path, seed: int) -> None:
    """What the rig would have written: milliseconds, degrees, names of its own; its motor dies below 0.08 N m."""
    t = np.arange(2000) * arm.sample_period
    draw = np.random.default_rng(seed).uniform(size=(3, 5))
    tau = ((0.1 + 0.3 * draw[0]) * np.sin(np.outer(t, 0.5 + 8.5 * draw[1]) + 6 * draw[2])).sum(axis=1)
    log = simulate(arm, t, tau, effects=[Effect("torque_dead_zone", 1, {"level": 0.08})], noise=2e-4, seed=seed)
    columns = {"Zeit (ms)": 1e3 * log.t, "shoulder pos. [deg]": np.degrees(log.q[:, 0]), "i_q * k_t": tau}
    pl.DataFrame(columns | {"temp": np.full(len(t), 41.5)}).write_csv(path)


with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    (folder / "arm.toml").write_text(ARM_FILE)
    arm = Arm.read(folder / "arm.toml")
    for seed in (1, 2):
        record(arm, folder / f"run{seed}.csv", seed)
    training, held = (Log.read(folder / f"run{s}.csv", arm=arm, units={"t": "ms", "q": "deg"}) for s in (1, 2))

diagnosis = diagnose(training, arm, holdout=held)
print("\n".join(diagnosis_report(diagnosis, "report.md").splitlines()[:16]))
