"""What the actuators of a description make of its chain: position controller, torque limits, gravity compensation, and remarks on joints."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from armgap.arm.controller import Controller
from armgap.arm.description.tree import Joint, Tree

__all__ = ["controlled", "joint_remarks"]

Array = NDArray[np.float64]


def joint_remarks(moving: Iterable[Joint]) -> list[str]:
    """Return the remarks on a chain's joints, one line for each thing said, with the joints' names."""
    said: dict[str, list[str]] = {}
    for joint in moving:
        for what, detail in joint.remarks.items():
            said.setdefault(what, []).append(f"`{joint.name}`" + (f" ({detail})" if detail else ""))
    return [f"{what}: {', '.join(names)}" for what, names in said.items()]


def controlled(
    tree: Tree, moving: Sequence[Joint], carried: Iterable[str], gravity: Array, notes: list[str]
) -> tuple[Controller | None, Array | None, Array]:
    """Return what a description's actuators do, and add remarks on it.

    Parameters
    ----------
    tree : Tree
        Links and joints.
    moving : sequence of Joint
        The chain's joints.
    carried : iterable of str
        Links that the chain's joints move.
    gravity : ndarray, shape (3,)
        Acceleration of gravity in the frame of the base [m/s^2].
    notes : list of str
        Remarks, to which more are added.

    Returns
    -------
    controller : Controller, optional
        Position controller with the gains of the joints' actuators; None unless all joints have a position actuator.
    torque_limit : ndarray, shape (n_joints,), optional
        Largest torques of the controller [N m or N]; None unless all joints have one.
    gravity : ndarray, shape (3,)
        Acceleration of gravity that the controller has to carry [m/s^2]: zero if all links are compensated.
    """
    kp, kd, effort = (np.array([getattr(joint, name) for joint in moving]) for name in ("kp", "kd", "effort"))
    shares = {link: tree.compensated.get(link, 0.0) for link in carried if tree.links[link][0] > 0}
    if not gravity.any():
        shares = {}
    compensated = [f"`{link}`" for link, share in shares.items() if share]
    missing = [f"`{joint.name}`" for joint, gain in zip(moving, kp, strict=True) if not np.isfinite(gain)]
    if missing:
        if len(missing) < len(moving):
            notes.append(f"position actuators are left out: there is none for {', '.join(missing)}")
        if compensated:
            notes.append(
                f"gravity compensation (gravcomp) is left out: {_few(compensated)}; torques are taken to carry all weight"
            )
        return None, None, gravity
    if compensated and any(share != 1.0 for share in shares.values()):
        notes.append(
            f"position actuators are left out: gravity compensation (gravcomp) beside them, of a part of the weight, "
            f"has no place in an arm file: {_few(compensated)}"
        )
        return None, None, gravity
    if compensated:
        notes.append("gravity is 0: gravity compensation (gravcomp) carries all links beside the position actuators")
        gravity = np.zeros(3)
    notes.append("position actuators are taken as a PD controller")
    limited = np.isfinite(effort)
    if limited.any() and not limited.all():
        names = [f"`{joint.name}`" for joint, one in zip(moving, limited, strict=True) if one]
        notes.append(
            f"torque limits are no part of the controller, as not all joints have one (write torque_limit): {_few(names)}"
        )
    return Controller(kp=kp, kd=kd), effort if limited.all() else None, gravity


def _few(names: Sequence[str], most: int = 12) -> str:
    return ", ".join([*names[:most], *([f"and {len(names) - most} more"] if len(names) > most else [])])
