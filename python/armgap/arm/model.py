"""Reading of a serial arm from a robot's description, URDF or MJCF."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.arm.arm_file import LONGEST_PERIOD_S, SHORTEST_PERIOD_S, STRONGEST_GRAVITY
from armgap.arm.serial.trust import TRUSTS
from armgap.errors import OptionError
from armgap.literals import SERIAL
from armgap.options import positive

__all__ = ["read_model"]

#: Sample period of an arm file made from a description that states none, s.
_PERIOD_S = 0.002


def read_model(
    path: str | os.PathLike[str],
    *,
    base: str | None = None,
    tip: str | None = None,
    frozen: Mapping[str, float] | None = None,
    gravity: float | Sequence[float] | None = None,
    trust: str = "cad",
    name: str | None = None,
    sample_period: float = _PERIOD_S,
) -> Arm:
    """Read a URDF or MJCF file and resolve it to a serial arm.

    Parameters
    ----------
    path : path-like
        URDF file, or MJCF file, which needs MuJoCo (extra ``trial``).
    base, tip : str, optional
        First and last link; by default the root link, and the end of the only branch with moving joints.
    frozen : mapping of str to float, optional
        Positions of joints that stand still [rad or m]. Joints off the chain stand at 0 by default; `Arm.notes` lists them.
    gravity : float or sequence of 3 floats, optional
        Acceleration of gravity in the frame of the base [m/s^2]; a number g stands for ``[0, 0, -g]``. By default the description's
        gravity: 9.81 against the z axis of a URDF's root link.
    trust : {"published", "cad", "guess", "none"}
        Level of trust in the description's masses and inertias, see `armgap.arm.serial.trust`.
    name : str, optional
        Name of the arm; by default the name of the robot in the description.
    sample_period : float, default 0.002
        Nominal sample period of the logs [s], 1e-5 to 0.5.

    Returns
    -------
    Arm
        Arm of the kind ``"serial"``, with the chain in `Arm.chain` and remarks in `Arm.notes`.

    Raises
    ------
    ModelFileError
        If the file cannot be read or has no chain from `base` to `tip`; the message names the element and the remedy.
    OptionError
        If an option has an impossible value.

    Examples
    --------
    >>> arm = read_model("ur10.urdf", tip="tool0")  # doctest: +SKIP
    >>> arm.chain.joint_names[0]  # doctest: +SKIP
    'shoulder_pan_joint'
    """
    from armgap.arm.description.read import read_description
    from armgap.arm.serial.arm_file import SerialArmFile

    if trust not in TRUSTS:
        raise OptionError(f"the trust is {trust!r}", remedy=f"write one of {', '.join(TRUSTS)}")
    if positive(sample_period, "sample period") > LONGEST_PERIOD_S or sample_period < SHORTEST_PERIOD_S:
        bounds = f"{SHORTEST_PERIOD_S:g} to {LONGEST_PERIOD_S:g}"
        raise OptionError(f"the sample period is {sample_period:g} s", remedy=f"give {bounds} s")
    still = {joint: _finite(value, f"position of `{joint}`") for joint, value in (frozen or {}).items()}
    file = Path(path)
    with np.errstate(over="ignore", invalid="ignore"):  # `SerialArmFile` checks that all values are finite
        model = read_description(file, base=base, tip=tip, frozen=still)
    if gravity is not None:
        model = replace(model, chain=replace(model.chain, gravity=_vector(gravity)))
    given = {"kind": SERIAL, "trust": trust, "sample_period": sample_period, **({"name": name} if name else {})}
    return Arm(**SerialArmFile(file, given, model).fields())


def _finite(value: Any, what: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise OptionError(f"the {what} is {value!r}", remedy="give a finite number")
    return number


def _vector(gravity: float | Sequence[float]) -> NDArray[np.float64]:
    """Return gravity as a vector [m/s^2], shape (3,); a single number g stands for ``[0, 0, -g]``."""
    given = (0.0, 0.0, -_finite(gravity, "gravity")) if isinstance(gravity, int | float) else gravity
    vector = np.array([_finite(value, "gravity") for value in given])
    if vector.shape != (3,) or float(np.linalg.norm(vector)) > STRONGEST_GRAVITY:
        remedy = f"give a number or three, at most {STRONGEST_GRAVITY:g} m/s^2"
        raise OptionError(f"gravity is {gravity!r}", remedy=remedy)
    return vector
