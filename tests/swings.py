"""A pendulum and its swings, for tests that need a small arm."""

from __future__ import annotations

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
    """Eight seconds under five sines drawn from a seed."""
    t = np.arange(2000) * arm.sample_period
    draw = np.random.default_rng(seed).uniform(size=(3, 5))
    height, speed, phase = 0.1 + 0.3 * draw[0], 0.5 + 8.5 * draw[1], 6 * draw[2]
    tau = (height * np.sin(np.outer(t, speed) + phase)).sum(axis=1)
    return simulate(arm, t, tau, effects=effects, noise=noise, seed=seed, name=f"run {seed}")
