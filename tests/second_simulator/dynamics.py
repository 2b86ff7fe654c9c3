"""The equations of motion and their integration (fixed-step Runge-Kutta of 50 us, compiled by numba).

Coordinates: link angles ``q1`` (from hanging down) and ``q2`` (relative to link 1), and motor angles ``m1``, ``m2`` divided by the gear
ratio. Without elasticity and backlash a motor moves with its link. The rotor of joint 2 is carried by link 1: its kinetic energy is
``J2 (dq1 + dm2)^2 / 2``, so its torque balance reacts on joint 1.
"""

from __future__ import annotations

import numba
import numpy as np

#: Integration step [s].
STEP = 5e-5
#: Names of the parameters of one joint, in the order of the columns that `table` returns.
NAMES = (
    "viscous", "coulomb", "width", "offset", "gain", "lag", "late", "saturation", "dead_zone", "ripple", "ripple_n", "ripple_phase",
    "asymmetry", "viscous_asymmetry", "stribeck", "stribeck_velocity", "quadratic", "load", "cos_friction", "sin_friction",
    "warm", "warm_time", "spring", "spring_q0", "armature", "efficiency_loss", "stop", "stop_stiffness", "stop_damping",
    "rotor", "shaft", "shaft_damping", "play", "friction_at_motor", "cubic", "cross_position", "drift", "product",
    "algebraic", "bristle", "bristle_path",
)  # fmt: skip
COLUMN = {name: i for i, name in enumerate(NAMES)}
(
    VISCOUS, COULOMB, WIDTH, OFFSET, GAIN, LAG, LATE, SATURATION, DEAD_ZONE, RIPPLE, RIPPLE_N, RIPPLE_PHASE,
    ASYMMETRY, VISCOUS_ASYMMETRY, STRIBECK, STRIBECK_VELOCITY, QUADRATIC, LOAD, COS_FRICTION, SIN_FRICTION,
    WARM, WARM_TIME, SPRING, SPRING_Q0, ARMATURE, EFFICIENCY_LOSS, STOP, STOP_STIFFNESS, STOP_DAMPING,
    ROTOR, SHAFT, SHAFT_DAMPING, PLAY, FRICTION_AT_MOTOR, CUBIC, CROSS_POSITION, DRIFT, PRODUCT,
    ALGEBRAIC, BRISTLE, BRISTLE_PATH,
) = range(len(NAMES))  # fmt: skip


def table(joints: list[dict[str, float]]) -> np.ndarray:
    """Return the parameters of both joints as a table for the compiled code, (2, n_names); parameters that are not given have no effect."""
    values = np.zeros((2, len(NAMES)))
    values[:, GAIN], values[:, SATURATION], values[:, STOP] = 1.0, np.inf, np.inf
    values[:, STRIBECK_VELOCITY] = values[:, WARM_TIME] = values[:, BRISTLE_PATH] = 1.0
    for row, given in zip(values, joints, strict=True):
        for name, value in given.items():
            row[COLUMN[name]] = value
    return values


@numba.njit(fastmath=False)
def friction(p, q, dq, load, t):
    """Return the friction torque of one joint at velocity `dq` [N m], without the torque of its bristles."""
    shape = dq / np.hypot(dq, p[WIDTH]) if p[ALGEBRAIC] > 0.5 else np.tanh(dq / p[WIDTH])
    level = p[COULOMB] + p[STRIBECK] * np.exp(-((dq / p[STRIBECK_VELOCITY]) ** 2)) + p[LOAD] * abs(load)
    level += p[COS_FRICTION] * np.cos(q) + p[SIN_FRICTION] * np.sin(q)
    cold = 1.0 + p[WARM] * np.exp(-t / p[WARM_TIME])
    smooth = p[VISCOUS] * dq * cold + p[QUADRATIC] * dq * abs(dq) + p[CUBIC] * dq**3
    return max(level, 0.0) * cold * shape + smooth + p[ASYMMETRY] + p[VISCOUS_ASYMMETRY] * abs(dq)


@numba.njit(fastmath=False)
def drive(p, command):
    """Return the torque that a drive delivers for a constant command [N m]: gain, dead zone and saturation."""
    u = p[GAIN] * command
    if p[DEAD_ZONE] > 0.0:
        u = np.sign(u) * max(abs(u) - p[DEAD_ZONE], 0.0)
    return min(max(u, -p[SATURATION]), p[SATURATION])


@numba.njit(fastmath=False)
def slope(arm, tilt, payload, P, x, u, disturbance, t):
    """Return the time derivative of the state ``[q1, q2, m1, m2, dq1, dq2, dm1, dm2, z1, z2]`` under drive torques `u`.

    The bristles of a friction contact have the deflection `z`, relative to their largest (LuGre model without bristle damping).
    """
    m1, m2, l1, c1, c2, i1, i2, g = arm
    mp, lp = payload
    q1, q2, d1, d2 = x[0], x[1], x[4], x[5]
    c, s = np.cos(q2), np.sin(q2)
    a = m1 * c1 * c1 + (m2 + mp) * l1 * l1 + i1
    b = l1 * (m2 * c2 + mp * lp)
    d = m2 * c2 * c2 + mp * lp * lp + i2
    g1 = g * ((m1 * c1 + (m2 + mp) * l1) * np.sin(q1 + tilt) + (m2 * c2 + mp * lp) * np.sin(q1 + q2 + tilt))
    g2 = g * (m2 * c2 + mp * lp) * np.sin(q1 + q2 + tilt)
    rhs = np.empty(2)
    rhs[0] = b * s * d2 * (2.0 * d1 + d2) - g1
    rhs[1] = -b * s * d1 * d1 - g2
    load = (g1, g2)
    out = np.empty(10)
    out[0], out[1] = d1, d2
    for j in range(2):
        p = P[j]
        q, dq = x[j], x[4 + j]
        torque = disturbance[j] + p[OFFSET] + p[RIPPLE] * np.sin(p[RIPPLE_N] * q + p[RIPPLE_PHASE])
        torque -= p[SPRING] * (q - p[SPRING_Q0])
        torque += p[CROSS_POSITION] * np.sin(3.0 * x[0]) * np.cos(2.0 * x[1]) + p[DRIFT] * t + p[PRODUCT] * q * abs(dq)
        torque -= p[BRISTLE] * x[8 + j]
        out[8 + j] = (dq - abs(dq) * x[8 + j]) / p[BRISTLE_PATH]
        side = np.sign(p[STOP]) if np.isfinite(p[STOP]) else 0.0
        depth = side * (q - p[STOP]) if side != 0.0 else -1.0
        if depth > 0.0:
            torque -= side * max(p[STOP_STIFFNESS] * depth + p[STOP_DAMPING] * side * dq, 0.0)
        v = u[j]
        if p[EFFICIENCY_LOSS] > 0.0 and v * dq > 0.0:
            v *= 1.0 - p[EFFICIENCY_LOSS]
        if p[SHAFT] > 0.0:
            twist, rate = x[2 + j] - q, x[6 + j] - dq
            half = 0.5 * p[PLAY]
            passed = 0.0
            if abs(twist) > half or half == 0.0:
                over = twist - half * np.sign(twist) if half > 0.0 else twist
                passed = p[SHAFT] * over + p[SHAFT_DAMPING] * rate
                if half > 0.0 and passed * over < 0.0:
                    passed = 0.0
            own = v - passed
            if p[FRICTION_AT_MOTOR] > 0.5:
                own -= friction(p, x[2 + j], x[6 + j], load[j], t)
            else:
                torque -= friction(p, q, dq, load[j], t)
            rhs[j] += torque + passed
            out[2 + j], out[6 + j] = x[6 + j], own / p[ROTOR]
            if j == 1:
                rhs[0] -= own
        else:
            rhs[j] += torque + v - friction(p, q, dq, load[j], t)
            out[2 + j] = dq
    m11 = a + d + 2.0 * b * c + P[0, ARMATURE]
    m12 = d + b * c
    m22 = d + P[1, ARMATURE]
    det = m11 * m22 - m12 * m12
    out[4] = (m22 * rhs[0] - m12 * rhs[1]) / det
    out[5] = (m11 * rhs[1] - m12 * rhs[0]) / det
    if P[1, SHAFT] > 0.0:
        out[7] -= out[4]
    for j in range(2):
        if P[j, SHAFT] <= 0.0:
            out[6 + j] = out[4 + j]
    return out


@numba.njit(fastmath=False)
def simulate(arm, tilt, payload, P, encoder, reference, period, steps, disturbances, pushes):
    """Simulate one log from rest at the first sample of the reference.

    Parameters: `encoder` rows ``[side (1: motor), zero, cos, sin, step]``; `disturbances` of shape (samples, 4): torques, and noise of the
    encoders; `reference` of shape (samples, 2, 6): position, velocity, feed-forward torque, gains, largest command; `pushes` rows
    ``[joint, time, width, impulse]``.
    Returns measured positions, commands, and true link positions and velocities at the samples.
    """
    samples = reference.shape[0]
    q_out, tau, true_q, true_dq = (
        np.zeros((samples, 2)),
        np.zeros((samples, 2)),
        np.zeros((samples, 2)),
        np.zeros((samples, 2)),
    )
    x = np.zeros(10)
    for j in range(2):
        x[j] = x[2 + j] = reference[0, j, 0]
    act, now, before = np.zeros(2), np.zeros(2), np.zeros(2)
    last = np.zeros(2)
    h = period / steps
    u, dist = np.zeros(2), np.zeros(2)
    for k in range(samples):
        for j in range(2):
            shaft = x[2 + j] if encoder[j, 0] > 0.5 else x[j]
            seen = shaft + encoder[j, 1] + encoder[j, 2] * np.cos(shaft) + encoder[j, 3] * np.sin(shaft)
            seen += disturbances[k, 2 + j]
            q_out[k, j] = np.round(seen / encoder[j, 4]) * encoder[j, 4]
            true_q[k, j], true_dq[k, j] = x[j], x[4 + j]
            speed = (q_out[k, j] - last[j]) / period if k > 0 else 0.0
            last[j] = q_out[k, j]
            r = reference[k, j]
            before[j] = now[j]
            now[j] = r[2] + r[3] * (r[0] - q_out[k, j]) + r[4] * (r[1] - speed)
            limit = r[5]
            now[j] = min(max(now[j], -limit), limit)
            tau[k, j] = now[j]
        for i in range(steps):
            t = (k * steps + i) * h
            inside = i * h
            for j in range(2):
                command = now[j] if inside >= P[j, LATE] - 1e-12 else before[j]
                if P[j, LATE] >= period:
                    index = int(np.floor((k * period + inside - P[j, LATE]) / period + 1e-9))
                    command = tau[index, j] if index >= 0 else 0.0
                goal = drive(P[j], command)
                if P[j, LAG] > 0.0:
                    act[j] += (goal - act[j]) * (1.0 - np.exp(-h / P[j, LAG]))
                    u[j] = act[j]
                else:
                    u[j] = goal
                dist[j] = disturbances[k, j]
                for row in range(pushes.shape[0]):
                    if int(pushes[row, 0]) == j:
                        z = (t - pushes[row, 1]) / pushes[row, 2]
                        if abs(z) < 5.0:
                            dist[j] += pushes[row, 3] / (pushes[row, 2] * 2.5066282746) * np.exp(-0.5 * z * z)
            k1 = slope(arm, tilt, payload, P, x, u, dist, t)
            k2 = slope(arm, tilt, payload, P, x + 0.5 * h * k1, u, dist, t + 0.5 * h)
            k3 = slope(arm, tilt, payload, P, x + 0.5 * h * k2, u, dist, t + 0.5 * h)
            k4 = slope(arm, tilt, payload, P, x + h * k3, u, dist, t + h)
            x = x + (h / 6.0) * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return q_out, tau, true_q, true_dq
