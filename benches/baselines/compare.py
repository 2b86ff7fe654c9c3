"""Times of armgap's estimator and simulation and of well-known packages, with ratios and differences of results. Markdown on standard output.

Estimation: filtered power with the filters of Reyes and Kelly (1997) on their run; other packages get regressor rows filtered by numpy
and scipy, so they do less work. Simulation: two seconds of the arm without dry friction; differences are to scipy's DOP853 at 1e-12.
"""

from __future__ import annotations

import importlib
import statistics
import sys
import time
from collections.abc import Callable

import numpy as np

from armgap import Arm, Estimator, seed_torque, simulate

H, CUTOFF, P0, ROUNDS = 0.0025, 50.0, 1000.0, 7
LINKS = {"m": (23.902, 3.880), "l": (0.45, 0.30), "c": (0.091, 0.048), "i": (1.266, 0.093)}
GRAVITY, VISCOUS = 9.81, (2.288, 0.175)


def exact_theta() -> list[float]:
    (m1, m2), (l1, _), (c1, c2), (i1, i2) = (LINKS[k] for k in "mlci")
    inertia = [m1 * c1**2 + m2 * l1**2 + m2 * c2**2 + i1 + i2, l1 * m2 * c2, m2 * c2**2 + i2]
    return [*inertia, GRAVITY * (c1 * m1 + m2 * l1), GRAVITY * m2 * c2]


def arm(coulomb: tuple[float, float]) -> Arm:
    theta = np.array([*exact_theta(), *VISCOUS, *coulomb])
    return Arm("arm", "two-link", GRAVITY, H, theta, 0.1 * np.abs(theta) + 0.01)


def timed(work: Callable[[], object]) -> float:
    """Median time of a call of ``work`` [s]."""
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def row(*cells: object) -> None:
    print("| " + " | ".join(str(c) for c in cells) + " |", flush=True)


def present(*names: str) -> bool:
    try:
        for name in names:
            importlib.import_module(name)
    except ImportError as missing:
        print(f"skipped: {missing.name} is not installed", file=sys.stderr)
        return False
    return True


# ---- estimation -------------------------------------------------------------------------------------------------------------


def regressors(q: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Regressor rows and outputs of the filtered power model, Reyes and Kelly (1997), equation (30), with their filters."""
    from scipy.signal import lfilter

    dq = np.vstack([np.zeros(2), np.diff(q, axis=0) / H])
    v1, v2, s = dq[:, 0], dq[:, 1], dq.sum(axis=1)
    energy = [
        0.5 * v1**2,
        np.cos(q[:, 1]) * v1 * s,
        v2 * (v1 + 0.5 * v2),
        1 - np.cos(q[:, 0]),
        1 - np.cos(q.sum(axis=1)),
    ]
    power = [v1**2, v2**2, np.abs(v1), np.abs(v2)]
    a = np.exp(-CUTOFF * H)
    derivative = [lfilter([CUTOFF, -CUTOFF], [1, -a], e - e[0]) for e in energy]
    low = [lfilter([0, 1 - a], [1, -a], x) for x in (*power, (tau * dq).sum(axis=1))]
    return np.column_stack([*derivative, *low[:-1]])[1:], low[-1][1:]


def numpy_rls(psi: np.ndarray, y: np.ndarray) -> np.ndarray:
    theta, p = np.zeros(psi.shape[1]), P0 * np.eye(psi.shape[1])
    for x, target in zip(psi, y, strict=True):
        g = p @ x
        scale = 1 / (1 + x @ g)
        theta = theta + g * ((target - x @ theta) * scale)
        p = p - np.outer(g, g) * scale
    return theta


def padasip_rls(psi: np.ndarray, y: np.ndarray) -> np.ndarray:
    import padasip

    adaptive = padasip.filters.FilterRLS(n=psi.shape[1], mu=1.0, eps=1 / P0, w="zeros")
    for x, target in zip(psi, y, strict=True):
        adaptive.adapt(target, x)
    return np.asarray(adaptive.w)


def filterpy_rls(psi: np.ndarray, y: np.ndarray) -> np.ndarray:
    from filterpy.kalman import KalmanFilter

    kalman = KalmanFilter(dim_x=psi.shape[1], dim_z=1)
    kalman.P *= P0
    kalman.R *= 1.0
    for x, target in zip(psi, y, strict=True):
        kalman.update(target, H=x[None, :])
    return np.asarray(kalman.x).ravel()


def estimation() -> None:
    true = arm((7.6095, 1.734))
    t = np.arange(4000) * H
    log = simulate(true, t, seed_torque(t), name="seed")
    q, tau = np.ascontiguousarray(log.q), np.ascontiguousarray(log.tau)
    ours = Estimator("two-link", filters="paper").run(q, tau, h=H).theta[-1]
    base = timed(lambda: Estimator("two-link", filters="paper").run(q, tau, h=H)) / len(t)
    row("estimation, filtered power, 9 parameters", "per sample", "ratio", "estimates differ")
    row("---", "---", "---", "---")
    row("armgap.Estimator.run: filters, regressor, least squares", f"{base * 1e9:.0f} ns", "1", "0")
    psi, y = regressors(q, tau)
    for name, package, work in (
        ("numpy: least squares alone", "numpy", numpy_rls),
        ("padasip FilterRLS: least squares alone", "padasip", padasip_rls),
        ("filterpy KalmanFilter.update: least squares alone", "filterpy", filterpy_rls),
    ):
        if present(package):
            cost = timed(lambda work=work: work(psi, y)) / len(t)
            with np.errstate(all="ignore"):
                off = np.max(np.abs(work(psi, y) / ours - 1))
            row(name, f"{cost * 1e9:.0f} ns", f"{cost / base:.0f}", f"{off:.0e}")


# ---- simulation -------------------------------------------------------------------------------------------------------------

XML = """<mujoco><option timestep="{h}" gravity="0 0 -{g}" integrator="RK4"><flag contact="disable"/></option>
<worldbody><body><inertial pos="0 0 -{c1}" mass="{m1}" diaginertia="{i1} {i1} {i1}"/><joint type="hinge" axis="0 1 0" damping="{b1}"/>
<body pos="0 0 -{l1}"><inertial pos="0 0 -{c2}" mass="{m2}" diaginertia="{i2} {i2} {i2}"/><joint type="hinge" axis="0 1 0" damping="{b2}"/>
</body></body></worldbody><actuator><motor joint="j1"/><motor joint="j2"/></actuator></mujoco>"""


def mujoco_xml() -> str:
    (m1, m2), (l1, _), (c1, c2), (i1, i2) = (LINKS[k] for k in "mlci")
    values = {"m1": m1, "m2": m2, "l1": l1, "c1": c1, "c2": c2, "i1": i1, "i2": i2}
    text = XML.format(h=H, g=GRAVITY, b1=VISCOUS[0], b2=VISCOUS[1], **values)
    return text.replace("<joint", '<joint name="j1"', 1).replace("<joint type", '<joint name="j2" type', 1)


def with_mujoco(tau: np.ndarray) -> tuple[Callable[[], np.ndarray], Callable[[], object]]:
    import mujoco
    import mujoco.rollout

    model = mujoco.MjModel.from_xml_string(mujoco_xml())
    data = mujoco.MjData(model)

    def steps() -> np.ndarray:
        mujoco.mj_resetData(model, data)
        path = np.empty((len(tau), 2))
        for k, u in enumerate(tau):
            path[k] = data.qpos
            data.ctrl[:] = u
            mujoco.mj_step(model, data)
        return path

    def rollout() -> object:
        mujoco.mj_resetData(model, data)
        spec = mujoco.mjtState.mjSTATE_FULLPHYSICS
        start = np.zeros((1, mujoco.mj_stateSize(model, spec)))
        mujoco.mj_getState(model, data, start[0], spec)
        return mujoco.rollout.rollout(model, data, start, tau[None])

    return steps, rollout


def with_pinocchio(tau: np.ndarray) -> tuple[Callable[[], np.ndarray], Callable[[], object], Callable[[], object]]:
    import pinocchio as pin

    (m1, m2), (l1, _), (c1, c2), (i1, i2) = (LINKS[k] for k in "mlci")
    model = pin.Model()
    model.gravity.linear = np.array([0, 0, -GRAVITY])
    first = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "j1")
    model.appendBodyToJoint(first, pin.Inertia(m1, np.array([0, 0, -c1]), i1 * np.eye(3)), pin.SE3.Identity())
    second = model.addJoint(first, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([0, 0, -l1])), "j2")
    model.appendBodyToJoint(second, pin.Inertia(m2, np.array([0, 0, -c2]), i2 * np.eye(3)), pin.SE3.Identity())
    data, b = model.createData(), np.array(VISCOUS)

    def slope(q: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.asarray(pin.aba(model, data, q, v, u - b * v)).copy()

    def steps() -> np.ndarray:
        q, v, path = np.zeros(2), np.zeros(2), np.empty((len(tau), 2))
        for k, u in enumerate(tau):
            path[k] = q
            k1 = slope(q, v, u)
            v2 = v + 0.5 * H * k1
            k2 = slope(q + 0.5 * H * v, v2, u)
            v3 = v + 0.5 * H * k2
            k3 = slope(q + 0.5 * H * v2, v3, u)
            v4 = v + H * k3
            k4 = slope(q + H * v3, v4, u)
            q = q + H / 6 * (v + 2 * v2 + 2 * v3 + v4)
            v = v + H / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return path

    x = np.ones(2)

    def regressor() -> object:
        for _ in range(len(tau)):
            pin.computeJointTorqueRegressor(model, data, x, x, x)
        return None

    def aba() -> object:
        for _ in range(len(tau)):
            pin.aba(model, data, x, x, x)
        return None

    return steps, aba, regressor


def reference(tau: np.ndarray, method: str, tolerance: float) -> np.ndarray:
    """Positions by a solver of scipy, restarted at every sample because the torque jumps there [rad]."""
    from scipy.integrate import solve_ivp

    p1, p2, p3, p4, p5 = exact_theta()
    b1, b2 = VISCOUS

    def slope(_: float, x: np.ndarray, u: np.ndarray) -> list[float]:
        q1, q2, v1, v2 = x
        c, s, outer = np.cos(q2), np.sin(q2), p5 * np.sin(q1 + q2)
        m11, m12 = p1 + 2 * p2 * c, p3 + p2 * c
        r1 = u[0] + p2 * s * v2 * (2 * v1 + v2) - p4 * np.sin(q1) - outer - b1 * v1
        r2 = u[1] - p2 * s * v1**2 - outer - b2 * v2
        det = m11 * p3 - m12**2
        return [v1, v2, (p3 * r1 - m12 * r2) / det, (m11 * r2 - m12 * r1) / det]

    x, path = np.zeros(4), np.empty((len(tau), 2))
    for k, u in enumerate(tau):
        path[k] = x[:2]
        x = solve_ivp(slope, (0, H), x, method, args=(u,), rtol=tolerance, atol=tolerance).y[:, -1]
    return path


def simulation() -> None:
    t = np.arange(800) * H
    tau = np.ascontiguousarray(seed_torque(t))
    plain = arm((0.0, 0.0))
    truth = reference(tau, "DOP853", 1e-12)
    base = timed(lambda: simulate(plain, t, tau)) / len(t)
    row("simulation, 2 s, no dry friction", "per sample", "ratio", "positions off by at most")
    row("---", "---", "---", "---")

    def line(name: str, cost: float, path: np.ndarray | None) -> None:
        off = "" if path is None else f"{np.abs(path - truth).max():.0e} rad"
        row(name, f"{cost * 1e6:.2f} us", f"{cost / base:.1f}", off)

    line("armgap.simulate, tolerance 1e-9", base, np.asarray(simulate(plain, t, tau).q))
    if present("mujoco"):
        steps, rollout = with_mujoco(tau)
        line("MuJoCo mj_step, RK4, called from Python", timed(steps) / len(t), steps())
        line("MuJoCo rollout, RK4", timed(rollout) / len(t), None)
    if present("pinocchio"):
        steps, aba, regressor = with_pinocchio(tau)
        line("Pinocchio, RK4 in Python around aba", timed(steps) / len(t), steps())
        line("Pinocchio aba, one call from Python", timed(aba) / len(t), None)
        line("Pinocchio computeJointTorqueRegressor, one call from Python", timed(regressor) / len(t), None)
    slow = timed(lambda: reference(tau[:100], "RK45", 1e-9)) / 100
    line("scipy solve_ivp, RK45, tolerance 1e-9", slow, reference(tau, "RK45", 1e-9))


if __name__ == "__main__":
    if not present("scipy"):
        sys.exit(2)
    estimation()
    print()
    simulation()
