"""Reference motions: fifth-order moves between one or two poses, around each of which every joint oscillates at two or four frequencies.

A motion begins and ends at rest at a home pose, moves to a first pose, oscillates around it, moves to a second pose, oscillates there, and
returns; or it oscillates around one pose all the time, at twice as many frequencies. Slow reversals, fast oscillations, large travel and
multisines are special cases. All design variables between 0 and 1 give motions within the limits: poses lie within the range of positions,
moves take as long as speed and acceleration require, and oscillations are scaled down.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import MotionLimits

__all__ = ["PER_JOINT", "Motion", "build", "count", "named"]

Array = NDArray[np.float64]

#: Phases of a reference motion with separate pose and oscillations, and sines per joint in each phase.
PHASES, SINES = 2, 2
#: Number of design variables per joint of a reference motion: pose, and amplitude and frequency of every oscillation, in both phases.
PER_JOINT = PHASES * (1 + 2 * SINES)
#: Values of the first design variable below which a motion has one phase with all oscillations, around the pose of the first; above, it is the first
#: phase's part of the time, within two bounds.
ONE_PHASE, SHARES = 0.3, (0.2, 0.8)
#: Time at rest at either end of a reference motion, s.
_REST_TIME_S = 0.2
#: Shortest duration of a move between two poses of a reference motion, s.
SHORTEST_MOVE = 0.2
#: Largest speed and acceleration of a fifth-order move over a unit distance in unit time (Siciliano 2009).
BLEND_SPEED, BLEND_ACCELERATION = 1.875, 10.0 / math.sqrt(3.0)
#: Smallest amplitude of an oscillation, as a part of the largest that the limits allow.
SMALLEST = 0.01
#: Highest frequency of oscillations, as a multiple of that at which speed and acceleration limit amplitudes equally, and its two bounds, Hz.
OVERTONE, HIGHEST, LEAST_HIGHEST = 4.0, 10.0, 1.0
#: Smallest number of samples per period of an oscillation.
SAMPLES_PER_PERIOD = 20
#: Golden angle, by which phases of joints and oscillations are spread so that they are not in step, rad.
GOLDEN = math.pi * (3.0 - math.sqrt(5.0))
#: Time over which an oscillation fades in or out, as a part of the length of its phase, and largest such time, s.
FADE_PART, FADE = 0.2, 0.6
#: Points per second at which a motion is compared with the limits.
LOOK_HZ = 200.0


@dataclass(frozen=True)
class Motion:
    """Reference motion: moves between home and one or two poses, with oscillations around each pose.

    Attributes
    ----------
    home : ndarray, shape (n_joints,)
        Pose at the beginning and the end [rad or m].
    times : tuple of float
        Beginning and end of each of the moves, of which there is one more than phases [s].
    duration : float
        Length of the motion [s].
    centres : ndarray, shape (n_phases, n_joints)
        Poses of the phases [rad or m].
    amplitude, frequency : ndarray, shape (n_phases, n_joints, n_sines)
        Amplitude [rad or m] and frequency [Hz] of the oscillations of each joint in the phases.
    scale : float
        Factor of all deviations from home, 0 to 1.
    """

    home: Array
    times: tuple[float, ...]
    duration: float
    centres: Array
    amplitude: Array
    frequency: Array
    scale: float = 1.0

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Return positions, velocities and accelerations at times `t`, each of shape (n_times, n_joints)."""
        n = len(self.home)
        q, dq, ddq = np.tile(self.home, (len(t), 1)), np.zeros((len(t), n)), np.zeros((len(t), n))
        poses = [self.home, *self.centres, self.home]
        for i in range(len(self.centres) + 1):
            begin, end = self.times[2 * i], self.times[2 * i + 1]
            parts = _blend((t - begin) / (end - begin))
            step = poses[i + 1] - poses[i]
            for total, part, power in zip((q, dq, ddq), parts, range(3), strict=True):
                total += np.outer(part / (end - begin) ** power, step)
        for i in range(len(self.centres)):
            begin, end = self.times[2 * i + 1], self.times[2 * i + 2]
            inside = (t > begin) & (t < end)
            found = oscillation(t[inside] - begin, end - begin, self.amplitude[i], self.frequency[i])
            for total, part in zip((q, dq, ddq), found, strict=True):
                total[inside] += part
        q[t >= self.times[-1]] = self.home
        return self.home + self.scale * (q - self.home), self.scale * dq, self.scale * ddq

    def scaled(self, factor: float) -> Motion:
        """Return the motion with all deviations from the home pose multiplied by `factor`, 0 to 1; the limits still hold."""
        return replace(self, scale=self.scale * factor)


def count(n_joints: int) -> int:
    """Return the number of design variables of a reference motion of an arm with `n_joints` joints."""
    return PER_JOINT * n_joints + 1


def build(numbers: Array, home: Array, limits: MotionLimits, duration: float, period: float) -> Motion:
    """Return the reference motion for given design variables, within the limits.

    Parameters
    ----------
    numbers : ndarray, shape (`count(n_joints)`,)
        Design variables from 0 to 1: one phase or two, with the first one's part of the time; then per joint and phase the pose, and an amplitude and
        a frequency for each of two oscillations. A motion with one phase has the first pose and all oscillations.
    home : ndarray, shape (n_joints,)
        Pose at the beginning and the end [rad or m], within the limits.
    limits : MotionLimits
        Limits of position, speed and acceleration.
    duration : float
        Length of the motion [s], 2 or more.
    period : float
        Sample period [s].
    """
    n = len(home)
    low, high = limits.position_min, limits.position_max
    table = numbers[1:].reshape(n, PHASES, 1 + 2 * SINES).transpose(1, 0, 2)
    poses, sines = table[:, :, 0], table[:, :, 1:]
    first = float(np.interp(numbers[0], (ONE_PHASE, 1.0), SHARES))
    shares = [first, 1.0 - first]
    if numbers[0] < ONE_PHASE:
        poses, sines, shares = poses[:1], np.concatenate(list(sines), axis=1)[None], [1.0]
    centres = low + poses * (high - low)
    available = duration - 2 * _REST_TIME_S
    moves = _moves(home, centres, limits)
    while sum(moves) > 0.5 * available and np.max(np.abs(centres - home)) > 1e-6:
        centres = home + 0.8 * (centres - home)
        moves = _moves(home, centres, limits)
    lengths = [share * (available - sum(moves)) for share in shares]
    parts = [moves[0], *(x for pair in zip(lengths, moves[1:], strict=True) for x in pair)]
    instants = _REST_TIME_S + np.cumsum([0.0, *parts])
    lowest = 1.0 / np.array(lengths)[:, None, None]
    frequency = lowest * (highest_frequency(limits, period)[None, :, None] / lowest) ** sines[:, :, 1::2]
    frequency = np.maximum(frequency, lowest)
    amplitude = np.empty_like(frequency)
    for i, length in enumerate(lengths):
        room = np.minimum(centres[i] - low, high - centres[i])
        omega = 2 * np.pi * frequency[i]
        most = np.minimum(limits.speed[:, None] / omega, limits.acceleration[:, None] / omega**2)
        wanted = np.minimum(room[:, None], most) * SMALLEST ** (1.0 - sines[i, :, ::2])
        tau = np.linspace(0.0, length, max(int(LOOK_HZ * length), 2))
        peaks = [np.max(np.abs(x), axis=0) for x in oscillation(tau, length, wanted, frequency[i])]
        allowed = (room, limits.speed, limits.acceleration)
        ratio = [a / np.maximum(p, 1e-12) for a, p in zip(allowed, peaks, strict=True)]
        # Between two of the compared points a peak may be higher by a hundredth.
        amplitude[i] = wanted * np.minimum(1.0, 0.99 * np.min(ratio, axis=0))[:, None]
    return Motion(home, tuple(float(x) for x in instants), duration, centres, amplitude, frequency)


def highest_frequency(limits: MotionLimits, period: float) -> Array:
    """Return the highest frequency of each joint's oscillations [Hz], shape (n_joints,)."""
    both = OVERTONE * limits.acceleration / (2 * np.pi * limits.speed)
    return np.minimum(np.clip(both, LEAST_HIGHEST, HIGHEST), 1.0 / (SAMPLES_PER_PERIOD * period))


def _moves(home: Array, centres: Array, limits: MotionLimits) -> list[float]:
    """Return the shortest times [s] of the moves, in each of which all joints move for the same time."""
    poses = [home, *centres, home]
    times = []
    for before, after in pairwise(poses):
        way = np.abs(after - before)
        by_speed = BLEND_SPEED * way / limits.speed
        by_acceleration = np.sqrt(BLEND_ACCELERATION * way / limits.acceleration)
        times.append(max(SHORTEST_MOVE, float(np.max(by_speed)), float(np.max(by_acceleration))))
    return times


def oscillation(tau: Array, length: float, amplitude: Array, frequency: Array) -> tuple[Array, Array, Array]:
    """Return the oscillation of a phase, faded in and out, with its two derivatives; each of shape (n_times, n_joints).

    Parameters
    ----------
    tau : ndarray, shape (n_times,)
        Times since the phase's beginning [s].
    length : float
        Length of the phase [s].
    amplitude, frequency : ndarray, shape (n_joints, n_sines)
        Amplitudes [rad or m] and frequencies [Hz] of the oscillations of each joint.
    """
    fade = min(FADE, FADE_PART * length)
    rise, fall = _blend(tau / fade), _blend((length - tau) / fade)
    e = rise[0] * fall[0]
    # Rise and fall do not overlap: where one changes, the other is 1.
    de, dde = (rise[1] - fall[1]) / fade, (rise[2] + fall[2]) / fade**2
    omega = 2 * np.pi * frequency
    offset = GOLDEN * np.arange(amplitude.size).reshape(amplitude.shape)
    angle = omega[None] * tau[:, None, None] + offset[None]
    w = np.sum(amplitude * np.sin(angle), axis=2)
    dw = np.sum(amplitude * omega * np.cos(angle), axis=2)
    ddw = -np.sum(amplitude * omega**2 * np.sin(angle), axis=2)
    e, de, dde = e[:, None], de[:, None], dde[:, None]
    return e * w, e * dw + de * w, e * ddw + 2 * de * dw + dde * w


def _blend(x: Array) -> tuple[Array, Array, Array]:
    """Return a fifth-order step from 0 to 1 over 0 to 1, with its two derivatives (Siciliano 2009)."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10 - 15 * x + 6 * x * x), 30 * x * x * (1 - x) ** 2, 60 * x * (1 - x) * (1 - 2 * x)


#: Design variables, 0 to 1, for a slow frequency and for a small amplitude in the usual motions.
_SLOW, _SMALL = 0.15, 0.4
#: Usual motions: the first design variable, and amplitudes and frequencies of the oscillations of both phases.
_PATTERNS: dict[str, tuple[float, tuple[float, float, float, float], tuple[float, float, float, float]]] = {
    "slow reversals": (0.65, (_SMALL, 0.35, 0.5, 0.5), (0.7, _SLOW, _SMALL, 0.4)),
    "fast multisine": (0.65, (1.0, 0.6, 0.9, 0.9), (1.0, 0.75, 0.9, 0.5)),
    "large travel": (0.65, (1.0, _SLOW, 0.3, 0.6), (1.0, 0.3, 0.3, 0.8)),
    "slow, then fast": (0.65, (0.6, 0.25, _SMALL, 0.5), (1.0, 0.6, 0.9, 0.85)),
    "one multisine": (0.15, (1.0, 0.05, 1.0, 0.3), (1.0, 0.45, 1.0, 0.6)),
    "one slow multisine": (0.15, (1.0, 0.0, 1.0, 0.2), (0.9, 0.3, 0.9, 0.4)),
}


def named(name: str, n_joints: int, poses: tuple[float, float] = (0.5, 0.5)) -> Array:
    """Return the design variables of one of the usual motions, with which a search begins.

    Parameters
    ----------
    name : {"slow reversals", "fast multisine", "large travel", "slow, then fast", "one multisine", "one slow multisine"}
        Name of the motion. The first four, with two phases, excite friction, inertia, effects of the position, and several of these; the
        others have one phase.
    n_joints : int
        Number of joints.
    poses : tuple of float, default the middle of the range
        Poses at which the joints oscillate, from 0 to 1 of their ranges.
    """
    start, first, second = _PATTERNS[name]
    joint = [poses[0], *first, poses[1], *second]
    return np.array([start, *joint * n_joints])
