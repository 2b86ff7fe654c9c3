"""Simulated arm with plant, actuators and encoders, run under a source of commands and logged once per sample."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from armgap.trial.simulation.actuator import Actuator, Encoder
from armgap.trial.simulation.plant import Plant, PlantConfig

Array = NDArray[np.float64]
#: Function that returns the commands for the next sample from time [s] and measured positions [rad or m].
CommandSource = Callable[[float, list[float]], list[float]]


@dataclass
class SimulatedArm:
    """Simulated arm that effects modify: the plant's configuration, an actuator and an encoder per joint."""

    config: PlantConfig
    actuators: list[Actuator] = field(default_factory=list)
    encoders: list[Encoder] = field(default_factory=list)
    pulses: dict[str, list[tuple[int, float, float, float]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        arm = self.config.arm
        self.actuators = self.actuators or [Actuator() for _ in range(arm.n_joints)]
        self.encoders = self.encoders or [Encoder(s) for s in arm.step]


@dataclass(frozen=True)
class Trace:
    """Result of a simulated run: logged signals, and the true state.

    Attributes
    ----------
    t : ndarray, shape (n_samples,)
        Sample times [s].
    q, tau : ndarray, shape (n_samples, n_joints)
        Measured positions [rad or m] and commanded torques [N m or N].
    q_true, dq_true : ndarray, shape (n_samples, n_joints)
        True positions [rad or m] and velocities of the joints.
    """

    t: Array
    q: Array
    tau: Array
    q_true: Array
    dq_true: Array


def run(sim: SimulatedArm, source: CommandSource, duration: float) -> Trace:
    """Simulate an arm from rest at ``q = 0`` and return the trace, sampled once per sample period."""
    plant = Plant(sim.config)
    period = sim.config.arm.sample_period
    n = round(duration / period)
    q, tau, q_true, dq_true = (np.empty((n, plant.n)) for _ in range(4))
    t: Array = period * np.arange(n, dtype=np.float64)
    for k in range(n):
        q_true[k], dq_true[k] = plant.position(), plant.velocity()
        q[k] = [e(x) for e, x in zip(sim.encoders, plant.position(), strict=True)]
        tau[k] = source(float(t[k]), q[k].tolist())
        _one_sample(plant, sim.actuators, tau[k].tolist())
    return Trace(t, q, tau, q_true, dq_true)


def _one_sample(plant: Plant, actuators: list[Actuator], command: list[float]) -> None:
    if not plant.state_dependent and all(a.constant for a in actuators):
        plant.hold([a(u, plant.dt) for a, u in zip(actuators, command, strict=True)])
        return
    for _ in range(plant.steps_per_sample):
        plant.step([a(u, plant.dt) for a, u in zip(actuators, command, strict=True)])
