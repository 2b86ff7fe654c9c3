"""Motions of the trial: references, controllers, disturbances, encoders, and the simulation of a log."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from .arms import STEP, SerialRobot
from .effects import TURN, Effect, Moment, Use

Array = NDArray[np.float64]

#: Sample periods of logs of torques [s].
PERIODS = (0.002, 0.004, 0.005, 0.008)
#: Sample periods of logs of references in place of torques [s].
COMMANDED_PERIODS = (0.002, 0.004, 0.005, 0.008, 0.01)
#: Smallest and largest natural frequency [rad/s] that a servo's gains give the nominal arm's inertia, by kind of servo.
SERVOS = {"stiff": (25.0, 45.0), "soft": (8.0, 14.0)}
_DAMPING = (0.4, 1.0)
#: Number of sines in a reference, and range of their frequencies [Hz].
_SINES, _BAND_HZ = 5, (0.05, 0.8)
#: Time over which a motion is faded in from rest [s].
_FADE_S = 1.5
#: Cut-off of the low-pass filter for the velocity that a controller computes from encoder positions [Hz].
_VELOCITY_HZ = 60.0
#: Largest position beyond the joint's range, and largest error from the reference, of a usable log [rad or m].
_OUTSIDE = 0.5


@dataclass(frozen=True)
class Controller:
    """Source of the commanded torques.

    Attributes
    ----------
    kind : {"pd", "computed_torque", "excited", "open", "stiff", "soft"}
        PD with gravity of the nominal arm; PD with the nominal inverse dynamics of the reference; weak PD with gravity and an added multisine
        torque; a torque table that is played back; and two servos without any model of the arm, with `kd` on the measured velocity.
    kp, kd : ndarray, shape (n,)
        Proportional and derivative gains.
    played : ndarray, shape (n_samples, n_joints), optional
        Torques added to those of the PD controller, or the torque table itself of kind ``"open"`` [N m or N].
    """

    kind: str
    kp: Array
    kd: Array
    played: Array | None = None

    @property
    def is_servo(self) -> bool:
        """Whether the controller is a servo, which runs at every integration step, whatever the log's sample period."""
        return self.kind in SERVOS


@dataclass(frozen=True)
class Reference:
    """Positions, velocities and accelerations that a controller follows, shape (n_samples, n_joints) each."""

    q: Array
    dq: Array
    ddq: Array


@dataclass(frozen=True)
class Run:
    """One simulated log and its true motion.

    Attributes
    ----------
    t : ndarray, shape (n_samples,)
        Times [s].
    q, tau : ndarray, shape (n_samples, n_joints)
        Positions that encoders show, and commands held until the next sample; of a servo, mean commands by the gains that the arm file states.
    true_q, true_dq, true_ddq : ndarray, shape (n_samples, n_joints)
        True positions, velocities and accelerations of the joints at the samples.
    applied : ndarray, shape (n_samples, n_joints)
        Torques other than friction that acted on the joints at the samples [N m or N].
    """

    t: Array
    q: Array
    tau: Array
    true_q: Array
    true_dq: Array
    true_ddq: Array
    applied: Array

    def sane(self, robot: SerialRobot, reference: Reference, *, follows: bool) -> bool:
        """Return whether the log is usable: every joint moves, within its range and near its reference, and commands do not chatter.

        Parameters
        ----------
        robot, reference
            Arm that moved, and reference of its controller.
        follows : bool
            Whether the controller keeps the arm near the reference.
        """
        if not np.isfinite(self.true_q).all():
            return False
        reach = np.where(robot.rotary, 1.0, 0.3) * _OUTSIDE
        inside = np.all((self.true_q > robot.lower - reach) & (self.true_q < robot.upper + reach))
        near = not follows or np.all(np.abs(self.true_q - reference.q) < reach)
        still = np.all(np.ptp(self.q, axis=0) > 0.05 * (robot.upper - robot.lower))
        quiet = np.all(np.std(np.diff(self.tau, axis=0), axis=0) < 0.5 * np.std(self.tau, axis=0))
        return bool(inside and near and still and quiet)


def draw_reference(robot: SerialRobot, samples: int, period: float, rng: np.random.Generator) -> Reference:
    """Draw a multisine reference that starts from rest and keeps to the joints' ranges and speeds."""
    t = period * np.arange(samples)
    s = np.minimum(t / _FADE_S, 1.0)
    fade = s**3 * (10 - 15 * s + 6 * s**2)
    q = np.empty((samples, robot.n))
    for j in range(robot.n):
        hertz = np.exp(rng.uniform(*np.log(_BAND_HZ), _SINES))
        size = rng.uniform(0.3, 1.0, _SINES) / np.sqrt(hertz)
        wave = size @ np.sin(TURN * np.outer(hertz, t) + rng.uniform(0, TURN, (_SINES, 1)))
        room = float(robot.upper[j] - robot.lower[j]) / 2
        wave *= rng.uniform(0.6, 0.9) * room / np.max(np.abs(wave))
        wave *= min(1.0, float(robot.speed[j] / np.max(np.abs(np.gradient(wave, period)))))
        spare = room - float(np.max(np.abs(wave)))
        q[:, j] = (robot.lower[j] + robot.upper[j]) / 2 + rng.uniform(-0.8, 0.8) * spare + fade * wave
    dq = np.gradient(q, period, axis=0)
    return Reference(q, dq, np.gradient(dq, period, axis=0))


def draw_controller(
    kind: str, robot: SerialRobot, reference: Reference, period: float, rng: np.random.Generator
) -> Controller:
    """Draw a controller with gains for the nominal arm's inertia along the reference; its field `played` is left empty."""
    model = robot.model(friction=False)
    data = mujoco.MjData(model)
    inertia = np.zeros(robot.n)
    poses = reference.q[:: max(1, len(reference.q) // 20)]
    full = np.empty((robot.n, robot.n))
    for q in poses:
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        inertia += np.diag(full) / len(poses)
    if kind in SERVOS:
        rate, ratio = float(rng.uniform(*SERVOS[kind])), float(rng.uniform(*_DAMPING))
        return Controller(kind, inertia * rate**2, 2.0 * ratio * inertia * rate)
    bandwidth = min(float(rng.uniform(10.0, 20.0)), 0.06 / period)
    if kind == "excited":
        bandwidth = 4.0
    return Controller(kind, inertia * bandwidth**2, 1.4 * inertia * bandwidth)


def draw_torque(size: Array, samples: int, period: float, rng: np.random.Generator) -> Array:
    """Draw a multisine torque of RMS `size` per joint, 0.2 to 2.5 Hz, shape (n_samples, n_joints)."""
    t = period * np.arange(samples)
    out = np.empty((samples, len(size)))
    for j, rms in enumerate(size):
        hertz = np.exp(rng.uniform(math.log(0.2), math.log(2.5), 6))
        wave = np.sin(TURN * np.outer(hertz, t) + rng.uniform(0, TURN, (6, 1))).sum(0)
        out[:, j] = rms * wave / np.sqrt(np.mean(wave**2))
    return out


def coloured(size: Array, time: Array, samples: int, period: float, rng: np.random.Generator) -> Array:
    """Return first-order Gauss-Markov noise torques with standard deviations `size` and correlation times `time` [s], (n_samples, n_joints)."""
    decay = np.exp(-period / time)
    kicks = rng.standard_normal((samples, len(size))) * size * np.sqrt(1 - decay**2)
    out = np.empty((samples, len(size)))
    level = size * rng.standard_normal(len(size))
    for k in range(samples):
        level = decay * level + kicks[k]
        out[k] = level
    return out


def use_of(run: Run) -> Use:
    """Return the statistics of the joints' motion in a log, by which sizes of effects are chosen."""
    period = run.t[1]

    def rms(x: Array) -> Array:
        return np.asarray(np.sqrt(np.mean(x**2, axis=0)))

    smooth = np.gradient(run.tau, period, axis=0)
    return Use(
        rms(run.tau), np.max(np.abs(run.tau), axis=0), rms(run.true_ddq), rms(run.true_dq),
        np.quantile(run.true_q, 0.02, axis=0), np.quantile(run.true_q, 0.98, axis=0), rms(smooth),
    )  # fmt: skip


def simulate(
    truth: SerialRobot,
    nominal: SerialRobot,
    effect: Effect,
    reference: Reference,
    controller: Controller,
    disturbance: Array,
    period: float,
) -> Run:
    """Simulate one log that starts at rest at the reference.

    The controller knows the nominal arm, the positions that encoders show, and velocities computed from these. Torques are held over each
    step of the Runge-Kutta integration: along such motions accelerations are within 0.02 % of those with steps ten times shorter.

    Parameters
    ----------
    truth, nominal : SerialRobot
        The arm that moves, with the effect in it, and the nominal arm, which the controller knows.
    effect : Effect
        The hidden effect.
    reference, controller
        Reference that is followed, and controller that follows it.
    disturbance : ndarray, shape (n_samples, n_joints)
        Torques on the joints that the log does not show [N m or N].
    period : float
        Sample period [s], a whole number of integration steps.
    """
    samples, n = reference.q.shape
    model = truth.model()
    data = mujoco.MjData(model)
    side, servo = _Nominal(nominal), _Servo(controller, truth)
    if controller.is_servo:
        effect.begin(np.zeros(n))
    else:
        # Before the log, drives have held the arm at rest.
        effect.begin(side.command(controller, reference, 0, reference.q[0], np.zeros(n), truth.effort))
    # The arm starts at rest where the encoders show the reference.
    data.qpos[:] = 2 * reference.q[0] - effect.reading(reference.q[0])
    if controller.is_servo:
        # The arm starts at rest where the servos' position errors carry its weight.
        mujoco.mj_forward(model, data)
        data.qpos[:] -= data.qfrc_bias / controller.kp
    out = {name: np.empty((samples, n)) for name in ("q", "tau", "true_q", "true_dq", "true_ddq", "applied")}
    steps = round(period / STEP)
    forget = 1.0 - math.exp(-TURN * _VELOCITY_HZ * period)
    dry_here = bool(np.any(truth.coulomb > 0))
    shown, speed = np.zeros(n), np.zeros(n)
    load = np.zeros(n)
    for k in range(samples):
        last, shown = shown, np.round(effect.reading(data.qpos.copy()) / truth.step) * truth.step
        if k:
            speed = speed + forget * ((shown - last) / period - speed)
        command = np.zeros(n)
        if not controller.is_servo:
            command = side.command(controller, reference, k, shown, speed, truth.effort)
        out["q"][k], out["tau"][k] = shown, command
        out["true_q"][k], out["true_dq"][k] = data.qpos, data.qvel
        for i in range(steps):
            if controller.is_servo:
                command = servo.command(effect, reference.q[k], data)
                out["tau"][k] += servo.stated / steps
                if k == i == 0:
                    effect.begin(command)
            now = effect.drive(command)
            moment = Moment(k * period + i * STEP, data.qpos, data.qvel, now, load)
            total = now + disturbance[k]
            if (extra := effect.torque(moment)) is not None:
                total = total + extra
            data.qfrc_applied[:] = total
            if dry_here and (more := effect.dry(moment)) is not None:
                model.dof_frictionloss[:] = np.maximum(truth.coulomb + more, 0.0)
            if i == 0:
                mujoco.mj_forward(model, data)
                out["true_ddq"][k], out["applied"][k] = data.qacc, total
            mujoco.mj_step(model, data)
            mujoco.mj_mulM(model, data, load, data.qacc)
            load += data.qfrc_bias - truth.rotor * data.qacc
    return Run(period * np.arange(samples), **out)


class _Servo:
    """PD servos at every integration step, with the gains that the arm file states and the gains that they really have."""

    def __init__(self, controller: Controller, robot: SerialRobot) -> None:
        self.kp, self.kd = controller.kp, controller.kd
        self.step, self.effort = robot.step, robot.effort
        self.stated = np.zeros(robot.n)

    def command(self, effect: Effect, reference: Array, data: Any) -> Array:
        """Return the torques of this integration step; `stated` gets the torques of the stated gains for an undelayed reference."""
        q = data.qpos.copy()
        speed = effect.reading_rate(q, data.qvel)
        shown = np.round(effect.reading(q) / self.step) * self.step
        self.stated = np.clip(self.kp * (reference - shown) - self.kd * speed, -self.effort, self.effort)
        kp, kd = effect.gains(self.kp, self.kd)
        out = kp * (effect.arriving(reference) - shown) - kd * speed
        return np.clip(out, -self.effort, self.effort)


class _Nominal:
    """Model of the nominal arm inside a controller, and the controller's command."""

    def __init__(self, robot: SerialRobot) -> None:
        self.viscous = robot.viscous
        self.model: Any = robot.model(friction=False)
        self.data: Any = mujoco.MjData(self.model)

    def command(self, by: Controller, reference: Reference, k: int, q: Array, dq: Array, effort: Array) -> Array:
        """Return the commanded torques of sample `k` from the positions and velocities that the encoders show."""
        if by.kind == "open":
            assert by.played is not None
            return by.played[k]
        ahead = by.kind == "computed_torque"
        self.data.qpos[:] = q
        self.data.qvel[:] = reference.dq[k] if ahead else 0.0
        self.data.qacc[:] = reference.ddq[k] if ahead else 0.0
        mujoco.mj_inverse(self.model, self.data)
        out = self.data.qfrc_inverse + by.kp * (reference.q[k] - q) + by.kd * (reference.dq[k] - dq)
        if ahead:
            out = out + self.viscous * reference.dq[k]
        if by.played is not None:
            out = out + by.played[k]
        return np.clip(out, -effort, effort)
