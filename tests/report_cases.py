"""Diagnoses that the tests of reports share: with a named cause, without a cause, unexplained; each is made once per session."""

from __future__ import annotations

import functools

import numpy as np

from armgap import Arm, Diagnosis, Log, diagnose, simulate
from armgap.simulation import Effect

# Inertia [kg m^2], m g l [N m], viscous [N m s/rad] and Coulomb friction [N m] of a pendulum; standard deviations of 10 and 50 %.
THETA = np.array([0.05, 0.6, 0.02, 0.1])
HOSTILE = '<script>alert("x")</script>&"\'|$'
ARM = Arm(HOSTILE, "pendulum", 9.81, 0.004, THETA, sigma=np.array([0.1, 0.1, 0.5, 0.5]) * THETA)
STRIBECK = Effect("stribeck", 1, {"amplitude": 0.15, "velocity": 0.3})
SAMPLES = 1500
NOISE = 2e-4


def swing(seed: int, *effects: Effect, unlogged: float = 0.0, name: str | None = None) -> Log:
    """Return a log of six seconds under a torque of five random sines; `unlogged` is the amplitude of a further torque [N m] not in the log."""
    t = np.arange(SAMPLES) * ARM.sample_period
    draw = np.random.default_rng(seed).uniform(size=(3, 5))
    tau = ((0.1 + 0.3 * draw[0]) * np.sin(np.outer(t, 0.5 + 8.5 * draw[1]) + 6 * draw[2])).sum(axis=1)
    extra = unlogged * np.sin(11.0 * t + seed) * np.sin(0.7 * t)
    moved = simulate(ARM, t, tau + extra, effects=effects, noise=NOISE, seed=seed)
    return Log(name or f"swing {seed}", moved.t, moved.q, tau[:, None])


def _diagnosis(*effects: Effect, unlogged: float = 0.0) -> Diagnosis:
    logs = [swing(seed, *effects, unlogged=unlogged) for seed in (1, 2)]
    return diagnose(logs, ARM, holdout=swing(3, *effects, unlogged=unlogged, name=HOSTILE))


@functools.cache
def named() -> Diagnosis:
    """Return a diagnosis that names Stribeck friction as cause."""
    return _diagnosis(STRIBECK)


@functools.cache
def none() -> Diagnosis:
    """Return a diagnosis of an arm that equals its nominal model."""
    return _diagnosis()


@functools.cache
def unexplained() -> Diagnosis:
    """Return a diagnosis of an arm with a torque that is not in the log and that no effect of the library resembles."""
    return _diagnosis(unlogged=0.3)


CASES = {"effect": named, "none": none, "unexplained": unexplained}
"""Functions that return a diagnosis, by its verdict."""
