"""`logs_differ`: one arm does not explain all logs of a serial arm, though one of its own explains each.

A load that is carried in one log, friction that is warm in another, or a changed setting: parameters estimated from all logs together are then
wrong for each of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.check.check import Check
from armgap.check.serial.weak_form import LogRows, Rows, rows_of
from armgap.log.log import Log
from armgap.log.stretches import thinned

__all__ = ["logs_differ"]

Array = NDArray[np.float64]

# Unexplained part of a joint's mean square torque in a log by the parameters of all logs: at least this, and so many times that by the log's own
# parameters. These take up to a fifth of it by chance.
_UNEXPLAINED, _OF_ITS_OWN = 4e-4, 4.0

# Largest number of sample intervals of each log, and the shortest interval [s] in it; denser logs are thinned. Parameters of a log's own that have
# seen little of its motion explain that little too well: with 1.3 s of each log 12 of 70 sets of simulated logs, none of which differ, were said to.
_MOST_INTERVALS, _THINNED_TO_S = 5000, 0.004


def logs_differ(logs: Sequence[Log], arm: Arm) -> list[Check]:
    """Return a warning where the parameters of all logs explain some logs much worse than parameters of their own.

    It names the log without which the others agree, where there is one.

    Parameters
    ----------
    logs : sequence of Log
        Logs of the arm.
    arm : Arm
        Nominal model, of kind ``"serial"``.
    """
    with_torques = [thinned(log, math.floor(_THINNED_TO_S / log.sample_period)) for log in logs if log.has_torques]
    found = rows_of(with_torques, arm, _MOST_INTERVALS)
    alone = [_unexplained(rows, _fitted([rows], arm)) for _, rows in found]
    worst = _worst(found, alone, arm)
    if worst is None:
        return []
    name, joint, by_all, by_its_parameters = worst

    def agree(left_out: int) -> bool:
        others = [i for i in range(len(found)) if i != left_out]
        return _worst([found[i] for i in others], [alone[i] for i in others], arm) is None

    odd = [log.name for i, (log, _) in enumerate(found) if len(found) > 2 and agree(i)]
    what = f"{odd[0]} differs from the other logs, which agree" if len(odd) == 1 else "logs differ from each other"
    message = (
        f"{what}: in {name} {100 * np.sqrt(by_all):.2g} % of joint {joint}'s torque stays unexplained by parameters of all logs (RMS), "
        f"{100 * np.sqrt(by_its_parameters):.2g} % by parameters of its own; a load, friction that is warmer or a setting may have changed"
    )
    remedy = "diagnose logs of one state together"
    return [Check("logs_differ", "warning", message, (remedy,), log=odd[0] if len(odd) == 1 else None)]


def _worst(
    found: Sequence[tuple[Log, LogRows]], alone: Sequence[Array], arm: Arm
) -> tuple[str, int, float, float] | None:
    """Return the log and joint (from 1) that parameters of all logs explain worst, with the unexplained parts by these and by the log's own.

    None where the logs agree.
    """
    together = _fitted([rows for _, rows in found], arm)
    worst: tuple[str, int, float, float] | None = None
    for (log, rows), by_its_parameters in zip(found, alone, strict=True):
        by_all = _unexplained(rows, together)
        counts = (by_all > _UNEXPLAINED) & (by_all > _OF_ITS_OWN * by_its_parameters)
        j = int(np.argmax(np.where(counts, by_all, 0.0)))
        if counts[j] and (worst is None or by_all[j] > worst[2]):
            worst = log.name, j + 1, float(by_all[j]), float(by_its_parameters[j])
    return worst


def _fitted(rows: list[LogRows], arm: Arm) -> Array:
    """Return the arm's parameters by the rows of joints that move; those of the arm file where no joint has a torque."""
    made = Rows.of_rows(rows, [part.moves for part in rows])
    return arm.theta if made is None else made.fit(arm, np.ones(arm.n_joints)).theta


def _unexplained(rows: LogRows, theta: Array) -> Array:
    """Return the part of each joint's mean square torque in motion that parameters leave unexplained; 0 for a joint without torque."""
    square = (rows.moves * rows.y**2).sum(axis=0)
    left = (rows.moves * (rows.y - rows.psi @ theta) ** 2).sum(axis=0)
    return np.asarray(np.divide(left, square, out=np.zeros_like(left), where=square > 0.0))
