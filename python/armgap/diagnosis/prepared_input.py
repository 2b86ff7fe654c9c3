"""Input of a diagnosis: logs and arm are read, corrected, repaired, split, cut into stretches, and checked against each other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check import torque_unit
from armgap.check.check import Check
from armgap.check.log_checks.data import copied_holdout, data_checks
from armgap.check.serial.contradictions import contradictions
from armgap.check.serial.dead_stretch import find as dead_stretches
from armgap.check.serial.late_torques import late_torques
from armgap.check.stage import examine
from armgap.diagnosis.provenance import provenance
from armgap.errors import LogShapeError, OptionError
from armgap.files.reading import printable
from armgap.log import gather
from armgap.log.conversion.columns import no_controller
from armgap.log.log import Log
from armgap.log.stretches import BUDGET, SHORTEST_S, choose, thinned

__all__ = ["PreparedInput", "prepare", "refused", "split"]

# Share of every log that is held out where no holdout is given, from its end.
_HELD_OUT = 0.4


@dataclass(frozen=True)
class PreparedInput:
    """Prepared logs and arm of a diagnosis, with the checks to report.

    `factors` are the repaired factors by torque column, `shift` the repaired time shift of the torques [s], 0 without a repair.
    """

    training: list[Log]
    holdout: list[Log]
    arm: Arm
    notes: tuple[str, ...]
    checks: tuple[Check, ...]
    factors: Mapping[str, float] = field(default_factory=dict)
    shift: float = 0.0
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def with_factors(self, factors: Mapping[str, float]) -> PreparedInput:
        """Return the prepared input with other factors on its torque columns than those of the repair."""
        by_column = {
            f"tau{j + 1}": self.factors.get(f"tau{j + 1}", self.factors.get("tau", 1.0))
            for j in range(self.arm.n_joints)
        }
        ratio = Corrections(factor={column: c / by_column[column] for column, c in factors.items()})
        checks = [c for c in self.checks if c.check != "torque_unit"]
        return replace(
            self,
            training=[replace(ratio.on_log(log), findings=log.findings) for log in self.training],
            holdout=[replace(ratio.on_log(log), findings=log.findings) for log in self.holdout],
            checks=(*torque_unit.said(factors), *checks),
            factors=factors,
        )

    def without_shift(self) -> PreparedInput:
        """Return the prepared input with torques at their original times, without the repair of a time shift."""
        back = Corrections(shift={"tau": -self.shift})
        return replace(
            self,
            training=[replace(back.on_log(log), findings=log.findings) for log in self.training],
            holdout=[replace(back.on_log(log), findings=log.findings) for log in self.holdout],
            checks=tuple(c for c in self.checks if c.check != "time_shift"),
            shift=0.0,
        )


def prepare(
    logs: Any, holdout: Any, arm: Arm, corrections: Corrections, settings: Mapping[str, Any], *, repair: bool
) -> PreparedInput:
    """Read logs and prepare them for a diagnosis.

    Parameters
    ----------
    logs, holdout : Log, path, pattern, table, or sequence of these
        Training logs, and logs on which models are judged; without a holdout (None) the last part of every training log is held out.
    arm : Arm
        Nominal model.
    corrections : Corrections
        Corrections of the logs' columns.
    settings : mapping
        Options of the diagnosis, such as `horizon` [s].
    repair : bool
        Whether unambiguous defects are repaired.
    """
    read = {"training": _read(logs, arm), "holdout": [] if holdout is None else _read(holdout, arm)}
    asked = {**settings, "repair": repair, "corrections": corrections.to_dict()}
    given = _given(read["training"], read["holdout"], arm, corrections, repair=repair)
    given = replace(given, notes=(*given.notes, *_idle_spans(arm, read)), provenance=provenance(arm, read, asked))
    return _examined(given, settings["horizon"], repair=repair)


def _idle_spans(arm: Arm, read: Mapping[str, Sequence[Log]]) -> list[str]:
    """Return notes on spans to be left out that name none of the logs."""
    spans = () if arm.corrections is None else arm.corrections.skip
    logs = [log for group in read.values() for log in group]
    used = {span for log in logs for span in Corrections(skip=spans).spans_of(log)}
    return [f"--skip {span} names none of these logs: nothing was left out" for span in spans if span not in used]


def _given(
    logs: Sequence[Log], holdout: Sequence[Log], arm: Arm, corrections: Corrections, *, repair: bool
) -> PreparedInput:
    """Correct and repair the logs, each by itself, and split training logs where no holdout is given."""
    training, checks = _repaired(logs, arm, corrections, repair=repair)
    arm = corrections.on_arm(arm)
    if not holdout:
        training, held = split(_tell_apart(training, [])[0])
        note = f"no holdout was given: the last {100 * _HELD_OUT:.0f} % of every log were held out"
        return PreparedInput(training, held, arm, (note,), tuple(checks))
    held, more = _repaired(holdout, arm, corrections, repair=repair)
    checks += [*more, *copied_holdout(training, held)]
    return PreparedInput(*_tell_apart(training, held), arm, (), tuple(checks))


def _examined(given: PreparedInput, horizon: float, *, repair: bool) -> PreparedInput:
    """Choose stretches of long logs, and check logs and arm file for known defects."""
    training, held = (
        choose(_within_budget(group) if given.arm.chain is not None else group, horizon=horizon)
        for group in (given.training, given.holdout)
    )
    for log in (*training, *held):
        if log.duration < horizon:
            raise LogShapeError(
                f"lasts {log.duration:.3g} s, less than the horizon of {horizon:g} s",
                remedy="give a longer log or a shorter --horizon",
                file=log.path or log.name,
            )
    if given.arm.chain is not None:
        corrections, found_in_all = dead_stretches([*training, *held], given.arm)
        if not found_in_all:
            corrections, found_in_all = contradictions([*training, *held], given.arm, repair=repair)
        if not found_in_all:
            corrections, found_in_all = late_torques([*training, *held], given.arm, repair=repair)
        return replace(
            given,
            training=[corrections.on_log(log) for log in training],
            holdout=[corrections.on_log(log) for log in held],
            arm=corrections.on_arm(given.arm),
            checks=(*found_in_all, *given.checks),
            shift=corrections.shift.get("tau", 0.0),
        )
    try:
        found = examine(training, held, given.arm, horizon=horizon, repair=repair, strangers=False)
    except ValueError as error:
        raise refused(str(error), training, held) from None
    checks = (*found.checks, *given.checks)
    return replace(
        given,
        training=found.training,
        holdout=found.holdout,
        arm=found.arm,
        checks=checks,
        factors=found.corrections.factor,
        shift=found.corrections.shift.get("tau", 0.0),
    )


def _within_budget(logs: Sequence[Log]) -> list[Log]:
    """Return logs with fewer samples, as far as their sample period allows, where there are more than a diagnosis takes."""
    samples, period = sum(len(log) for log in logs), min(log.sample_period for log in logs)
    every = min(math.ceil(samples / BUDGET), round(SHORTEST_S / period))
    return [thinned(log, every) for log in logs]


def _repaired(
    logs: Sequence[Log], arm: Arm, corrections: Corrections, *, repair: bool
) -> tuple[list[Log], list[Check]]:
    examined = [data_checks(corrections.on_log(log), arm, repair=repair) for log in logs]
    return [log for log, _ in examined], [check.of(check.log or log.name) for log, found in examined for check in found]


def _read(logs: Any, arm: Arm) -> list[Log]:
    read = gather(logs, arm)
    if not read:
        raise OptionError("no log was given", remedy="give at least one")
    for log in read:
        if log.n_joints != arm.n_joints:
            raise LogShapeError(
                f"has {log.n_joints} joints, the arm has {arm.n_joints}",
                remedy="use the arm file that belongs to this log",
                file=log.path or log.name,
            )
        if not log.has_torques:
            if arm.chain is None:
                log.with_torques(f"the diagnosis of an arm of kind `{arm.kind}`")
            if arm.controller is None:
                raise no_controller(arm, log.path or log.name)
    return read


def refused(message: str, training: list[Log], held: list[Log]) -> LogShapeError:
    """Return an error that names the logs that the compiled core could not work with."""
    problem, _, remedy = message.partition("; ")
    logs = held if "holdout" in problem else training
    files = ", ".join(dict.fromkeys(str(log.path or log.name) for log in logs))
    return LogShapeError(problem, remedy=remedy or "see the log and the options", file=files)


def _tell_apart(training: list[Log], held: list[Log]) -> tuple[list[Log], list[Log]]:
    """Make log names unique: logs of equal name get their folder's name, then a number."""
    logs = [*training, *held]
    for rename in (_with_folder, _with_number):
        names = [log.name for log in logs]
        logs = [rename(log, i) if names.count(log.name) > 1 else log for i, log in enumerate(logs, start=1)]
    return logs[: len(training)], logs[len(training) :]


def _with_folder(log: Log, _: int) -> Log:
    return log if log.path is None else replace(log, name=f"{printable(log.path.resolve().parent.name)}/{log.name}")


def _with_number(log: Log, number: int) -> Log:
    return replace(log, name=f"{log.name} ({number})")


def split(logs: list[Log]) -> tuple[list[Log], list[Log]]:
    """Return the first parts of logs for training, and the last 40 % of each as holdout."""
    training, held = [], []
    for log in logs:
        cut = int(np.searchsorted(log.t, log.t[0] + (1 - _HELD_OUT) * log.duration))
        training.append(log.part(0, cut, f"{log.name} (first part)"))
        held.append(log.part(cut, len(log), f"{log.name} (last part)"))
    return training, held
