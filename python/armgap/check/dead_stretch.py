"""`dead_stretch`: torques that are zero or constant over a stretch in which the arm moves as if it were driven."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from armgap.arm.arm import Arm
from armgap.check.check import Check
from armgap.check.drive_limit import deliver, delivered
from armgap.check.equation_error import Array, EquationError, Mask, Rows, bounds
from armgap.log.log import SIGNALS, Log

__all__ = [
    "DEAD_SHARE",
    "MISFIT_RATIO",
    "Run",
    "beyond_friction",
    "constant_torques",
    "dead_check",
    "find",
    "merged",
    "without_constant",
]

Run = tuple[int, int, int]
"""Joint (from 0), and the first and last sample of a stretch in which the joint's torque does not change."""
# Shortest time over which a joint's torque has to stay constant to count as a dead stretch [s].
_SHORTEST_S = 0.4
# Time after which the filters' transient has faded [s], six of their time constants.
_FORGOTTEN_S = 0.2
# Ratio of the mean square residual of the equation of motion in a dead stretch to that elsewhere, and residual as a share of the joint's torque.
MISFIT_RATIO = 25.0
DEAD_SHARE = 0.1
# Largest time [s] between the beginnings of stretches of constant torque that are judged together, by rows outside of all stretches.
_TOGETHER_S = 16.0
# Part of a log outside stretches of constant torque from which the limits of the drives, and shifts, are estimated without these stretches.
_LEAST_KEPT = 0.5
# Largest break-away torque of a joint at rest, in Coulomb frictions, the larger of the arm file's and the estimated one.
_BREAKAWAY = 2.0
# Smallest number of rows of the equation of motion, inside and outside of a stretch, by which the stretch is judged.
_MIN_STRETCH_ROWS = 30


def find(logs: Sequence[Log], arm: Arm) -> list[Check]:
    """Return one check per stretch of a log whose torque was not recorded."""
    runs = [constant_torques(log) for log in logs]
    if not any(runs):
        return []
    levels = delivered([without_constant(log) for log in logs], arm).levels
    checks = []
    for log, acting, of_log in zip(logs, deliver(logs, levels), runs, strict=True):
        for near in _neighbours(log, of_log):
            checks += _judged(log, Rows.of(acting, arm, around=_around(near)), arm, of_log, near)
    return checks


def without_constant(log: Log) -> Log:
    """Return a log without stretches of constant torque of any joint, which may be dead; the log itself where they are half of it or more."""
    kept = np.ones(len(log), dtype=bool)
    for _, first, last in constant_torques(log):
        kept[first : last + 1] = False
    if kept.all() or kept.mean() <= _LEAST_KEPT:
        return log
    arrays = {name: x[kept] for name in ("t", *SIGNALS) if (x := getattr(log, name)) is not None}
    return replace(log, **arrays)


def constant_torques(log: Log) -> list[Run]:
    """Return the stretches of a log in which a joint's torque does not change although it does elsewhere."""
    return [(j, first, last) for j in range(log.n_joints) for first, last in _constant(log, j)]


def _around(near: list[Run]) -> tuple[int, int]:
    """Return the first and last sample of runs that are judged together."""
    return near[0][1], max(last for _, _, last in near)


def _neighbours(log: Log, runs: list[Run]) -> Iterator[list[Run]]:
    """Yield groups of runs that are judged together because they begin within `_TOGETHER_S` of each other."""
    group: list[Run] = []
    for run in sorted(runs, key=lambda run: run[1]):
        if group and log.t[run[1]] - log.t[group[0][1]] > _TOGETHER_S:
            yield group
            group = []
        group.append(run)
    if group:
        yield group


def _constant(log: Log, j: int) -> list[tuple[int, int]]:
    """Return ranges of samples over which a joint's torque does not change although it does elsewhere.

    Stretches at the column's largest or smallest value are left out: there a command is clipped, not missing.
    """
    tau = log.tau[:, j]
    if np.all(tau == tau[0]):
        return []
    clipped = (tau != 0) & ((tau == tau.min()) | (tau == tau.max()))
    edges = np.flatnonzero(np.diff(tau) != 0) + 1
    first, last = np.concatenate([[0], edges]), np.concatenate([edges, [len(tau)]]) - 1
    long = (log.t[last] - log.t[first] >= _SHORTEST_S) & ~clipped[first]
    return list(zip(first[long].tolist(), last[long].tolist(), strict=True))


def _judged(log: Log, rows: Rows, arm: Arm, runs: list[Run], near: list[Run]) -> list[Check]:
    """Return checks of those runs in `near` whose residual of the equation of motion (`rows`) is much larger than nearby, outside of all `runs`."""
    dead = np.zeros((len(rows.y), log.n_joints), dtype=bool)
    alive = np.ones(len(rows.y), dtype=bool)
    when = log.t[rows.samples]
    for j, first, last in runs:
        # After this time the states of the filters no longer depend on the torques before or within the stretch.
        settled = log.t[first] + _FORGOTTEN_S
        dead[(when >= settled) & (when <= log.t[last]), j] = True
        alive &= (when < log.t[first]) | (when > log.t[last] + _FORGOTTEN_S)
    if alive.sum() < _MIN_STRETCH_ROWS:
        return []
    known = rows.at(alive)
    base = EquationError([known], arm)
    theta = base.fit(*bounds(arm)).theta
    coulomb = np.maximum(theta, arm.theta)[arm.n_inertial + arm.n_joints :]
    residual = beyond_friction(rows.y - rows.psi @ theta, rows.moving(log), coulomb)
    checks = []
    for j, first, last in near:
        inside = dead[:, j] & (rows.samples >= first) & (rows.samples <= last)
        if inside.sum() < _MIN_STRETCH_ROWS:
            continue
        within, outside = (float(np.mean(residual[part, j] ** 2)) for part in (inside, alive))
        if within > MISFIT_RATIO * outside and within > DEAD_SHARE * float(base.scale[j]):
            checks.append(dead_check(log, (j, first, last), within, outside))
    return merged(checks)


def beyond_friction(residual: Array, moving: Mask, coulomb: Array | float) -> Array:
    """Return the residual torque beyond the friction that may hold a joint at rest: a controller that holds a joint gives it a constant torque.

    `moving` is True where the joint moves, `coulomb` its Coulomb friction [N m or N]; shapes broadcast to that of `residual`.
    """
    holding = _BREAKAWAY * coulomb
    return np.where(moving, residual, np.sign(residual) * np.maximum(np.abs(residual) - holding, 0.0))


def dead_check(log: Log, run: Run, within: float, outside: float) -> Check:
    """Return the check of a dead stretch, from the mean squares of the missing torque `within` and `outside` the stretch [N^2 m^2 or N^2]."""
    j, first, last = run
    begins, ends = float(log.t[first]), float(log.t[last])
    message = (
        f"`tau{j + 1}` stays at {log.tau[first, j]:.4g} from {begins:.4g} to {ends:.4g} s while the joint moves as if driven: the "
        f"torque that is missing there is {np.sqrt(within):.3g} (RMS), elsewhere {np.sqrt(outside):.2g}"
    )
    remedy = f"--skip {log.recording}:{begins:.4g}-{ends:.4g}"
    return Check(
        "dead_stretch",
        "error",
        message,
        (remedy,),
        j + 1,
        log.recording,
        ((first + log.first_row, last + log.first_row),),
    )


def merged(checks: list[Check]) -> list[Check]:
    """Return one check per dead stretch: of several joints whose torques are missing over the same rows, only that of the first."""
    by_rows: dict[tuple[tuple[int, int], ...], list[Check]] = {}
    for check in checks:
        by_rows.setdefault(check.rows, []).append(check)
    return [group[0] for group in by_rows.values()]
