"""The arm of an arm file as a MuJoCo model whose parameters and effects can be set, for `mujoco.sysid`.

Base parameters fix the motion of an arm but not its masses; any masses with equal base parameters give the same motion. The masses chosen
are 1.2 times (link 2 of a two-link arm) or 2 times the smallest ones that leave positive inertias.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from armgap.arm.arm import Arm
from armgap.trial.baselines.regression import Array
from armgap.trial.simulation.engine import mujoco

__all__ = ["build_spec", "set_coulomb", "set_inertial"]

#: Longest internal time step of the MuJoCo model, s, and impedance of its friction constraints, as in the simulation of the logs.
_MAX_TIME_STEP_S, IMPEDANCE = 2.5e-3, 0.9999
#: Positive number that stands for zero in masses, inertias and friction levels of the MuJoCo model, SI.
TINY = 1e-9


def build_spec(arm: Arm) -> Any:
    """Return the MuJoCo specification of an arm: joints ``joint0``, ``joint1``, ..., each with one actuator and one position sensor."""
    mj = mujoco()
    spec = mj.MjSpec()
    spec.option.timestep = arm.sample_period / np.ceil(arm.sample_period / _MAX_TIME_STEP_S - TINY)
    spec.option.integrator = mj.mjtIntegrator.mjINT_RK4
    spec.option.disableflags |= mj.mjtDisableBit.mjDSBL_CONTACT
    spec.compiler.degree = False
    parent = spec.worldbody
    for j in range(arm.n_joints):
        parent = parent.add_body(name=f"link{j}")
        hinge = parent.add_joint(name=f"joint{j}", axis=[0, 1, 0] if arm.rotary else [1, 0, 0])
        hinge.type = mj.mjtJoint.mjJNT_HINGE if arm.rotary else mj.mjtJoint.mjJNT_SLIDE
        hinge.solref_friction = [2.0 * spec.option.timestep, 1.0]
        hinge.solimp_friction = [IMPEDANCE, IMPEDANCE, 1e-3, 0.5, 2.0]
        parent.explicitinertial = True
        _add_motor(mj, spec, j)
    set_inertial(spec, arm, arm.theta[: arm.n_inertial])
    spec.option.gravity = [0.0, 0.0, -arm.gravity]
    return spec


def _add_motor(mj: Any, spec: Any, j: int) -> None:
    motor = spec.add_actuator(name=f"motor{j}", trntype=mj.mjtTrn.mjTRN_JOINT, target=f"joint{j}")
    motor.gaintype, motor.biastype = mj.mjtGain.mjGAIN_FIXED, mj.mjtBias.mjBIAS_AFFINE
    spec.add_sensor(name=f"q{j}", type=mj.mjtSensor.mjSENS_JOINTPOS, objtype=mj.mjtObj.mjOBJ_JOINT, objname=f"joint{j}")


def set_coulomb(spec: Any, j: int, level: float) -> None:
    """Set the dry friction of a joint of a MuJoCo model [N m or N]."""
    spec.joint(f"joint{j}").frictionloss = max(level, TINY)


def set_inertial(spec: Any, arm: Arm, theta: Array) -> None:
    """Set masses, lengths and inertias of a MuJoCo model to those of an arm with base parameters `theta`, and actuators without offset.

    Raises
    ------
    ValueError
        No arm has the base parameters.
    """
    for j in range(arm.n_joints):
        spec.actuator(f"motor{j}").biasprm[0] = 0.0
    if arm.kind == "axis":
        _set_link(spec, 0, theta[0], 0.0, 1.0)
        spec.actuator("motor0").biasprm[0] = -theta[1]
    elif arm.kind == "pendulum":
        _set_pendulum(spec, theta[0], theta[1] / arm.gravity)
    else:
        _set_two_link(spec, arm, theta)


def _set_pendulum(spec: Any, inertia: float, moment: float) -> None:
    mass = 2.0 * moment**2 / inertia + TINY  # half of the inertia about the joint is inertia about the centre of mass
    _set_link(spec, 0, mass, moment / mass, inertia - moment**2 / mass)


def _set_two_link(spec: Any, arm: Arm, theta: Array) -> None:
    moment2 = theta[4] / arm.gravity
    length1 = theta[1] / moment2
    mass2 = 1.2 * moment2**2 / theta[2]
    moment1 = theta[3] / arm.gravity - mass2 * length1
    inertia1 = theta[0] - theta[2] - mass2 * length1**2
    if inertia1 <= 0:
        raise ValueError("no arm has these base parameters")
    mass1 = 2.0 * moment1**2 / inertia1 + TINY
    _set_link(spec, 0, mass1, moment1 / mass1, inertia1 - moment1**2 / mass1)
    _set_link(spec, 1, mass2, moment2 / mass2, theta[2] - moment2**2 / mass2)
    spec.body("link1").pos = [0.0, 0.0, -length1]


def _set_link(spec: Any, j: int, mass: float, com: float, inertia: float) -> None:
    body = spec.body(f"link{j}")
    body.mass, body.ipos = max(mass, TINY), [0.0, 0.0, -com]
    body.inertia = [max(inertia, TINY)] * 3
