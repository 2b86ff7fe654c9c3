"""Motions for tests: swings of a pendulum, and of a two-link arm, with parameters other than its arm file's, under sine torques."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from armgap import Arm, Log, simulate
from armgap.simulation import Effect

PENDULUM = """\
name = "Pendulum"
kind = "pendulum"
gravity = 9.81
sample_period = 0.004

[inertial]
theta = [0.05, 0.6]

[friction]
viscous = [0.02]
coulomb = [0.1]
"""
NOISE_RAD = 2e-4


def swing(arm: Arm, seed: int, *effects: Effect, noise: float = NOISE_RAD) -> Log:
    """Return a log of eight seconds of a pendulum under a torque of five sines drawn from the seed."""
    t = np.arange(2000) * arm.sample_period
    draw = np.random.default_rng(seed).uniform(size=(3, 5))
    height, speed, phase = 0.1 + 0.3 * draw[0], 0.5 + 8.5 * draw[1], 6 * draw[2]
    tau = (height * np.sin(np.outer(t, speed) + phase)).sum(axis=1)
    return simulate(arm, t, tau, effects=effects, noise=noise, seed=seed, name=f"run {seed}")


def off(arm: Arm) -> Arm:
    """Return the arm with parameters that differ by up to 5 % from those of its file."""
    return replace(arm, theta=arm.theta * np.random.default_rng(5).uniform(0.95, 1.05, len(arm.theta)))


def sines(t: np.ndarray, seed: int) -> np.ndarray:
    """Return torques of a two-link arm [N m]: five sines on each joint, drawn from a seed, shape (n_samples, 2)."""
    draw = np.random.default_rng(seed)
    speed, phase = 2 * np.pi * draw.uniform(0.4, 2.6, (2, 5)), draw.uniform(0, 6.28, (2, 5))
    return np.sin(t[:, None, None] * speed + phase).sum(axis=2) * [18.0, 2.1]


def carried(arm: Arm, *hidden: Effect, scale: float = 1.0) -> list[Log]:
    """Return two logs of the arm that `off` returns, with the hidden effects, under torques `scale` times those of `sines`."""
    t = np.arange(2400) * arm.sample_period
    torques = [scale * sines(t, seed) for seed in (3, 4)]
    return [
        simulate(off(arm), t, tau, effects=list(hidden), noise=2e-5, seed=seed, name=f"run {seed}")
        for seed, tau in enumerate(torques)
    ]
