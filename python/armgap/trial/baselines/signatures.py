"""Signatures of the effects in the residual torque, for all regression baselines; shapes (velocities, periods, levels) are on a grid."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from armgap.arm.arm import Arm
from armgap.trial.baselines.regression import Array, Motion, RegressionData, regressor

__all__ = ["Signature", "signatures"]

#: Step of numerical derivatives by positions, rad.
POSITION_STEP = 1e-5
DELAYS = (0.001, 0.002, 0.004, 0.008, 0.016)  # delays and time constants tried, s
#: Levels of torque saturation that are tried, as shares of the largest command.
LEVELS = (0.5, 0.65, 0.8, 0.9)
#: Number of spatial frequencies of torque ripple that are tried.
_ORDERS = 12

#: Signatures of an effect, one per shape: columns (n, k) in the joint's own rows, or (n, n_joints, k).
Shapes = Iterator[Array]


@dataclass(frozen=True)
class Signature:
    """Signature of one effect on one joint for one shape: torque columns that are linear in the effect's size.

    Attributes
    ----------
    effect, joint
        Name of the effect, and its joint from 1; None for the whole arm.
    columns : ndarray, shape (m, k)
        Torque per unit of the effect's size, scaled and in rows as in `RegressionData`.
    """

    effect: str
    joint: int | None
    columns: Array


def signatures(arm: Arm, made: RegressionData, ref: Motion) -> list[Signature]:
    """Return signatures of all effects of the library on all their joints, for every shape of the grid.

    Parameters
    ----------
    arm : Arm
        Arm with nominal parameters.
    made : RegressionData
        Regression that gives the motions and the scale of each joint's rows.
    ref : Motion
        Motion whose speeds, torques and travel set the grid of shapes; the same for training and holdout.
    """
    found: list[Signature] = []
    for j in range(arm.n_joints):
        for effect, shapes in PER_JOINT.items():
            if (arm.rotary or effect not in ROTARY) and (arm.n_joints > 1 or effect not in COUPLED):
                found += _built(effect, j, made, lambda x, j=j, f=shapes: f(arm, x, j, ref))  # type: ignore[misc]
    if arm.rotary:
        for effect, shapes in PER_ARM.items():
            if effect in COUPLED and arm.n_joints == 1:
                continue
            found += _built(effect, None, made, lambda x, f=shapes: f(arm, x, 0, ref))  # type: ignore[misc]
    return found


def _built(effect: str, joint: int | None, made: RegressionData, shapes: Callable[[Motion], Shapes]) -> list[Signature]:
    n = made.scale.size
    per_log = zip(*(list(shapes(x)) for x in made.motions), strict=True)
    number = None if joint is None else joint + 1
    return [Signature(effect, number, made.rows([_placed(c, joint, n) for c in logs])) for logs in per_log]


def _placed(columns: Array, joint: int | None, n: int) -> Array:
    """Return columns of one joint as columns of all joints, shape (n, n_joints, k), with zeros for the other joints."""
    if columns.ndim == 3 or joint is None:
        return columns
    full = np.zeros((len(columns), n, columns.shape[1]))
    full[:, joint] = columns
    return full


def _one(*columns: Array) -> Array:
    return np.column_stack(columns)


def _offset(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    yield _one(np.ones_like(x.t))


def _stribeck(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    fast = np.quantile(np.abs(ref.dq[:, j]), 0.95)
    for part in (0.04, 0.08, 0.15, 0.3):
        yield _one(np.exp(-((x.dq[:, j] / (part * fast)) ** 2)) * np.sign(x.dq[:, j]))


def _drag(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    yield _one(x.dq[:, j] * np.abs(x.dq[:, j]))


def _cubic(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    yield _one(x.dq[:, j] ** 3)


def _load(arm: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    n = arm.n_inertial
    load = regressor(arm, x.q, x.dq, np.zeros_like(x.q))[:, j, :n] @ arm.theta[:n]
    yield _one(np.abs(load) * np.sign(x.dq[:, j]))


def _position(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    s = np.sign(x.dq[:, j])
    yield _one(np.cos(x.q[:, j]) * s, np.sin(x.q[:, j]) * s)


def _warmup(arm: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    viscous, coulomb = arm.theta[arm.n_inertial + j], arm.theta[arm.n_inertial + arm.n_joints + j]
    friction = viscous * x.dq[:, j] + coulomb * np.sign(x.dq[:, j])
    for part in (0.15, 0.3, 0.6):
        yield _one(friction * np.exp(-x.t / (part * ref.t[-1])))


def _presliding(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    step = np.abs(np.diff(x.q[:, j], prepend=x.q[0, j]))
    for part in (0.003, 0.01, 0.03):
        yield _one(_dahl(np.sign(x.dq[:, j]), np.exp(-step / (part * np.ptp(ref.q[:, j])))))


def _dahl(direction: Array, decay: Array) -> Array:
    z = np.zeros_like(direction)
    for k in range(1, len(z)):
        z[k] = direction[k] + (z[k - 1] - direction[k]) * decay[k]
    return z


def _elasticity(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    h = float(np.median(np.diff(x.t)))
    yield _one(np.gradient(np.gradient(x.tau[:, j], h), h))


def _backlash(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    load = x.smooth(np.sign(x.raw[:, j]))
    h = float(np.median(np.diff(x.t)))
    yield _one(np.gradient(load, h))


def _gain(arm: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    # The signature is the nominal torque: the commanded torque is the output of the regression itself.
    yield _one(regressor(arm, x.q, x.dq, x.ddq)[:, j] @ arm.theta)


def _lag(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    h = float(np.median(np.diff(x.t)))
    for constant in DELAYS:
        decay, y, out = np.exp(-h / constant), x.raw[0, j], np.empty(len(x.t))
        for k, u in enumerate(x.raw[:, j]):
            out[k], y = y, u + (y - u) * decay
        yield _one(x.tau[:, j] - x.smooth(out))


def _delay(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    for delay in DELAYS:
        yield _one(x.tau[:, j] - np.interp(x.t - delay, x.t, x.tau[:, j]))


def _saturation(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    top = np.max(np.abs(ref.raw[:, j]))
    for part in LEVELS:
        yield _one(x.smooth(x.raw[:, j] - np.clip(x.raw[:, j], -part * top, part * top)))


def _dead_zone(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    usual = np.sqrt(np.mean(ref.raw[:, j] ** 2))
    for part in (0.03, 0.1, 0.3):
        yield _one(x.smooth(np.clip(x.raw[:, j], -part * usual, part * usual)))


def _ripple(arm: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    travel = max(float(np.ptp(ref.q[:, j])), 1e-6)
    for cycles in np.geomspace(1.5, 9.0, _ORDERS):
        n = 2 * np.pi * cycles / travel
        n = float(round(n)) if arm.rotary else n
        yield _one(np.sin(n * x.q[:, j]), np.cos(n * x.q[:, j]))


def _spring(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    yield _one(x.q[:, j], np.ones_like(x.t))


def _rotor(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    yield _one(x.ddq[:, j])


def _moved(arm: Arm, x: Motion, shift: Callable[[Array], tuple[Array, Array, Array]], j: int) -> Array:
    """Return the change of the nominal torque by a shift of joint `j`'s position reading, per unit of the shift."""
    parts = [x.q.copy(), x.dq.copy(), x.ddq.copy()]
    for part, moved in zip(parts, shift(np.column_stack([x.q[:, j], x.dq[:, j], x.ddq[:, j]])), strict=True):
        part[:, j] += POSITION_STEP * moved
    change: Array = (regressor(arm, *parts) - regressor(arm, x.q, x.dq, x.ddq)) @ arm.theta / POSITION_STEP
    return change


def _encoder_offset(arm: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    one, zero = np.ones_like(x.t), np.zeros_like(x.t)
    yield _moved(arm, x, lambda _: (one, zero, zero), j)[..., None]


def _eccentricity(arm: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    def sine(s: Array) -> tuple[Array, Array, Array]:
        q, v, a = s.T
        return np.sin(q), v * np.cos(q), a * np.cos(q) - v * v * np.sin(q)

    def cosine(s: Array) -> tuple[Array, Array, Array]:
        q, v, a = s.T
        return np.cos(q), -v * np.sin(q), -a * np.sin(q) - v * v * np.cos(q)

    yield np.stack([_moved(arm, x, sine, j), _moved(arm, x, cosine, j)], axis=2)


def _contact(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    for side in (1.0, -1.0):
        for part in (0.75, 0.85, 0.95):
            yield _one(side * np.maximum(side * x.q[:, j] - np.quantile(side * ref.q[:, j], part), 0.0))


def _pulse(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    for start in np.arange(0.0, ref.t[-1], 0.1):
        yield _one(((x.t >= start) & (x.t < start + 0.15)).astype(np.float64))


def _payload(arm: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    if arm.kind == "pendulum":
        direction = np.array([0.3, arm.gravity])  # payload at 0.3 m; its distance matters little compared with its mass
    else:
        l1, d = (arm.link_length[0], 0.7 * arm.link_length[1]) if arm.link_length is not None else (0.4, 0.2)
        g = arm.gravity
        direction = np.array([l1 * l1 + d * d, l1 * d, d * d, g * l1, g * d])
    yield (regressor(arm, x.q, x.dq, x.ddq)[..., : len(direction)] @ direction)[..., None]


def _tilt(arm: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    still = np.zeros_like(x.q)
    moved = x.q.copy()
    moved[:, 0] += POSITION_STEP
    n = arm.n_inertial
    change = (regressor(arm, moved, still, still) - regressor(arm, x.q, still, still))[..., :n] @ arm.theta[:n]
    yield change[..., None] / POSITION_STEP


def _one_sided(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    yield _one(np.abs(x.dq[:, j]))


def _gear(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    tau = x.tau[:, j]
    yield _one(np.where(tau * x.dq[:, j] > 0, tau, 0.0))


def _crossed(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    yield _one(np.sign(x.dq[:, 1 - j]))


def _hardening(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    q = x.q[:, j]
    yield _one(q**3, q**2, q, np.ones_like(q))


def _coupling(_: Arm, x: Motion, j: int, ref: Motion) -> Shapes:
    yield x.ddq[:, ::-1, None]


ShapeFunction = Callable[[Arm, Motion, int, Motion], Shapes]
PER_JOINT: dict[str, ShapeFunction] = {
    "torque_offset": _offset,
    "stribeck": _stribeck,
    "quadratic_drag": _drag,
    "cubic_drag": _cubic,
    "load_dependent_friction": _load,
    "position_dependent_friction": _position,
    "friction_warmup": _warmup,
    "presliding": _presliding,
    "joint_elasticity": _elasticity,
    "backlash": _backlash,
    "torque_gain": _gain,
    "actuator_lag": _lag,
    "actuator_delay": _delay,
    "torque_saturation": _saturation,
    "torque_dead_zone": _dead_zone,
    "torque_ripple": _ripple,
    "joint_spring": _spring,
    "rotor_inertia": _rotor,
    "encoder_offset": _encoder_offset,
    "encoder_eccentricity": _eccentricity,
    "contact": _contact,
    "external_pulse": _pulse,
    "viscous_asymmetry": _one_sided,
    "gear_efficiency": _gear,
    "hardening_spring": _hardening,
    "cross_friction": _crossed,
}
PER_ARM: dict[str, ShapeFunction] = {"payload": _payload, "base_tilt": _tilt, "rotor_coupling": _coupling}
#: Names of hidden effects that couple two joints.
COUPLED = {"cross_friction", "rotor_coupling"}
#: Names of effects that do not exist on a linear axis.
ROTARY = {
    "load_dependent_friction",
    "position_dependent_friction",
    "encoder_offset",
    "encoder_eccentricity",
    "backlash",
}
