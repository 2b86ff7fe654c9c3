"""Nine parameters fitted by output error, by several packages on one log: time, rollouts, and distance of the result from the truth.

The log is the run of ten seconds of Reyes and Kelly (1997) with dry friction, positions of the exact integrator, cut into windows of 0.25 s
with known initial states; every fit starts 20 % away from the truth and predicts the positions of all windows. Markdown on standard output.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import io
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from compare import H, present, row

import armgap
from armgap import Arm, identify, seed_torque, simulate

TRUTH = np.array([2.3516, 0.0838, 0.1019, 38.465, 1.827, 2.288, 0.175, 7.6095, 1.734])
START = TRUTH * (1.0 + 0.2 * np.resize([1.0, -1.0], 9))
SAMPLES, WINDOW = 4000, 100
#: Number of windows out of which the slowest solver is given only one.
FEW = 8
#: Width of the smooth sign of the velocity for solvers that cannot take a jump of friction [rad/s].
SMOOTHING = 0.01
Rollout = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Case:
    """A log cut into windows, of which each ``every``-th is used: times [s], positions, velocities and torques."""

    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    tau: np.ndarray

    every: int = 1

    @property
    def starts(self) -> range:
        return range(0, len(self.t) - WINDOW, WINDOW * self.every)

    @property
    def measured(self) -> np.ndarray:
        """Positions after every period of every window [rad]."""
        return np.concatenate([self.q[k + 1 : k + 1 + WINDOW] for k in self.starts])


@dataclass(frozen=True)
class Fit:
    """Result of one package: parameters, time [s], and number of rollouts; None for a package that does none."""

    theta: np.ndarray
    seconds: float
    rollouts: int | None


def make_case() -> Case:
    arm = Arm("arm", "two-link", 9.81, H, TRUTH, 0.1 * TRUTH)
    t = np.arange(SAMPLES + 1) * H
    log = simulate(arm, t, seed_torque(t), sensor=True, name="seed")
    return Case(t, *(np.ascontiguousarray(x) for x in (log.q, log.dq, log.tau)))


# ---- rollouts ---------------------------------------------------------------------------------------------------------------


def plain_c(case: Case, folder: str) -> Rollout | None:
    """Function that predicts the positions of all windows by ``rollout.c``, called through ctypes."""
    source = Path(__file__).with_name("rollout.c")
    if not source.exists() or shutil.which("cc") is None:
        print(f"skipped: {source.name} or cc is missing", file=sys.stderr)
        return None
    library = Path(folder) / "rollout.so"
    subprocess.run(["cc", "-O3", "-shared", "-fPIC", str(source), "-lm", "-o", str(library)], check=True)
    function = ctypes.CDLL(str(library)).baseline_rollout
    number, pointer = ctypes.c_double, np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
    function.argtypes, function.restype = [pointer, pointer, pointer, number, ctypes.c_long, pointer], None
    starts = [np.concatenate([case.q[k], case.dq[k]]) for k in case.starts]

    def predict(theta: np.ndarray) -> np.ndarray:
        out = np.empty((len(starts) * WINDOW, 2))
        theta = np.ascontiguousarray(theta)
        for i, (k, x) in enumerate(zip(case.starts, starts, strict=True)):
            function(theta, x, case.tau[k : k + WINDOW], H, WINDOW, out[i * WINDOW :])
        return out

    return predict


def with_solve_ivp(case: Case) -> Rollout:
    """Function that predicts the positions of all windows by scipy's Runge-Kutta, with smooth friction, restarted where the torque jumps."""
    from scipy.integrate import solve_ivp

    def slope(_: float, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> list[float]:
        q1, q2, v1, v2 = x
        c, s, outer = np.cos(q2), np.sin(q2), p[4] * np.sin(q1 + q2)
        m11, m12 = p[0] + 2 * p[1] * c, p[2] + p[1] * c
        rest = p[1] * s
        r1 = u[0] + rest * v2 * (2 * v1 + v2) - p[3] * np.sin(q1) - outer - p[5] * v1 - p[7] * np.tanh(v1 / SMOOTHING)
        r2 = u[1] - rest * v1**2 - outer - p[6] * v2 - p[8] * np.tanh(v2 / SMOOTHING)
        det = m11 * p[2] - m12**2
        return [v1, v2, (p[2] * r1 - m12 * r2) / det, (m11 * r2 - m12 * r1) / det]

    def predict(theta: np.ndarray) -> np.ndarray:
        path = []
        for k in case.starts:
            x = np.concatenate([case.q[k], case.dq[k]])
            for u in case.tau[k : k + WINDOW]:
                x = solve_ivp(slope, (0.0, H), x, args=(u, theta), rtol=1e-6, atol=1e-8).y[:, -1]
                path.append(x[:2])
        return np.array(path)

    return predict


# ---- fits -------------------------------------------------------------------------------------------------------------------


def by_scipy(case: Case, predict: Rollout) -> Fit:
    """Fit by ``scipy.optimize.least_squares`` of factors of the initial parameters, so that all are of one size."""
    from scipy.optimize import least_squares

    count = 0
    measured = case.measured

    def residual(share: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        return (predict(START * share) - measured).ravel()

    begin = time.perf_counter()
    found = least_squares(residual, np.ones(9), bounds=(0.2, 5.0), xtol=1e-10, ftol=1e-12, gtol=1e-12)
    return Fit(START * found.x, time.perf_counter() - begin, count)


def by_sysid(case: Case) -> Fit:
    """Fit by ``mujoco.sysid.optimize`` with its own optimiser."""
    from armgap.trial.baselines.mujoco_model import build_spec, set_coulomb, set_inertial

    sysid = importlib.import_module("mujoco.sysid")
    arm = Arm("arm", "two-link", 9.81, H, START, 0.1 * START)
    spec = build_spec(arm)
    model = spec.compile()
    control, sensors, starts = [], [], []
    for k in case.starts:
        held = case.tau[k : k + WINDOW]
        control.append(sysid.TimeSeries(H * np.arange(WINDOW + 1), np.vstack([held, held[-1:]])))
        sensors.append(sysid.TimeSeries.from_names(H * np.arange(1, WINDOW + 1), case.q[k + 1 : k + 1 + WINDOW], model))
        starts.append(sysid.create_initial_state(model, case.q[k], case.dq[k]))
    names = [f"window {i}" for i in range(len(starts))]
    rollouts = 0

    def compare(params: Any, predicted: Any, measured: Any, model: Any, return_all: bool, *, state: np.ndarray) -> Any:
        nonlocal rollouts
        rollouts += 1
        shown = state[: len(measured.data), 1:3]  # the sensors of a step are those of its start
        return (
            (shown - measured.data).ravel(),
            sysid.TimeSeries(measured.times, shown, measured.signal_mapping),
            measured,
        )

    def inertial(spec: Any, p: Any) -> None:
        set_inertial(spec, arm, p.value)

    def friction(spec: Any, p: Any) -> None:
        for j in range(2):
            spec.joint(f"joint{j}").damping = [p.value[j], 0.0, 0.0]
            set_coulomb(spec, j, p.value[2 + j])

    params = sysid.ParameterDict()
    params.add(sysid.Parameter("inertial", START[:5], 0.5 * START[:5], 2.0 * START[:5], modifier=inertial))
    params.add(sysid.Parameter("friction", START[5:], 0.2 * START[5:], 5.0 * START[5:], modifier=friction))
    residual = sysid.build_residual_fn(
        models_sequences=[sysid.ModelSequences("arm", spec, names, starts, control, sensors)],
        modify_residual=compare,
        n_threads=1,
        resample_true=False,
    )
    begin = time.perf_counter()
    with contextlib.redirect_stdout(io.StringIO()):
        _, result = sysid.optimize(params, residual, optimizer="mujoco", verbose=False, x_scale=START, max_iters=50)
    return Fit(np.asarray(result.x), time.perf_counter() - begin, rollouts // len(starts))


def by_armgap(case: Case) -> Fit:
    """Fit by armgap, which takes the initial states of windows from positions alone."""
    arm = Arm("arm", "two-link", 9.81, H, START, 0.1 * START)
    log = simulate(Arm("arm", "two-link", 9.81, H, TRUTH, 0.1 * TRUTH), case.t, case.tau)
    begin = time.perf_counter()
    theta = armgap.fit(log, arm).theta
    return Fit(theta, time.perf_counter() - begin, None)


def by_least_squares(case: Case) -> Fit:
    """Estimate from the positions by armgap's recursive filtered power model, which does no rollouts."""
    arm = Arm("arm", "two-link", 9.81, H, START, 0.1 * START)
    log = simulate(Arm("arm", "two-link", 9.81, H, TRUTH, 0.1 * TRUTH), case.t, case.tau)
    begin = time.perf_counter()
    found = identify(log, arm)
    return Fit(np.asarray(found.theta), time.perf_counter() - begin, None)


def main() -> None:
    case = make_case()
    row("fit of nine parameters, 10 s, 40 windows of 0.25 s", "time", "runs of the log", "largest error of a parameter")
    row("---", "---", "---", "---")

    def line(name: str, fit: Fit | None) -> None:
        if fit is not None:
            off = np.max(np.abs(fit.theta / TRUTH - 1.0))
            count = "" if fit.rollouts is None else fit.rollouts
            row(name, f"{fit.seconds * 1e3:.1f} ms", count, f"{off:.1e}")

    line("armgap, output error", by_armgap(case))
    line("armgap.identify, filtered power: no rollouts", by_least_squares(case))
    if present("scipy"):
        with tempfile.TemporaryDirectory() as folder:
            predict = plain_c(case, folder)
            if predict is not None:
                line("scipy least_squares around plain C, exact dry friction", by_scipy(case, predict))
    if present("mujoco", "mujoco.sysid"):
        line("mujoco.sysid", by_sysid(case))
    if present("scipy"):
        few = replace(case, every=FEW)
        name = f"scipy least_squares around solve_ivp, smoothed friction, one window of {FEW}"
        line(name, by_scipy(few, with_solve_ivp(few)))


if __name__ == "__main__":
    main()
