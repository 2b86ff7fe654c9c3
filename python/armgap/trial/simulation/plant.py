"""Simulation of a trial's arm in MuJoCo, with dry friction that holds a joint at rest and changes sign at the instant of a reversal.

MuJoCo's ``frictionloss`` is a soft constraint, so its settings matter:

* impedance at its upper limit 0.9999 and a time constant of two (smallest) time steps: a joint that stops, stops
  within one step, and a joint held below its Coulomb level creeps at about ``1e-4 a dt``, with ``a`` the acceleration
  the load alone would give it (some 1e-7 rad/s);
* fourth-order Runge-Kutta between reversals, Newton's method with a tolerance of 1e-14;
* a step in which a joint reverses, stops, starts or meets an obstacle is undone and taken again in :data:`REFINE`
  parts, :data:`DEPTH` times over, so that the instant is known to about a tenth of a microsecond.

Measured on the arm of Table I of Reyes and Kelly (1997) (joint 1 / joint 2): held at 95 % of its Coulomb level it creeps 0.08 / 0.47 urad in 1 s;
windows of 0.25 s under the paper's torques end 0.09 / 0.33 urad RMS from an exact integration (encoder steps are 6.1 /
9.6 urad). Without the cut steps these errors are 193 / 839 urad RMS; with MuJoCo's default settings 7.1 / 31 mrad,
and the creep is 3.4 / 19 mrad.

Friction that varies (with speed, load, position, time) is set on ``dof_frictionloss`` before each step, at the state
half a step ahead. Torque laws go to ``qfrc_applied``, at the same half step. Elasticity and play are modelled by a separate
rotor body that a fixed tendon (spring and damper, or a limit) ties to the joint.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from armgap.trial.simulation.arms import TrialArm
from armgap.trial.simulation.engine import mujoco

#: Largest internal time step of the MuJoCo simulation of a trial arm, s.
TIME_STEP = 2.5e-4
#: Parts into which a simulation step with a reversal is cut, and number of times this is repeated.
REFINE = 8
DEPTH = 4
#: Speed below which a joint counts as standing, rad/s or m/s.
STANDING = 1e-5
#: Impedance of MuJoCo's soft constraints for dry friction and play: the largest that MuJoCo accepts.
IMPEDANCE = 0.9999


@dataclass
class JointState:
    """State of one joint half a step ahead, for torque and friction laws [SI]: `load` is ``C dq + g``, `others` are (q, dq) of all joints."""

    t: float
    q: float
    dq: float
    tau: float
    load: float
    others: list[tuple[float, float]]


#: Function of a joint's state that returns an additional torque on the joint [N m or N].
TorqueLaw = Callable[[JointState], float]
#: Function of a joint's state and Coulomb friction level that returns an addition to the level [N m or N].
FrictionLaw = Callable[[JointState, float], float]


@dataclass
class Rotor:
    """A body on the motor's side, tied to its joint by a spring and damper (``stiffness``, ``damping``) or by play (``gap``) [SI].

    The inertia of an additional rotor acts on the rotor's own acceleration only; that of a rotor with ``part_of_link`` is
    taken out of the link's inertia, so that the arm with the play closed is the nominal arm.
    """

    inertia: float
    stiffness: float = 0.0
    damping: float = 0.0
    gap: float | None = None
    part_of_link: bool = False


@dataclass
class Flexure:
    """Flexibility of the last link: its outer part, with the share ``mass_share`` of the mass, is mounted on a spring and damper [SI]."""

    stiffness: float
    damping: float
    mass_share: float = 0.3


@dataclass
class PlantConfig:
    """Configuration of the MuJoCo plant: the nominal arm and its changes by effects.

    Attributes
    ----------
    tilt : float
        Angle by which the base is turned against gravity, rad; adds to ``q1`` in the gravity terms.
    payload : (mass, distance), optional
        Point mass on the last link, kg and m.
    armature : dict of joint to float
        Inertia that acts on the joint's own acceleration only, kg m^2 (kg).
    spring : dict of joint to (k, q0, cubic)
        Torque ``-k (q - q0) - cubic (q - q0)^3``, N m (N), with `q` in rad (m).
    drag : dict of joint to (quadratic, cubic)
        Torque ``-quadratic dq |dq| - cubic dq^3``, N m (N), with `dq` in rad/s (m/s).
    discontinuities : dict of joint to list of float
        Positions at which a torque law jumps, rad (m); an integration step across one is divided there, as at a reversal of the velocity.
    coupling : (rotor inertia, gear), optional
        Rotor of joint 2 on link 1, inertia in kg m^2, with the kinetic energy ``inertia (dq1 + gear dq2)^2 / 2``.
    torque_laws : dict of joint to list
        Functions of the joint's state that return an additional torque, N m (N).
    friction_laws : dict of joint to list
        Functions of the joint's state and of its Coulomb level so far that return an addition to the level, N m (N).
    """

    arm: TrialArm
    tilt: float = 0.0
    payload: tuple[float, float] | None = None
    armature: dict[int, float] = field(default_factory=dict)
    spring: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    rotors: dict[int, Rotor] = field(default_factory=dict)
    flexure: Flexure | None = None
    coupling: tuple[float, float] | None = None
    torque_laws: dict[int, list[TorqueLaw]] = field(default_factory=dict)
    friction_laws: dict[int, list[FrictionLaw]] = field(default_factory=dict)
    drag: dict[int, tuple[float, float]] = field(default_factory=dict)
    discontinuities: dict[int, list[float]] = field(default_factory=dict)


class Plant:
    """Simulation of one arm in MuJoCo; joints count from 0.

    Parameters
    ----------
    config : PlantConfig
        Nominal arm and its changes by effects.
    """

    def __init__(self, config: PlantConfig) -> None:
        from armgap.trial.simulation.model import compile_model

        self._mj = mujoco()
        self._config = config
        self.n = config.arm.n_joints
        self.steps_per_sample = math.ceil(config.arm.sample_period / TIME_STEP - 1e-9)
        self.dt = config.arm.sample_period / self.steps_per_sample
        self.model: Any = compile_model(config, self.dt)
        self.data: Any = self._mj.MjData(self.model)
        self.dof = [self.model.joint(f"joint{j}").dofadr[0] for j in range(self.n)]
        self.motor = [self._motor_dof(j) for j in range(self.n)]
        self._coulomb = list(config.arm.coulomb)
        self._slope = [0.0] * self.n
        self.state_dependent = bool(config.torque_laws or config.friction_laws)

    def _motor_dof(self, joint: int) -> int:
        name = f"rotor{joint}" if joint in self._config.rotors else f"joint{joint}"
        return int(self.model.joint(name).dofadr[0])

    @property
    def time(self) -> float:
        """Time since the start of the simulation, s."""
        return float(self.data.time)

    def position(self) -> list[float]:
        """Return the joint positions, rad (m on an axis)."""
        return [float(self.data.qpos[i]) for i in self.dof]

    def velocity(self) -> list[float]:
        """Return the joint velocities, rad/s (m/s on an axis)."""
        return [float(self.data.qvel[i]) for i in self.dof]

    def place(self, q: list[float], dq: list[float], t: float = 0.0) -> None:
        """Set joints and their rotors to a state: positions, velocities, and time [s]."""
        self._mj.mj_resetData(self.model, self.data)
        self.data.time = t
        for j in range(self.n):
            for i in {self.dof[j], self.motor[j]}:
                self.data.qpos[i], self.data.qvel[i] = q[j], dq[j]
        self._mj.mj_forward(self.model, self.data)
        self._slope = [0.0] * self.n

    def hold(self, tau: list[float]) -> None:
        """Advance the simulation by one sample period under constant torques, without state-dependent laws."""
        before = self._snapshot()
        self._drive(tau, self.dt)
        self._mj.mj_step(self.model, self.data, self.steps_per_sample)
        if self._reversed(before):
            self._restore(before)
            for _ in range(self.steps_per_sample):
                self.step(tau)
        else:
            self._remember(before, self.dt * self.steps_per_sample)

    def step(self, tau: list[float]) -> None:
        """Advance the simulation by one internal step under constant torques."""
        self._step(tau, self.dt, DEPTH)

    def _step(self, tau: list[float], dt: float, depth: int) -> None:
        before = self._snapshot()
        self.model.opt.timestep = dt
        self._drive(tau, dt)
        self._mj.mj_step(self.model, self.data)
        if depth and (self._reversed(before) or self._crossed(before)):
            self._restore(before)
            for _ in range(REFINE):
                self._step(tau, dt / REFINE, depth - 1)
        else:
            self._remember(before, dt)
        self.model.opt.timestep = self.dt

    def _remember(self, before: tuple[Any, Any, float], dt: float) -> None:
        change = self.data.qvel - before[1]
        self._slope = [float(change[i]) / dt for i in self.dof]

    def _drive(self, tau: list[float], dt: float) -> None:
        self.data.qfrc_applied[:] = 0.0
        points = self._points(tau, dt) if self.state_dependent else None
        for j in range(self.n):
            self.data.qfrc_applied[self.motor[j]] += tau[j]
            if points:
                self._apply_laws(j, points[j])

    def _apply_laws(self, joint: int, point: JointState) -> None:
        for law in self._config.torque_laws.get(joint, ()):
            self.data.qfrc_applied[self.dof[joint]] += law(point)
        if joint in self._config.friction_laws:
            level = self._coulomb[joint]
            for extra in self._config.friction_laws[joint]:
                level += extra(point, level)
            self.model.dof_frictionloss[self.dof[joint]] = max(level, 0.0)

    def _points(self, tau: list[float], dt: float) -> list[JointState]:
        q, dq = self.position(), self.velocity()
        ahead = [v + 0.5 * dt * a for v, a in zip(dq, self._slope, strict=True)]
        # For a joint that stands, or would reverse within half a step, the present velocity is taken.
        ahead = [a if a * v > 0 and abs(v) > STANDING else v for a, v in zip(ahead, dq, strict=True)]
        half = [x + 0.5 * dt * v for x, v in zip(q, dq, strict=True)]
        states = list(zip(half, ahead, strict=True))
        load = self.data.qfrc_bias
        return [
            JointState(self.time + 0.5 * dt, *states[j], tau[j], float(load[self.dof[j]]), states)
            for j in range(self.n)
        ]

    def _snapshot(self) -> tuple[Any, Any, float]:
        return self.data.qpos.copy(), self.data.qvel.copy(), float(self.data.time)

    def _restore(self, state: tuple[Any, Any, float]) -> None:
        self.data.qpos[:], self.data.qvel[:], self.data.time = state

    def _reversed(self, before: tuple[Any, Any, float]) -> bool:
        for i in self.dof:
            old, new = float(before[1][i]), float(self.data.qvel[i])
            small = min(abs(old), abs(new)) < max(STANDING, 2.0 * abs(new - old))
            moving = max(abs(old), abs(new)) > STANDING
            if moving and small and (old * new <= 0 or min(abs(old), abs(new)) < abs(new - old)):
                return True
        return False

    def _crossed(self, before: tuple[Any, Any, float]) -> bool:
        for j, positions in self._config.discontinuities.items():
            old, new = float(before[0][self.dof[j]]), float(self.data.qpos[self.dof[j]])
            if any((old < x) != (new < x) for x in positions):
                return True
        return False
