"""Gains, limits and remarks that a joint of a compiled MJCF model has from its actuators."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.arm.description.tree import Joint

__all__ = ["Actuators"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Actuator:
    """An actuator on a joint: torque ``gear (gain u + bias[0] + bias[1] gear q + bias[2] gear dq)``, if its gain is fixed and its bias affine.

    Attributes
    ----------
    index : int
        Number of the actuator in the model.
    name : str
        Name, or number in words.
    kind : {"position", "velocity", "torque", "other"}
        What the command `u` is; ``"other"`` for laws that are not as above.
    gear, gain : float
        Gear ratio and gain.
    bias : ndarray, shape (3,)
        Constant, and factors of position and velocity.
    """

    index: int
    name: str
    kind: str
    gear: float
    gain: float
    bias: Array


class Actuators:
    """Actuators of a compiled MJCF model, by the joint that they drive."""

    def __init__(self, mujoco: Any, model: Any) -> None:
        self.mujoco = mujoco
        self.model = model
        self.by_joint: dict[int, list[_Actuator]] = {}
        self.elsewhere: list[str] = []
        """Names of the actuators that drive no single joint."""
        kinds = mujoco.mjtTrn
        on_joint = (int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT))  # the same for hinges and slides
        for a in range(len(model.actuator_trntype)):
            actuator = self._actuator(a)
            if int(model.actuator_trntype[a]) in on_joint:
                self.by_joint.setdefault(int(model.actuator_trnid[a][0]), []).append(actuator)
            else:
                self.elsewhere.append(actuator.name)

    def _actuator(self, a: int) -> _Actuator:
        m, enum = self.model, self.mujoco
        gain, bias = float(m.actuator_gainprm[a][0]), np.array(m.actuator_biasprm[a][:3])
        affine = m.actuator_biastype[a] == enum.mjtBias.mjBIAS_AFFINE
        if not affine:
            bias = np.zeros(3)
        plain = (affine or m.actuator_biastype[a] == enum.mjtBias.mjBIAS_NONE) and gain != 0
        dynamics = (enum.mjtDyn.mjDYN_NONE, enum.mjtDyn.mjDYN_FILTER, enum.mjtDyn.mjDYN_FILTEREXACT)
        direct = any(m.actuator_dyntype[a] == kind for kind in dynamics)
        kind = "other"
        if m.actuator_gaintype[a] == enum.mjtGain.mjGAIN_FIXED and plain and bias[2] <= 0:
            if bias[1] < 0 and (direct or m.actuator_dyntype[a] == enum.mjtDyn.mjDYN_INTEGRATOR):
                kind = "position"
            elif bias[1] == 0 and direct:
                kind = (
                    "velocity" if bias[2] < 0 and math.isclose(gain, -bias[2]) else "torque" if bias[2] == 0 else kind
                )
        name = m.actuator(a).name or f"actuator{a}"
        return _Actuator(a, name, kind, float(m.actuator_gear[a][0]), gain, bias)

    def on(self, j: int, joint: Joint) -> Joint:
        """Return joint number `j` of the model with the limits, gains and rotor inertia of its actuators, and remarks on what they do besides."""
        driving = self.by_joint.get(j, [])
        if not driving:
            return joint
        remarks = dict(joint.remarks)
        joint = self._limited(driving, self._loaded(driving, joint, remarks), remarks)
        servos = [a for a in driving if a.kind == "position"]
        if len(servos) == 1:
            joint = self._controlled(servos[0], driving, joint, remarks)
        elif servos:
            remarks["several position actuators on one joint are left out"] = _names(servos)
        else:
            self._uncontrolled(driving, remarks)
        return replace(joint, remarks=remarks)

    def _loaded(self, driving: list[_Actuator], joint: Joint, remarks: dict[str, str]) -> Joint:
        """Return the joint with the rotor inertia and damping that its actuators state."""
        m = self.model
        rotor = sum(a.gear**2 * float(m.actuator_armature[a.index]) for a in driving)
        viscous = sum(a.gear**2 * float(m.actuator_damping[a.index]) for a in driving)
        if any(np.any(m.actuator_dampingpoly[a.index]) for a in driving):
            remarks["damping that is not proportional to the speed is left out"] = "of its actuator"
        if rotor:
            joint = replace(
                joint, rotor_inertia=rotor + (0.0 if math.isnan(joint.rotor_inertia) else joint.rotor_inertia)
            )
        return replace(joint, viscous=joint.viscous + viscous)

    def _limited(self, driving: list[_Actuator], joint: Joint, remarks: dict[str, str]) -> Joint:
        """Return the joint with the torque that its actuators can make together."""
        m, total, parts = self.model, 0.0, []
        for a in driving:
            ranges = []
            if m.actuator_forcelimited[a.index]:
                ranges.append(a.gear * m.actuator_forcerange[a.index])
            if a.kind == "torque" and m.actuator_ctrllimited[a.index]:
                ranges.append(a.gear * a.gain * m.actuator_ctrlrange[a.index])
            for low, high in map(np.sort, ranges):
                if not math.isclose(-low, high):
                    remarks["torque limits that differ by direction are taken as the larger"] = f"{low:g} to {high:g}"
            total += min((float(np.max(np.abs(r))) for r in ranges), default=math.inf)
            parts += ranges
        if parts and len(driving) > 1:
            remarks["torque limits of actuators on one joint are taken as their sum"] = ""
        return replace(joint, effort=min(joint.effort, total))

    def _controlled(self, servo: _Actuator, driving: list[_Actuator], joint: Joint, remarks: dict[str, str]) -> Joint:
        """Return the joint with the gains of its position actuator, to whose derivative gain velocity actuators beside it add."""
        m, enum = self.model, self.mujoco
        brakes = [a for a in driving if a.kind == "velocity"]
        kp = -float(servo.bias[1]) * servo.gear**2
        kd = sum(-float(a.bias[2]) * a.gear**2 for a in (servo, *brakes))
        if brakes:
            said = (
                "velocity actuators beside position actuators are part of kd, with a reference velocity of 0 "
                '(if they are given dq_ref, write kd_on = "error")'
            )
            remarks[said] = _names(brakes)
        if rest := [a for a in driving if a.kind not in ("position", "velocity")]:
            remarks["other actuators beside position actuators are left out"] = _names(rest)
        scale = servo.gain * servo.gear / kp
        offset = sum(a.gear * float(a.bias[0]) for a in (servo, *brakes)) / kp
        follows = m.actuator_dyntype[servo.index] != enum.mjtDyn.mjDYN_NONE
        if not math.isclose(scale, 1.0) or offset:
            command = "command" if math.isclose(scale, 1.0) else f"{scale:.6g} command"
            remarks["q_ref is not the actuators' command itself"] = f"q_ref = {command}" + (
                f" {'-' if offset < 0 else '+'} {abs(offset):.6g}" if offset else ""
            )
        if follows:
            integrates = m.actuator_dyntype[servo.index] == enum.mjtDyn.mjDYN_INTEGRATOR
            how = "integral" if integrates else f"filtered, {float(m.actuator_dynprm[servo.index][0]):g} s"
            remarks["q_ref is the actuators' activation (act), not the command (ctrl)"] = how
        if late := float(m.actuator_delay[servo.index]):
            remarks["commands are late: log q_ref as late as they act"] = f"{late:g} s"
        if m.actuator_ctrllimited[servo.index]:
            low, high = m.actuator_ctrlrange[servo.index]
            remarks["commands are limited: log q_ref within the limits"] = f"{low:g} to {high:g}"
        return replace(joint, kp=kp, kd=kd + 0.0)

    def _uncontrolled(self, driving: list[_Actuator], remarks: dict[str, str]) -> None:
        """Add remarks on the actuators of a joint without a position actuator: those that do more than make the commanded torque."""
        m, none = self.model, self.mujoco.mjtDyn.mjDYN_NONE
        for a in driving:
            if a.kind != "torque":
                what = "velocity actuators" if a.kind == "velocity" else "actuators that are no motors and no servos"
                remarks[f"{what} are left out"] = f"`{a.name}`"
                continue
            if a.bias[0]:
                remarks["constant torques of actuators are left out"] = f"{a.gear * a.bias[0]:g}"
            if m.actuator_dyntype[a.index] != none or m.actuator_delay[a.index]:
                remarks["torques are not the actuators' commands, which are filtered or late: log what acts"] = ""


def _names(actuators: list[_Actuator]) -> str:
    return ", ".join(f"`{a.name}`" for a in actuators)
