"""Writing of a corrected position controller into the actuators of an MJCF model."""

from __future__ import annotations

from typing import Any

from armgap.export.chain.controller import OF_CONTROLLER, reference_delays
from armgap.export.chain.serial import CorrectedSerial

__all__ = ["driving", "write_servo"]


def driving(mujoco: Any, spec: Any, name: str) -> list[Any]:
    """Return the actuators of a model that drive the joint `name`."""
    kinds = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    return [a for a in spec.actuators if a.target == name and any(a.trntype == kind for kind in kinds)]


def write_servo(mujoco: Any, spec: Any, model: CorrectedSerial, name: str, j: int) -> tuple[str, ...]:
    """Write the controller's gains and the delay of its reference into the actuators of a joint, if causes change them; return remarks.

    A position actuator takes `kp`. The derivative gain is that of the position actuator and of the velocity actuators beside it, whose
    shares stay in proportion.
    """
    found = {cause.effect for cause in model.causes if cause.effect in OF_CONTROLLER and cause.joint == j + 1}
    if not found or model.controller is None:
        return ()
    # The second and third number of `biasprm` are the gains kp and kd of position and velocity, less than zero.
    affine = [
        a
        for a in driving(mujoco, spec, name)
        if a.gaintype == mujoco.mjtGain.mjGAIN_FIXED and a.biastype == mujoco.mjtBias.mjBIAS_AFFINE
    ]
    servos = [a for a in affine if a.biasprm[1] < 0]
    if len(servos) != 1:
        many = "no position actuator" if not servos else "several position actuators"
        kp, kd = float(model.controller.kp[j]), float(model.controller.kd[j])
        return (f"{many} of joint `{name}`: {', '.join(sorted(found))} is not in the file (kp {kp:.6g}, kd {kd:.6g})",)
    servo = servos[0]
    square = float(servo.gear[0]) ** 2
    if "controller_gain" in found:
        ratio = float(model.controller.kp[j]) / (-float(servo.biasprm[1]) * square)
        servo.gainprm[0] *= ratio
        servo.biasprm[:2] *= ratio
    if "controller_damping" in found:
        brakes = [servo, *(a for a in affine if a.biasprm[1] == 0 and a.biasprm[2] < 0)]
        wanted = float(model.controller.kd[j])
        total = sum(-float(a.biasprm[2]) * float(a.gear[0]) ** 2 for a in brakes)
        if total > 0.0:
            for a in brakes:
                a.biasprm[2] *= wanted / total
                if a is not servo:
                    a.gainprm[0] *= wanted / total
        else:
            servo.biasprm[2] = -wanted / square
    late = reference_delays(model.causes, len(model.joints))[j]
    if not late:
        return ()
    step = float(spec.option.timestep)
    steps = round((float(servo.delay) + late) / step)
    if steps == 0:
        return (f"the reference of joint `{name}` is late by less than half a time step: that is not in the file",)
    servo.delay, servo.nsample = steps * step, max(int(servo.nsample), steps + 1)
    return (f"the reference of joint `{name}` is late by {steps * step:g} s, in whole time steps",)
