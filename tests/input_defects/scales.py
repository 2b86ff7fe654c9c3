"""Defects of unit and meaning: torques as currents or shares, positions in degrees or turns, a position in a torque's place."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from .case import Array, Inputs, NotApplicableError, Table, Truth
from .defect import ANY, AXIS, ROTARY, TWO_LINK, Defect
from .expected import Expected

Result = tuple[Inputs, Expected]

#: Torque constant of a small motor [N m/A], and gear ratio of a harmonic drive.
CURRENT, GEAR = 0.08, 50.0
#: Range of factors on one torque that may be a gain of the drive instead of another unit, with a margin on both sides.
GAINS = (0.4, 2.5)
#: Range of one factor on all torques that may as well be an error of the whole arm file, which no log can distinguish.
SCALED = (0.2, 5.0)
#: Smallest and largest time constant with which a servo's joint follows its commanded position [s].
FOLLOWS = (0.02, 0.08)


def scales() -> Iterator[Defect]:
    """Yield the defects of unit and meaning."""
    gain, tau = ("torque_gain",), ("tau",)
    for name, factor in (("current", CURRENT), ("gear 50", GEAR)):
        yield Defect(f"torque_unit:{name}", partial(scaled, factor=factor), ANY, tau, gain)
        yield Defect(f"torque_unit:{name}, tau2 only", partial(scaled, factor=factor, only=2), TWO_LINK, tau, gain)
    yield Defect("torque_unit:current, tau1 only", partial(scaled, factor=CURRENT, only=1), TWO_LINK, tau, gain)
    yield Defect("torque_unit:percentage", percentage, ANY, tau, gain)
    yield Defect("torque_is_position:all", commanded, ANY, tau)
    yield Defect("torque_is_position:tau1", partial(commanded, only=1), TWO_LINK, tau)
    yield Defect("torque_is_position:degrees", partial(commanded, unit=180 / math.pi), ROTARY, tau)
    for unit, per_si, kinds in (("deg", 180 / math.pi, ROTARY), ("turns", 0.5 / math.pi, ROTARY), ("mm", 1e3, AXIS)):
        yield Defect(f"position_unit:{unit}", partial(counted_in, unit=unit, per_si=per_si), kinds, ("q",))


def scaled(inputs: Inputs, truth: Truth, _: np.random.Generator, *, factor: float, only: int = 0) -> Result:
    """Divide torques by `factor`, in every column or in that of joint `only`, so that a multiplication restores them."""
    factors = np.array([factor if only in (0, j + 1) else 1.0 for j in range(truth.n_joints)])
    return _divided(inputs, factors)


def percentage(inputs: Inputs, truth: Truth, _: np.random.Generator) -> Result:
    """Log torques in percent of the torque limit."""
    factors = truth.limit / 100
    if np.any((factors > GAINS[0]) & (factors < GAINS[1])):
        raise NotApplicableError("a percentage of this limit is about a newton metre")
    spoilt, expected = _divided(inputs, factors)
    if truth.n_joints == 1 and SCALED[0] < factors[0] < SCALED[1]:
        expected = replace(expected, severities=("repaired", "warning"))
    return spoilt, expected


def _divided(inputs: Inputs, factors: Array) -> Result:
    entries = [f"tau{j + 1}={x:.6g}" for j, x in enumerate(factors) if x != 1.0]
    expected = Expected(("torque_unit",), ("repaired",), ("--factor " + ",".join(entries),))
    return inputs.each(lambda x: x.changed(tau=x.tau / factors)), expected


def commanded(inputs: Inputs, truth: Truth, rng: np.random.Generator, *, only: int = 0, unit: float = 1.0) -> Result:
    """Put a servo's commanded position, which the joint follows as a first-order lag, into the torque's column."""
    lag = rng.uniform(*FOLLOWS)
    joints = [j for j in range(truth.n_joints) if only in (0, j + 1)]

    def change(x: Table) -> Table:
        tau = x.tau.copy()
        tau[:, joints] = unit * (x.q_true + lag * x.dq_true)[:, joints]
        return x.changed(tau=tau)

    remedy = "--map " + ",".join(f"tau{j + 1}" for j in joints)
    return inputs.each(change), Expected(("torque_is_position",), ("error",), (remedy,))


def counted_in(inputs: Inputs, truth: Truth, _: np.random.Generator, *, unit: str, per_si: float) -> Result:
    """Log positions in another unit; degrees and millimetres may be refused or converted when the log is read."""
    severities = ("error",) if unit == "turns" else ("error", "repaired")
    expected = Expected(("position_unit",), severities, (f"--units q={unit}",))
    return inputs.each(lambda x: x.changed(q=x.q * per_si)), expected
