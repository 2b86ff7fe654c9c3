"""Corrected models of serial arms: physically consistent links, rotors and friction, gravity in the frame of the base."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.arm.controller import Controller
from armgap.arm.rigid_body import INERTIAL_NAMES, about_axis, about_com, about_origin
from armgap.arm.serial.chain import SerialChain
from armgap.diagnosis.result import Cause, Diagnosis, Value
from armgap.export.chain.bodies import Bodies, nearest_bodies
from armgap.export.chain.controller import OF_CONTROLLER, controller_with_causes
from armgap.export.chain.joint import Joint, with_causes
from armgap.export.chain.model import SimulatorModel
from armgap.export.chain.motion import any_states, diagnosed_states, positions
from armgap.export.corrected import LEAST_SIGMA, Corrected, value
from armgap.export.errors import ExportError

__all__ = ["CorrectedSerial", "correct_serial"]

Array = NDArray[np.float64]

#: Names of the parameters of a payload that state the position of its mass.
_COM = ("com_x", "com_y", "com_z")
#: Formats without a position controller, and what takes its place.
_NO_CONTROLLER = {"mjcf": "its actuators are motors", "urdf": "URDF holds no controller"}


@dataclass(frozen=True)
class CorrectedSerial(Corrected):
    """Model of a serial arm with the parameters and causes of a diagnosis.

    Attributes
    ----------
    chain : SerialChain
        Chain with gravity rotated by the estimated tilt of the base.
    tilt : ndarray, shape (3, 3)
        Rotation of the base by the estimated tilt.
    exceeded : tuple of str
        Names of the joints that moved beyond their limits of position in the diagnosed logs.
    expected : ndarray, shape (11 n_joints,)
        Nominal inertial parameters of links, ten each, and rotors, with an identified payload or change of a link added.
    regressor : ndarray, shape (n_states, n_joints, 11 n_joints)
        Torques per unit of each inertial parameter, along the diagnosed motion and in random states.
    bodies : Bodies
        Physically consistent links with the torques of the estimated links, see `nearest_bodies`.
    controller : Controller, optional
        The arm file's position controller with the gains that causes change.
    """

    chain: SerialChain
    tilt: Array
    exceeded: tuple[str, ...]
    expected: Array
    regressor: Array
    bodies: Bodies
    controller: Controller | None = None

    def beside(self, hanging: Array) -> CorrectedSerial:
        """Return the model with links that stay physically consistent without the parts `hanging`, ten inertial parameters per link."""
        found, n = self.theta[: 11 * self.arm.n_joints], self.arm.n_joints
        bodies = nearest_bodies(found, self.expected, self.arm.sigma[: 11 * n], self.regressor, hanging)
        pairs = zip(self.joints, bodies.rotor - self.bodies.rotor, strict=True)
        joints = tuple(replace(joint, armature=joint.armature + float(more)) for joint, more in pairs)
        return replace(self, bodies=bodies, joints=joints)

    def simulated(self, form: str) -> SimulatorModel:
        """Return the arm as a chain for MJCF or URDF, without limits of position that the logs exceed."""
        beyond = np.isin(self.chain.joint_names, self.exceeded)
        low, high = np.where(beyond, -np.inf, self.chain.lower), np.where(beyond, np.inf, self.chain.upper)
        chain = replace(self.chain, lower=low, upper=high)
        return SimulatorModel(self.arm.name, chain, self.bodies.inertial, self.joints, self.arm.sample_period)

    def nominal(self) -> Arm:
        """Return the arm with the estimated parameters, whether or not every single link is physically consistent."""
        n, theta = self.arm.n_joints, self.theta.copy()
        theta[10 * n : 11 * n] += np.array([joint.armature for joint in self.joints]) - self.bodies.rotor
        # Each column holds one kind of parameter: the ten of the links, rotor inertias, viscous and Coulomb friction.
        kinds = np.column_stack([np.abs(theta[: 10 * n]).reshape(n, 10), np.abs(theta[10 * n :]).reshape(3, n).T])
        scale = np.where(kinds > 0, kinds, np.maximum(kinds.max(axis=0), np.finfo(np.float64).tiny))
        least = LEAST_SIGMA * np.concatenate([scale[:, :10].ravel(), scale[:, 10:].T.ravel()])
        sigma = np.maximum(self.sigma, least)
        return replace(
            self.arm,
            name=f"{self.arm.name}, corrected",
            theta=theta,
            sigma=sigma,
            chain=self.chain,
            controller=self.controller,
            sealed=None,
            notes=(),
        )

    def remarks(self, form: str, *, original: bool = False) -> tuple[str, ...]:
        """Return remarks on the exported file of a format, one line each: what the format cannot hold, and what was chosen.

        Parameters
        ----------
        form : str
            Key of `FORMATS`.
        original : bool, default False
            Whether the values are written into the user's own description.
        """
        own_servos = original and form == "mjcf"
        lines = [*self.missing(form, OF_CONTROLLER if own_servos else ()), *self.notes]
        if form == "toml":
            return tuple(lines)
        if self.controller is not None and form in _NO_CONTROLLER and not own_servos:
            lines.append(f"the position controller of the arm file is not in the file: {_NO_CONTROLLER[form]}")
        if self.exceeded:
            what = "they are left as they were" if original else "they are left out"
            lines.append(f"the arm moves beyond the limits of position of {', '.join(self.exceeded)}: {what}")
        return (*lines, *_said(self.bodies, self.chain))

    def short(self, cause: Cause, form: str) -> str:
        """Return what the field of a format does not express of a cause, or the reason why the format has none; empty for nothing to be said."""
        if cause.effect not in OF_CONTROLLER:
            return super().short(cause, form)
        if cause.effect == "reference_delay":
            return "delay the reference, but not the feedback, in your own controller"
        if form in ("toml", "json") or self.controller is None or cause.joint is None:
            return ""
        name = "kp" if cause.effect == "controller_gain" else "kd"
        return f"set {name} = {getattr(self.controller, name)[cause.joint - 1]:.6g} in your own controller"

    def data(self) -> dict[str, Any]:
        """Return entries of the exported JSON object that only serial arms have: physically consistent links, and gravity."""
        links = []
        for name, ten in zip(self.chain.link_names, self.bodies.inertial, strict=True):
            mass, com, inertia = about_com(ten)
            links.append({"name": name, "mass": mass, "com": com.tolist(), "inertia": inertia.tolist()})
        changed = [self.chain.link_names[k] for k in self.bodies.changed]
        servo = self.controller
        gains = {} if servo is None else {name: values.tolist() for name, values in servo.vectors}
        return {
            **({} if servo is None else {"controller": {"kind": servo.kind, "kd_on": servo.kd_on, **gains}}),
            "links": links,
            "gravity": self.chain.gravity.tolist(),
            "projected": {"links": changed, "torque_error": self.bodies.torque_error.tolist()},
        }


def _said(bodies: Bodies, chain: SerialChain) -> tuple[str, ...]:
    """Return remarks on links that were not physically consistent as estimated."""
    if not bodies.changed:
        return ()
    names = ", ".join(f"`{chain.link_names[k]}`" for k in bodies.changed)
    if bodies.same_torques:
        worst = 100 * float(np.max(bodies.torque_error))
        return (
            f"no body has the values found for {names}: the links are the nearest bodies to the arm file's with the same torques (to {worst:.2g} %)",
        )
    errors = ", ".join(f"{100 * error:.2g}" for error in bodies.torque_error)
    return (
        f"no body has the values found for {names}, and no bodies have their torques: the links are those that come nearest, "
        f"their torques differ by (RMS, % of each joint's) {errors}",
    )


def correct_serial(
    arm: Arm,
    stage: str,
    values: Sequence[Value],
    causes: tuple[Cause, ...],
    notes: tuple[str, ...],
    diagnosis: Diagnosis,
) -> CorrectedSerial:
    """Make a corrected model from the estimated parameters and causes of a serial arm; see `armgap.correct`."""
    assert arm.chain is not None
    n, chain = arm.n_joints, arm.chain
    theta, sigma = (np.array([getattr(v, name) for v in values]) for name in ("value", "sigma"))
    expected, tilt = arm.theta[: 11 * n].copy(), np.eye(3)
    for cause in causes:
        if cause.effect in _ON_LINK:
            link, change, variance = _ON_LINK[cause.effect](cause, n)
            rows = slice(10 * link, 10 * link + 10)
            theta[rows] += change
            expected[rows] += change
            sigma[rows] = np.sqrt(sigma[rows] ** 2 + variance)
        elif cause.effect == "rotor_inertia" and cause.joint is not None:
            row = 10 * n + cause.joint - 1
            sigma[row] = math.hypot(sigma[row], cause.parameters["inertia"].sigma)
        elif cause.effect == "base_tilt":
            tilt = tilt @ _turned(cause)
    controller, said = controller_with_causes(arm, causes)
    viscous, coulomb = theta[11 * n :].reshape(2, n)
    limits = arm.torque_limit if arm.torque_limit is not None else chain.effort
    random = any_states(arm)
    states = diagnosed_states(diagnosis, n)
    every = random if states is None else tuple(np.concatenate(pair) for pair in zip(states, random, strict=True))
    rotors = every[2][:, :, None] * np.eye(n)
    regressor = np.concatenate(
        [replace(chain, gravity=tilt.T @ chain.gravity).native().regressor(*every), rotors], axis=2
    )
    bodies = nearest_bodies(theta[: 11 * n], expected, arm.sigma[: 11 * n], regressor, np.zeros((n, 10)))
    joints = [
        Joint(
            float(viscous[j]),
            float(coulomb[j]),
            armature=float(bodies.rotor[j]),
            limit=float(limits[j]) if math.isfinite(limits[j]) else None,
        )
        for j in range(n)
    ]
    return CorrectedSerial(
        arm,
        stage,
        theta,
        sigma,
        with_causes(joints, causes),
        causes,
        (*notes, *said),
        diagnosis.verdict,
        replace(chain, gravity=tilt.T @ chain.gravity),
        tilt,
        _exceeded(chain, diagnosis),
        expected,
        regressor,
        bodies,
        controller,
    )


def _payload(cause: Cause, n: int) -> tuple[int, Array, Array]:
    """Return the link (from 0) with a payload, the change of its ten inertial parameters by the point mass, and the change's variance."""
    mass, com = value(cause, "mass"), np.array([value(cause, name) for name in _COM])
    sigma = [cause.parameters[name].sigma for name in ("mass", *_COM)]
    moved = [about_origin(mass + sigma[0], com, np.zeros((3, 3)))]
    moved += [
        about_origin(mass, com + s * axis, np.zeros((3, 3))) for s, axis in zip(sigma[1:], np.eye(3), strict=True)
    ]
    change = about_origin(mass, com, np.zeros((3, 3)))
    return n - 1, change, np.sum((np.array(moved) - change) ** 2, axis=0)


def _nominal_link(cause: Cause, n: int) -> tuple[int, Array, Array]:
    """Return the link (from 0) that a cause changes, the change of its ten inertial parameters, and the change's variance."""
    if cause.joint is None or not 1 <= cause.joint <= n:
        raise ExportError(f"the cause nominal_link is of joint {cause.joint}", remedy=f"joints: 1 to {n}")
    values = [cause.parameters[name] for name in INERTIAL_NAMES]
    return cause.joint - 1, np.array([v.value for v in values]), np.array([v.sigma for v in values]) ** 2


_ON_LINK = {"payload": _payload, "nominal_link": _nominal_link}


def _turned(cause: Cause) -> Array:
    """Return the rotation of the base, shape (3, 3), for a tilt given as a rotation vector about horizontal axes."""
    turn = np.array([value(cause, axis) if axis in cause.parameters else 0.0 for axis in "xyz"])
    angle = float(np.linalg.norm(turn))
    return np.eye(3) if angle == 0 else about_axis(turn / angle, angle)


def _exceeded(chain: SerialChain, diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return the names of the joints that the diagnosed motion moves beyond their limits of position."""
    beyond = np.zeros(chain.n_joints, dtype=bool)
    for _, q in positions(diagnosis, chain.n_joints):
        beyond |= (q.min(axis=0) < chain.lower) | (q.max(axis=0) > chain.upper)
    return tuple(name for name, is_beyond in zip(chain.joint_names, beyond, strict=True) if is_beyond)
