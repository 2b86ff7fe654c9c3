"""Defects of convention: signs, order of joints, relative angles, zeros, gravity.

Which remedies no log can distinguish follows from the equation of motion ``M ddq + C dq + g + f = tau``:

* ``(q, tau) -> (-q, -tau)`` leaves the equation unchanged where gravity is odd in q: all torques flipped equal all positions flipped.
  On an inclined axis gravity is a constant, and only the remedy that flips the changed columns is asked for.
* ``q1 -> q1 + pi`` turns the sign of every gravity term and nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from .case import GRAVITY_TERMS, Inputs, NotApplicableError, Table, Truth
from .defect import ANY, ROTARY, TWO_LINK, Defect
from .expected import Expected

Result = tuple[Inputs, Expected]


def conventions() -> Iterator[Defect]:
    """Yield the defects of convention."""
    for group, check in (("tau", "torque_sign"), ("q", "position_sign")):
        yield Defect(f"{check}:{group}1", partial(flipped, columns=(f"{group}1",)), changes=(group,))
        yield Defect(f"{check}:{group}2", partial(flipped, columns=(f"{group}2",)), TWO_LINK, (group,))
        yield Defect(f"{check}:all", partial(flipped, columns=(f"{group}1", f"{group}2")), TWO_LINK, (group,))
    for name, groups in (("positions", ("q",)), ("torques", ("tau",)), ("both", ("q", "tau"))):
        yield Defect(f"joint_order:{name}", partial(exchanged, groups=groups), TWO_LINK, groups)
    yield Defect("relative_angle:absolute", partial(counted, sign=1.0, option="absolute"), TWO_LINK, ("q",))
    yield Defect("relative_angle:relative", partial(counted, sign=-1.0, option="relative"), TWO_LINK, ("q",))
    for angle in (90, -90, 180):
        yield Defect(f"position_zero:q1 {angle}", partial(displaced, joint=1, angle=angle), ROTARY, ("q",))
        yield Defect(f"position_zero:q2 {angle}", partial(displaced, joint=2, angle=angle), TWO_LINK, ("q",))
    yield Defect("gravity_sign:arm file", turned_gravity, ANY, ("arm",))
    yield Defect("gravity_missing:compensated", compensated, ANY, ("tau",))


def flipped(inputs: Inputs, truth: Truth, _: np.random.Generator, *, columns: tuple[str, ...]) -> Result:
    """Turn the sign of the given columns over."""

    def change(x: Table) -> Table:
        for name in columns:
            x = x.with_column(name, -x.column(name))
        return x

    right = "--flip " + ",".join(columns)
    check = "torque_sign" if columns[0].startswith("tau") else "position_sign"
    if len(columns) < truth.n_joints:
        rest = [f"{group}{j + 1}" for group in ("q", "tau") for j in range(truth.n_joints)]
        also = "--flip " + ",".join(name for name in rest if name not in columns)
        return inputs.each(change), Expected((check,), ("error",), (right,), (also,))
    other = "--flip " + ",".join(("q" if name.startswith("tau") else "tau") + name[-1] for name in columns)
    checks = ("torque_sign", "position_sign")
    if truth.kind == "axis" and truth.weighs:
        return inputs.each(change), Expected(checks, ("error",), (right,), (other, f"{other} --gravity reversed"))
    return inputs.each(change), Expected(checks, ("error",), (right, other))


def exchanged(inputs: Inputs, truth: Truth, _: np.random.Generator, *, groups: tuple[str, ...]) -> Result:
    """Exchange the columns of the two joints."""
    swapped = inputs.each(lambda x: x.changed(**{group: getattr(x, group)[:, ::-1].copy() for group in groups}))
    return swapped, Expected(("joint_order",), ("error",), (" ".join(f"--swap {g}1,{g}2" for g in groups),))


def counted(inputs: Inputs, truth: Truth, _: np.random.Generator, *, sign: float, option: str) -> Result:
    """Log joint 2's angle against the world (``q1 + q2``), or with joint 1's angle subtracted once too often (``q2 - q1``)."""
    changed = inputs.each(lambda x: x.with_column("q2", x.column("q2") + sign * x.column("q1")))
    return changed, Expected(("relative_angle",), ("error",), (f"--{option} q2",))


def displaced(inputs: Inputs, truth: Truth, _: np.random.Generator, *, joint: int, angle: int) -> Result:
    """Move the zero of a joint's column to `angle` [deg] of the model's angle: 90 or -90 for horizontal, 180 for upright."""
    name = f"q{joint}"
    changed = inputs.each(lambda x: x.with_column(name, x.column(name) - math.radians(angle)))
    right = f"--zero {name}={angle}deg"
    if joint == 1 and angle == 180:
        checks = ("position_zero", "gravity_sign")
        return changed, Expected(checks, ("error",), (right, "--gravity reversed"))
    return changed, Expected(("position_zero",), ("error",), (right,))


def turned_gravity(inputs: Inputs, truth: Truth, _: np.random.Generator) -> Result:
    """Turn the sign of the gravity terms in the arm file over."""
    if not truth.weighs:
        raise NotApplicableError("no gravity along the joint")
    theta = np.array(inputs.arm["inertial"]["theta"], dtype=float)
    theta[list(GRAVITY_TERMS[truth.kind])] *= -1
    changed = inputs.with_arm("inertial", theta=theta)
    if truth.kind == "axis":
        return changed, Expected(("gravity_sign",), ("error",), ("--gravity reversed",), ("--flip q1,tau1",))
    checks = ("gravity_sign", "position_zero")
    return changed, Expected(checks, ("error",), ("--gravity reversed", "--zero q1=180deg"))


def compensated(inputs: Inputs, truth: Truth, _: np.random.Generator) -> Result:
    """Subtract a controller's gravity compensation, computed at the measured positions, from the logged torques."""
    if not truth.weighs:
        raise NotApplicableError("no gravity along the joint")
    changed = inputs.each(lambda x: x.changed(tau=x.tau - truth.gravity(x.q)))
    return changed, Expected(("gravity_missing",), ("error",), ("--gravity compensated",))
