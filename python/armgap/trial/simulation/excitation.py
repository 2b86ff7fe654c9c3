"""Motions for trial logs: torques in open loop, and random trajectories tracked by a controller.

An open-loop motion is a multisine with random phases around a constant, or the torques of Reyes and Kelly (1997), equations (31)-(32),
scaled to the arm. A tracked motion is a random Fourier series followed by a PD controller on the measured positions;
the controller's command is logged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from armgap.trial.simulation.arms import DIRECT_DRIVE, TrialArm
from armgap.trial.simulation.simulated_arm import Array, CommandSource, Trace

#: Styles of trial motions: open-loop multisine torques, torques of Reyes and Kelly (1997), and tracked random trajectories.
STYLES = ("multisine", "paper", "tracked")
#: Frequency above which the reference of a tracked motion has no content, Hz; power of the command above it shows an oscillating controller.
RINGING = 15.0
#: Time over which torques and references of trial motions fade in, s.
FADE_IN = 0.4
#: Smallest rate of reversals per joint of an acceptable motion, 1/s.
REVERSAL_RATE = 0.6


@dataclass(frozen=True)
class Multisine:
    """Motion under the open-loop torques ``(1 - exp(-rate t)) bias + sum amplitude sin(omega t + phase)``, whose sines fade in.

    Attributes
    ----------
    bias, rate : ndarray, shape (n_joints,)
        Constant torque [N m] and rate of its rise [1/s].
    amplitude, omega, phase : ndarray, shape (n_joints, n_sines)
        Amplitudes [N m], angular frequencies [rad/s] and phases [rad] of the sines.
    limit : ndarray, shape (n_joints,)
        Limit to which the command is clipped [N m].
    """

    bias: Array
    rate: Array
    amplitude: Array
    omega: Array
    phase: Array
    limit: Array

    def source(self, arm: TrialArm) -> CommandSource:
        """Return a function for the commanded torques of the motion over time."""

        def command(t: float, _q: list[float]) -> list[float]:
            waves = np.sum(self.amplitude * np.sin(self.omega * t + self.phase), axis=1)
            tau = (1 - np.exp(-self.rate * t)) * self.bias + fade(t) * waves
            return [float(x) for x in np.clip(tau, -self.limit, self.limit)]

        return command


@dataclass(frozen=True)
class Tracked:
    """Motion along a Fourier series around ``centre``, tracked by a PD controller.

    Attributes
    ----------
    centre : ndarray, shape (n_joints,)
        Mean positions [rad or m].
    amplitude, omega, phase : ndarray, shape (n_joints, n_sines)
        Amplitudes [rad or m], angular frequencies [rad/s] and phases [rad] of the series.
    stiffness, damping, limit : ndarray, shape (n_joints,)
        Gains of the PD controller [N m/rad, N m s/rad; N/m, N s/m on an axis] and largest command [N m or N].
    """

    centre: Array
    amplitude: Array
    omega: Array
    phase: Array
    stiffness: Array
    damping: Array
    limit: Array

    def reference(self, t: float) -> tuple[Array, Array]:
        """Return reference positions and velocities at time `t` [s]."""
        angle = self.omega * t + self.phase
        blend, rise = fade(t, 1.0), fade_rate(t, 1.0)
        wave = self.centre + np.sum(self.amplitude * np.sin(angle), axis=1)
        rate = np.sum(self.amplitude * self.omega * np.cos(angle), axis=1)
        return blend * wave, blend * rate + rise * wave

    def source(self, arm: TrialArm) -> CommandSource:
        """Return a new PD controller that tracks the motion: a function for commanded torques from time and positions."""
        last: list[Array] = []

        def command(t: float, q: list[float]) -> list[float]:
            measured = np.array(q)
            dq = (measured - last.pop()) / arm.sample_period if last else np.zeros(len(q))
            last.append(measured)
            wanted, rate = self.reference(t)
            tau = self.stiffness * (wanted - measured) + self.damping * (rate - dq)
            return [float(x) for x in np.clip(tau, -self.limit, self.limit)]

        return command

    def softer(self) -> Tracked:
        """Return the motion with a controller of half the stiffness and 0.6 times the damping."""
        return replace(self, stiffness=0.5 * self.stiffness, damping=0.6 * self.damping)


Excitation = Multisine | Tracked


def rings(trace: Trace) -> bool:
    """Return whether the controller of a run oscillates: most of a command's power is above `RINGING`, where the reference has none."""
    tau = trace.tau - np.mean(trace.tau, axis=0)
    power = np.abs(np.fft.rfft(tau, axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(trace.t), trace.t[1] - trace.t[0])
    return bool(np.any(np.sum(power[frequency > RINGING], axis=0) > 0.5 * np.sum(power, axis=0)))


def fade(t: float, length: float = FADE_IN) -> float:
    """Return a smooth rise from 0 to 1 over ``length`` seconds."""
    return 0.5 * (1 - math.cos(math.pi * min(t / length, 1.0)))


def fade_rate(t: float, length: float = FADE_IN) -> float:
    """Return the time derivative of :func:`fade` [1/s]."""
    return 0.5 * math.pi / length * math.sin(math.pi * t / length) if t < length else 0.0


def draw_excitation(rng: np.random.Generator, arm: TrialArm, style: str, vigour: float) -> Excitation:
    """Draw a motion of one of :data:`STYLES`; ``vigour`` scales its amplitude (1 is usual)."""
    if style == "tracked":
        return _tracked(rng, arm, vigour)
    if style == "paper" and arm.kind == "two-link":
        return _paper(rng, arm, vigour)
    return _multisine(rng, arm, vigour)


def acceptable(trace: Trace, arm: TrialArm) -> tuple[bool, float]:
    """Return whether a motion stays in range and moves every joint enough, and the factor for its amplitudes if not."""
    reach = np.max(np.abs(trace.q_true), axis=0)
    limit = np.array([0.9] if arm.kind == "axis" else [2.2, 2.8][: arm.n_joints])
    speed = np.quantile(np.abs(trace.dq_true), 0.95, axis=0)
    span = np.ptp(trace.q_true, axis=0)
    wild = bool(np.any(reach > limit)) or bool(np.any(speed > _fast(arm)))
    few = reversals(trace.dq_true) < REVERSAL_RATE * trace.t[-1]
    dull = bool(np.any(span < 0.2 * limit)) or bool(np.any(few))
    return not (wild or dull), 0.8 if wild else 1.25


def reversals(dq: Array) -> Array:
    """Return the number of velocity reversals per joint."""
    return np.array([_sign_changes(column) for column in dq.T])


def _sign_changes(dq: Array) -> int:
    moving = np.sign(dq[np.abs(dq) > 0.02 * np.max(np.abs(dq))])
    return int(np.sum(moving[1:] != moving[:-1]))


def _fast(arm: TrialArm) -> float:
    return 1.5 if arm.kind == "axis" else 9.0


def _gravity(arm: TrialArm) -> Array:
    t = arm.inertial
    if arm.kind == "axis":
        return np.zeros(1)
    return np.array([t[1]] if arm.kind == "pendulum" else [t[3], t[4]])


def _constant_load(arm: TrialArm) -> Array:
    return np.array([arm.inertial[1]]) if arm.kind == "axis" else np.zeros(arm.n_joints)


def _limit(arm: TrialArm) -> Array:
    return 0.95 * np.array(arm.torque_limit)


def _multisine(rng: np.random.Generator, arm: TrialArm, vigour: float) -> Multisine:
    n, k = arm.n_joints, int(rng.integers(3, 6))
    omega = np.exp(rng.uniform(math.log(3.0), math.log(28.0), (n, k)))
    speed = vigour * rng.uniform(0.4, 1.0, (n, 1)) * (0.12 if arm.kind == "axis" else 0.9)
    shares = rng.uniform(0.4, 1.0, (n, k))
    inertia, gravity = np.array(arm.joint_inertia)[:, None], _gravity(arm)[:, None]
    amplitude = speed * shares * np.maximum(inertia * omega, gravity / omega)
    amplitude += np.array(arm.coulomb)[:, None] * shares / k
    return Multisine(
        bias=_constant_load(arm) + rng.uniform(-0.7, 0.7, n) * _gravity(arm),
        rate=rng.uniform(0.8, 2.0, n) if arm.kind != "axis" else np.full(n, 1e3),
        amplitude=amplitude,
        omega=omega,
        phase=rng.uniform(0, 2 * math.pi, (n, k)),
        limit=_limit(arm),
    )


def _paper(rng: np.random.Generator, arm: TrialArm, vigour: float) -> Multisine:
    """Return torques (31)-(32) of Reyes and Kelly (1997), scaled by the arm's gravity and inertia over those of Table I, with random phases."""
    gravity = _gravity(arm) / _gravity(DIRECT_DRIVE)
    inertia = np.array(arm.joint_inertia) / np.array(DIRECT_DRIVE.joint_inertia)
    jitter = rng.uniform(0.85, 1.15, (2, 2))
    return Multisine(
        bias=np.array([29.0, 1.2]) * gravity * rng.choice([-1.0, 1.0], 2),
        rate=np.array([0.8, 1.8]),
        amplitude=vigour * np.array([[68.0, 9.0], [8.0, 2.0]]) * inertia[:, None],
        omega=np.array([[16.0, 20.0], [26.0, 12.0]]) * jitter,
        phase=rng.uniform(0, 2 * math.pi, (2, 2)),
        limit=_limit(arm),
    )


def _tracked(rng: np.random.Generator, arm: TrialArm, vigour: float) -> Tracked:
    n, k = arm.n_joints, 6
    size = 0.45 if arm.kind == "axis" else 1.0
    omega = 2 * math.pi * rng.uniform(0.15, 0.25, (n, 1)) * np.arange(1, k + 1)
    amplitude = vigour * size * rng.uniform(0.2, 1.0, (n, k)) / np.sqrt(np.arange(1, k + 1)) * 0.45
    inertia, bandwidth = np.array(arm.joint_inertia), rng.uniform(10.0, 18.0)
    return Tracked(
        centre=size * rng.uniform(-0.5, 0.5, n),
        amplitude=amplitude,
        omega=omega,
        phase=rng.uniform(0, 2 * math.pi, (n, k)),
        stiffness=inertia * bandwidth**2,
        damping=1.4 * inertia * bandwidth,
        limit=_limit(arm),
    )
