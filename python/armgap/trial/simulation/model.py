"""Building of the MuJoCo model of a :class:`~armgap.trial.simulation.plant.PlantConfig` with ``MjSpec``."""

from __future__ import annotations

import math
from typing import Any

from armgap.trial.simulation.engine import mujoco
from armgap.trial.simulation.plant import DEPTH, IMPEDANCE, REFINE, Flexure, PlantConfig, Rotor


def compile_model(config: PlantConfig, dt: float) -> Any:
    """Compile the MuJoCo model of a plant with an internal step of ``dt`` seconds."""
    mj = mujoco()
    spec = mj.MjSpec()
    _set_options(spec, mj, config, dt)
    parent, bodies = spec.worldbody, []
    for joint in range(config.arm.n_joints):
        if joint in config.rotors and config.rotors[joint].part_of_link:
            _add_rotor(mj, parent, config, joint)
        parent = _add_link(mj, parent, config, joint, dt)
        bodies.append(parent)
    for joint, rotor in config.rotors.items():
        if not rotor.part_of_link:
            _add_rotor(mj, spec.worldbody, config, joint)
        _tie_rotor(spec, rotor, joint, dt)
    _add_payload(bodies[-1], config)
    _add_coupling(spec, config)
    return spec.compile()


def _set_options(spec: Any, mj: Any, config: PlantConfig, dt: float) -> None:
    angle = config.tilt + (config.arm.slope if config.arm.kind == "axis" else 0.0)
    sign = -1.0 if config.arm.kind == "axis" else 1.0
    g = config.arm.gravity
    spec.option.gravity = [sign * g * math.sin(angle), 0.0, -g * math.cos(angle)]
    spec.option.timestep = dt
    spec.option.integrator = mj.mjtIntegrator.mjINT_RK4
    spec.option.solver = mj.mjtSolver.mjSOL_NEWTON
    spec.option.tolerance = 1e-14
    spec.option.iterations = 200
    spec.option.disableflags |= mj.mjtDisableBit.mjDSBL_CONTACT
    spec.compiler.degree = False


def _add_link(mj: Any, parent: Any, config: PlantConfig, joint: int, dt: float) -> Any:
    arm = config.arm
    offset = [0.0, 0.0, -arm.length[joint - 1]] if joint else [0.0, 0.0, 0.0]
    body = parent.add_body(name=f"link{joint}", pos=offset)
    axis_kind = arm.kind == "axis"
    hinge = body.add_joint(name=f"joint{joint}", axis=[1, 0, 0] if axis_kind else [0, 1, 0])
    hinge.type = mj.mjtJoint.mjJNT_SLIDE if axis_kind else mj.mjtJoint.mjJNT_HINGE
    hinge.damping = [arm.viscous[joint], *config.drag.get(joint, (0.0, 0.0))]
    hinge.armature = config.armature.get(joint, 0.0)
    _set_friction(hinge, arm.coulomb[joint], dt)
    _set_spring(hinge, config, joint)
    inertia = arm.inertia[joint] - _inertia_in_rotor(config, joint)
    if config.flexure is not None and joint == arm.n_joints - 1:
        _add_flexible(mj, body, config, config.flexure)
    else:
        _set_mass(body, arm.mass[joint], arm.com[joint], inertia)
    return body


def _set_friction(hinge: Any, level: float, dt: float) -> None:
    hinge.frictionloss = max(level, 1e-12)
    hinge.solref_friction = [2.0 * dt / REFINE**DEPTH, 1.0]
    hinge.solimp_friction = [IMPEDANCE, IMPEDANCE, 1e-3, 0.5, 2.0]


def _set_spring(hinge: Any, config: PlantConfig, joint: int) -> None:
    k, q0, cubic = config.spring.get(joint, (0.0, 0.0, 0.0))
    hinge.stiffness = [k, 0.0, cubic]
    hinge.springref = q0


def _set_mass(body: Any, mass: float, com: float, inertia: float) -> None:
    moment = max(inertia, 1e-9)  # inertia about y; those about x and z do not matter to a planar arm
    body.mass, body.ipos, body.inertia = mass, [0.0, 0.0, -com], [moment, moment, moment]
    body.explicitinertial = True


def _inertia_in_rotor(config: PlantConfig, joint: int) -> float:
    rotor = config.rotors.get(joint)
    return rotor.inertia if rotor is not None and rotor.part_of_link else 0.0


def _add_rotor(mj: Any, parent: Any, config: PlantConfig, joint: int) -> None:
    rotor, arm = config.rotors[joint], config.arm
    offset = [0.0, 0.0, -arm.length[joint - 1]] if rotor.part_of_link and joint else [0.0] * 3
    body = parent.add_body(name=f"rotor{joint}", pos=offset)
    slide = arm.kind == "axis"
    hinge = body.add_joint(name=f"rotor{joint}", axis=[1, 0, 0] if slide else [0, 1, 0])
    hinge.type = mj.mjtJoint.mjJNT_SLIDE if slide else mj.mjtJoint.mjJNT_HINGE
    body.gravcomp = 1.0
    _set_mass(body, rotor.inertia if slide else 1e-9, 0.0, 1e-9 if slide else rotor.inertia)


def _tie_rotor(spec: Any, rotor: Rotor, joint: int, dt: float) -> None:
    tendon = spec.add_tendon(name=f"tie{joint}")
    tendon.wrap_joint(f"rotor{joint}", 1.0)
    tendon.wrap_joint(f"joint{joint}", -1.0)
    tendon.springlength = [0.0, 0.0]
    tendon.stiffness = [rotor.stiffness, 0.0, 0.0]
    tendon.damping = [rotor.damping, 0.0, 0.0]
    if rotor.gap is not None:
        tendon.limited = 1
        tendon.range = [-0.5 * rotor.gap, 0.5 * rotor.gap]
        tendon.solref_limit = [4.0 * dt, 1.0]
        tendon.solimp_limit = [IMPEDANCE, IMPEDANCE, 1e-3, 0.5, 2.0]


def _add_flexible(mj: Any, body: Any, config: PlantConfig, flexure: Flexure) -> None:
    """Split the last link into two bodies joined by the flexure; if the flexure is rigid, they equal the nominal link."""
    arm, last = config.arm, config.arm.n_joints - 1
    mass, com, inertia = arm.mass[last], arm.com[last], arm.inertia[last]
    share, slide = flexure.mass_share, arm.kind == "axis"
    reach = 0.0 if slide else 0.4 * math.sqrt(inertia / mass)
    outer_com, inner_com = com + reach, com - reach * share / (1.0 - share)
    spread = share * mass * reach**2 + (1 - share) * mass * (com - inner_com) ** 2
    outer = body.add_body(name="tip", pos=[0.0, 0.0, -inner_com])
    hinge = outer.add_joint(name="flexure", axis=[1, 0, 0] if slide else [0, 1, 0])
    hinge.type = mj.mjtJoint.mjJNT_SLIDE if slide else mj.mjtJoint.mjJNT_HINGE
    hinge.stiffness, hinge.damping = [flexure.stiffness, 0, 0], [flexure.damping, 0, 0]
    _set_mass(body, (1 - share) * mass, inner_com, 0.6 * (inertia - spread))
    _set_mass(outer, share * mass, outer_com - inner_com, 0.4 * (inertia - spread))


def _add_payload(body: Any, config: PlantConfig) -> None:
    if config.payload is None:
        return
    mass, distance = config.payload
    load = body.add_body(name="payload", pos=[0.0, 0.0, -distance])
    _set_mass(load, mass, 0.0, 1e-9)


def _add_coupling(spec: Any, config: PlantConfig) -> None:
    if config.coupling is None:
        return
    inertia, gear = config.coupling
    tendon = spec.add_tendon(name="coupling")
    tendon.wrap_joint("joint0", 1.0)
    tendon.wrap_joint("joint1", gear)
    tendon.armature = inertia
