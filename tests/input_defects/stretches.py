"""Defects of single rows, of stretches, of whole files, and of the arm file's values."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from .case import Array, Inputs, Table, Truth
from .defect import ANY, TWO_LINK, Defect
from .expected import Expected

Result = tuple[Inputs, Expected]

#: Length of a stretch with zero or constant torque [s].
DEAD = 2.0
ANY_SEVERITY = ("error", "repaired", "warning")
#: Lowest exponent bits of a double, counted from bit 0 of the number: a flipped one changes a value by a factor of 2 to 2^16.
BITS = range(52, 57)
#: Verdicts that name no wrong effect.
HARMLESS = ("none", "parameters", "effect")


def stretches() -> Iterator[Defect]:
    """Yield the defects of rows, stretches, whole files and arm files."""
    for name, change, group in (("q = 25", outside, "q"), ("flipped bit", bit_flip, "q"), ("tau = 1e6", huge, "tau")):
        yield Defect(f"spike:{name}", partial(spike, change=change), ANY, (group,))
    for name in ("start", "middle", "constant"):
        yield Defect(f"dead_stretch:{name}", partial(dead, name=name), ANY, ("tau",))
    yield Defect("copied_holdout:whole", partial(copied, first=0.0, last=1.0), ANY, ("holdout",))
    yield Defect("copied_holdout:part", partial(copied, first=0.3, last=0.8), ANY, ("holdout",))
    yield Defect("arm_file:three times", partial(wrong_values, factor=3.0), ANY, ("arm",), ("torque_gain",))
    yield Defect("arm_file:inertial three times", partial(wrong_values, factor=3.0, friction=False), ANY, ("arm",))
    yield Defect("arm_file:sigma 1e12", wide_sigma, ANY, ("arm",))
    yield Defect("arm_file:theta times 1e7", partial(wrong_values, factor=1e7), ANY, ("arm",), ("torque_gain",))
    yield Defect("other_arm:reversed torque", backwards, TWO_LINK, ("tau",))
    yield Defect("other_arm:two of six joints", two_of_six, TWO_LINK, ("q", "tau"))


def spike(
    inputs: Inputs,
    truth: Truth,
    rng: np.random.Generator,
    *,
    change: Callable[[Table, int, np.random.Generator], Table],
) -> Result:
    """Change one row of one log, in the middle of a motion, to a value that no motion explains."""
    name = str(rng.choice(list(inputs.logs)))
    table = inputs.logs[name]
    q = np.abs(table.q[:, 0])
    middle = np.arange(len(q) // 10, 9 * len(q) // 10)
    row = int(rng.choice(middle[q[middle] > 0.5 * np.max(q[middle])]))
    changed = inputs.one(name, lambda x: change(x, row, rng))
    return changed, Expected(("spike",), ANY_SEVERITY, rows=((name, row, row),))


def outside(x: Table, row: int, _: np.random.Generator) -> Table:
    """Set the position of joint 1 in one row to 25 rad (or 25 m)."""
    return x.with_column("q1", _put(x.column("q1"), row, 25.0))


def huge(x: Table, row: int, _: np.random.Generator) -> Table:
    """Set the torque of joint 1 in one row to 1e6 N m (or N)."""
    return x.with_column("tau1", _put(x.column("tau1"), row, 1e6))


def bit_flip(x: Table, row: int, rng: np.random.Generator) -> Table:
    """Flip one exponent bit of joint 1's position in one row."""
    bits = x.column("q1")[row : row + 1].copy().view(np.uint64) ^ np.uint64(1 << int(rng.choice(BITS)))
    return x.with_column("q1", _put(x.column("q1"), row, float(bits.view(np.float64)[0])))


def _put(column: Array, row: int, value: float) -> Array:
    column = column.copy()
    column[row] = value
    return column


def dead(inputs: Inputs, truth: Truth, rng: np.random.Generator, *, name: str) -> Result:
    """Set all torques of one log to zero, or to a constant, for :data:`DEAD` seconds, at the start or where they are largest."""
    log = str(rng.choice(list(inputs.logs)))
    tau, rows = inputs.logs[log].tau, round(DEAD / truth.period)
    power = np.concatenate([[0.0], np.cumsum(np.mean((tau / np.std(tau, axis=0)) ** 2, axis=1))])
    first = 0 if name == "start" else int(np.argmax(power[rows:] - power[:-rows]))

    def change(x: Table) -> Table:
        tau = x.tau.copy()
        tau[first : first + rows] = x.tau[first] if name == "constant" else 0.0
        return x.changed(tau=tau)

    return inputs.one(log, change), Expected(("dead_stretch",), ANY_SEVERITY, rows=((log, first, first + rows - 1),))


def copied(inputs: Inputs, truth: Truth, _: np.random.Generator, *, first: float, last: float) -> Result:
    """Replace the holdout by the training log, or a part of it, under another name and with times from zero."""
    table = next(iter(inputs.training.values()))
    n = len(table.t)
    part = table.rows(slice(round(first * n), round(last * n)))
    holdout = {"run-b": part.changed(t=part.t - part.t[0])}
    return replace(inputs, holdout=holdout), Expected(("copied_holdout",), ("warning", "error"))


def wrong_values(
    inputs: Inputs, truth: Truth, _: np.random.Generator, *, factor: float, friction: bool = True
) -> Result:
    """Multiply values and standard deviations of the arm file by `factor`: the inertial ones, or all, which equals a factor on all torques."""
    changed = inputs.with_arm("inertial", **_times(inputs, "inertial", ("theta", "sigma"), factor))
    if not friction:
        return changed, Expected((), (), verdicts=("parameters", "effect"))
    names = ("viscous", "coulomb", "sigma_viscous", "sigma_coulomb")
    changed = changed.with_arm("friction", **_times(inputs, "friction", names, factor))
    remedy = "--factor " + ",".join(f"tau{j + 1}={factor:g}" for j in range(truth.n_joints))
    verdicts = ("parameters", "effect") if factor < 1e6 else ("parameters", "unexplained")
    return changed, Expected(("torque_unit",), ANY_SEVERITY, (remedy,), verdicts=verdicts)


def _times(inputs: Inputs, table: str, names: tuple[str, ...], factor: float) -> dict[str, list[float]]:
    return {name: [factor * x for x in inputs.arm[table][name]] for name in names}


def wide_sigma(inputs: Inputs, truth: Truth, _: np.random.Generator) -> Result:
    """Set all standard deviations of the arm file to 1e12, with correct values."""
    n = len(truth.inertial)
    changed = inputs.with_arm("inertial", sigma=[1e12] * n)
    wide = [1e12] * truth.n_joints
    changed = changed.with_arm("friction", sigma_viscous=wide, sigma_coulomb=wide)
    return changed, Expected((), (), verdicts=HARMLESS)


def backwards(inputs: Inputs, truth: Truth, _: np.random.Generator) -> Result:
    """Reverse the torques in time, so that they belong to another motion than the positions."""
    return inputs.each(lambda x: x.changed(tau=x.tau[::-1].copy())), Expected(("*",), ("error",))


def two_of_six(inputs: Inputs, truth: Truth, rng: np.random.Generator) -> Result:
    """Replace positions and torques by joints 2 and 5 of a six-joint arm, whose other joints move and load these two."""
    weights = rng.uniform(0.3, 1.5, (6, 6)) * rng.choice([-1.0, 1.0], (6, 6))
    weights[np.diag_indices(6)] = rng.uniform(1.0, 2.0, 6)
    load, friction = rng.uniform(5.0, 40.0, 2), rng.uniform(0.5, 4.0, 2)

    def change(x: Table) -> Table:
        omega, phase = rng.uniform(1.0, 9.0, (6, 4)), rng.uniform(0, 2 * np.pi, (6, 4))
        angle = x.t[:, None, None] * omega + phase
        size = rng.uniform(0.1, 0.5, (6, 4))
        q, dq = np.sum(size * np.sin(angle), axis=2), np.sum(size * omega * np.cos(angle), axis=2)
        ddq = -np.sum(size * omega**2 * np.sin(angle), axis=2)
        joints = [1, 4]
        weight = np.column_stack([np.cos(q[:, 1] + q[:, 2]), np.sin(q[:, 1] + q[:, 2] + q[:, 3]) * np.cos(q[:, 4])])
        tau = ddq @ weights[:, joints] + load * weight + friction * np.sign(dq[:, joints])
        return x.changed(q=np.round(q[:, joints] / truth.step) * truth.step, tau=tau)

    return inputs.each(change), Expected(("*",), ("error",))
