"""Writing of a serial arm as a self-contained arm file, which reads back as the same arm."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import listed, quoted
from armgap.arm.rigid_body import INERTIAL_NAMES, about_com, about_origin
from armgap.arm.serial.links import INERTIA_KEYS

if TYPE_CHECKING:
    from armgap.arm.arm import Arm

__all__ = ["serial_toml"]

Array = NDArray[np.float64]

# Largest rounding error of a link's ten inertial parameters, relative to the largest of them, at which mass, centre of mass and inertia about
# the centre of mass are written in their place.
_INERTIAL_ROUNDING = 1e-15
_PER_JOINT = (
    ("position_min", "lower"),
    ("position_max", "upper"),
    *((key, key) for key in ("speed", "acceleration", "effort")),
)
# Rows and columns of the six independent entries of a symmetric 3 x 3 matrix, in the order of arm files.
_ROWS, _COLUMNS = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)


def serial_toml(arm: Arm) -> str:
    """Return the text of a serial arm's arm file.

    Placements, axes, joints' values and standard deviations are written to the last bit; mass, centre of mass and central
    inertia give the link's ten inertial parameters back to 1e-15 of the largest.
    """
    chain = arm.chain
    assert chain is not None
    n = chain.n_joints
    lines = [*(f"# {_one_line(note)}" for note in arm.notes)]
    lines += [
        f"name = {quoted(arm.name)}",
        f"kind = {quoted(arm.kind)}",
        f"gravity = {listed(chain.gravity)}",
        f"sample_period = {arm.sample_period!r}",
    ]
    inertial, sigma = (x[: 10 * n].reshape(n, 10) for x in (arm.theta, arm.sigma))
    joints = {
        name: slice(10 * n + i * n, 10 * n + (i + 1) * n)
        for i, name in enumerate(("rotor_inertia", "viscous", "coulomb"))
    }
    for j in range(n):
        lines += [
            "",
            "[[link]]",
            f"joint = {quoted(chain.joint_names[j])}",
            f"link = {quoted(chain.link_names[j])}",
            f"kind = {quoted(chain.kinds[j])}",
            f"axis = {listed(chain.axis[j])}",
            f"placement = {{xyz = {listed(chain.translation[j])}, rotation = [{', '.join(map(listed, chain.rotation[j]))}]}}",
            *_inertial_lines(inertial[j]),
            f"sigma = {listed(sigma[j])}",
        ]
        limits = ((key, float(getattr(chain, name)[j])) for key, name in _PER_JOINT)
        lines += [f"{key} = {value!r}" for key, value in limits if np.isfinite(value)]
    rotor = joints.pop("rotor_inertia")
    lines += ["", "[friction]", *(f"{name} = {listed(arm.theta[rows])}" for name, rows in joints.items())]
    lines += [f"sigma_{name} = {listed(arm.sigma[rows])}" for name, rows in joints.items()]
    lines += [
        "",
        "[drive]",
        f"rotor_inertia = {listed(arm.theta[rotor])}",
        f"sigma_rotor_inertia = {listed(arm.sigma[rotor])}",
    ]
    return "\n".join([*lines, *arm.table_lines()]) + "\n"


def _inertial_lines(ten: Array) -> list[str]:
    """Return TOML lines with a link's mass, centre and central inertia; empty if all are zero.

    Where the ten inertial parameters do not follow from these to within rounding, they are written themselves.
    """
    if not ten.any():
        return []
    if ten[0] > 0:
        mass, com, inertia = about_com(ten)
        for given, same in (
            ((_neat(mass), _neat(com), _neat(inertia)), 0.0),
            ((mass, com, inertia), _INERTIAL_ROUNDING),
        ):
            mass, com, inertia = float(given[0]), given[1], given[2]
            if np.max(np.abs(about_origin(mass, com, inertia) - ten)) <= same * np.max(np.abs(ten)):
                six = inertia[_ROWS, _COLUMNS]
                named = ", ".join(f"{key} = {float(value)!r}" for key, value in zip(INERTIA_KEYS, six, strict=True))
                return [f"mass = {mass!r}", f"com = {listed(com)}", f"inertia = {{{named}}}"]
    return [f"theta = {listed(ten)}  # {', '.join(INERTIAL_NAMES)}"]


def _neat(values: float | Array) -> Array:
    """Return values rounded to 15 significant digits of the largest of them."""
    largest = float(np.max(np.abs(values)))
    digits = 15 - (math.ceil(math.log10(largest)) if largest > 0 else 0)
    return np.asarray(np.round(values, digits)) + 0.0


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)
