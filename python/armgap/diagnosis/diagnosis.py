"""The function `diagnose`: prepares the input, runs the compiled core, and completes its result."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal, TypedDict

import numpy as np

from armgap import _native, options
from armgap.arm.arm import Arm, arm_of
from armgap.arm.corrections import Corrections
from armgap.check import torque_unit
from armgap.check.check import Check
from armgap.check.contradiction import start_beside_file
from armgap.check.serial.logs_differ import logs_differ
from armgap.check.stage import unexplained_columns
from armgap.check.time_shift import causal, early, explains_better, taken_back
from armgap.diagnosis.custom_effect import CustomEffect, TorqueTables, check_effects
from armgap.diagnosis.drive_chain import drive_chain
from armgap.diagnosis.equivalents import (
    beside,
    center_of_mass,
    common_gain,
    encoder_scale,
    gear_losses,
    late_positions,
    low_pass,
    torque_loop,
)
from armgap.diagnosis.laws_in_place import doubt, laws_in_place, say_withheld, withheld
from armgap.diagnosis.prepared_input import PreparedInput, prepare, refused
from armgap.diagnosis.result import Diagnosis
from armgap.diagnosis.serial_settings import serial_settings
from armgap.errors import OptionError
from armgap.evidence import consistency, laws, plausibility
from armgap.log.conversion.unit_names import si
from armgap.log.log import Log
from armgap.log.stretches import STRETCH
from armgap.progress import ProgressCallback, report_progress, use_callback

__all__ = ["InputSummary", "LogRemark", "diagnose"]

#: Pattern of the suffixes that name a part or a stretch of a log, after the log's own name.
_WHOLE = re.compile(r"( \((first|last) part\))?( \(\S+ to \S+ s\))?$")
MOST_CAUSES = 1000
"""Largest number of causes that may be asked for: more than the library can name on any arm."""
LogLike = Any  # a Log, a path, a pattern such as "logs/*.parquet", or a table


class InputLog(TypedDict):
    """A log of a diagnosis as it was read: its columns and their units."""

    name: str
    file: Annotated[str | None, "Its file; null for arrays."]
    set: Literal["training", "holdout"]
    rows: Annotated[int, "Samples that were used."]
    columns: Annotated[dict[str, str], "The file's names of columns, by standard name."]
    units: Annotated[dict[str, str], "Unit of each column in the file, by standard name."]


class InputSummary(TypedDict):
    """Files, columns and units of the input that a diagnosis used."""

    logs: list[InputLog]
    units: Annotated[dict[str, str], "SI unit of each group of columns."]


class LogRemark(TypedDict):
    """A remark on one log of a diagnosis."""

    log: Annotated[str, "Name of the log."]
    kind: str
    message: str


def diagnose(
    logs: LogLike | Sequence[LogLike],
    arm: Arm | str | os.PathLike[str],
    *,
    holdout: LogLike | Sequence[LogLike] | None = None,
    horizon: float = 0.25,
    max_causes: int = 4,
    seed: int = 1,
    effects: Sequence[CustomEffect] = (),
    repair: bool = True,
    corrections: Corrections | None = None,
    progress: ProgressCallback | None = None,
) -> Diagnosis:
    """Diagnose the gap between an arm's nominal model and its logs.

    Candidate effects are fitted together with the arm's parameters by output error over short windows of the training
    logs, and judged on windows of the holdout logs, whose motion should differ from that of the training logs.

    Parameters
    ----------
    logs : Log, path, pattern, table, or sequence of these
        Training logs: anything that `Log.read` or `Log.from_frame` takes, and patterns such as ``"logs/*.parquet"``.
    arm : Arm or path
        Nominal model.
    holdout : Log, path, pattern, table, or sequence of these, optional
        Logs on which models are judged. By default the last 40 % of every training log are held out.
    horizon : float, default 0.25
        Prediction horizon [s].
    max_causes : int, default 4
        Largest number of effects to name; pushes, which are events of a log, are named besides unless it is 0.
    seed : int, default 1
        Seed of the resampling behind probabilities and intervals.
    effects : sequence of CustomEffect, default none
        Custom effects that take part in the ranking, four at most.
    repair : bool, default True
        Whether unambiguous defects of the input are repaired (see `armgap.check`); otherwise they are only reported.
    corrections : Corrections, optional
        Corrections of columns, added to those of the arm file.
    progress : callable, optional
        ``progress(work, fraction)`` is called now and then with the name of the current work and its estimated fraction done,
        from 0 to 1.

    Returns
    -------
    Diagnosis

    Raises
    ------
    ArmgapError
        A subclass of it, if a log, the arm or an option cannot be used.
    KeyboardInterrupt
        On an interrupt, within a fifth of a second.
    """
    settings = {
        "horizon": options.positive(horizon, "horizon"),
        "max_causes": options.whole(max_causes, "number of causes", 0, MOST_CAUSES),
        "seed": options.seed(seed),
    }
    check_effects(effects)
    arm = arm_of(arm)
    if arm.chain is not None and effects:
        raise OptionError(
            "a serial arm's diagnosis takes no effects of your own",
            remedy="leave them out, or use a planar kind of arm",
        )
    with use_callback(progress):
        given = prepare(logs, holdout, arm, corrections or Corrections(), settings, repair=repair)
        return _diagnose(given, settings, effects)


def _diagnose(given: PreparedInput, settings: dict[str, Any], effects: Sequence[CustomEffect]) -> Diagnosis:
    """Run the compiled core on prepared input, and add checks, provenance and custom effects to its result."""
    training, held, arm = given.training, given.holdout, given.arm
    contradictory = any(check.severity == "error" for check in given.checks)
    if contradictory:
        # No effect is fitted to contradictory input: the gap is that of the arm with re-estimated parameters.
        settings = settings | {"max_causes": 0}
    tables = TorqueTables.of(effects, training, held)
    settings = settings | {"own": [e.joint - 1 for e in effects]}
    if arm.chain is not None:
        changed, notes = serial_settings(given.checks)
        settings, given = settings | changed, replace(given, notes=(*given.notes, *notes))
    data = tables.named(_attributed(given, settings, tables))
    if factors := torque_unit.refined(given.factors, data["causes"], arm.n_joints):
        return _diagnose(replace(given.with_factors(factors), factors={}), settings, effects)
    if taken_back(data["causes"], arm.n_joints, given.shift):
        return _diagnose(given.without_shift(), settings, effects)
    # On a serial arm the equation of motion alone has found the shift: predictions confirm it.
    open_verdicts = ("unexplained",) if arm.chain is None else ("unexplained", "effect")
    if given.shift < 0.0 and not contradictory and data["verdict"] in open_verdicts:
        unshifted = given.without_shift()
        other = _attributed(unshifted, settings, TorqueTables.of(effects, unshifted.training, unshifted.holdout))
        if explains_better(other["gap"], data["gap"]):
            return _diagnose(unshifted, settings, effects)
    if not contradictory and (columns := _columns(data, given)):
        return _diagnose(replace(given, checks=(*columns, *given.checks)), settings, effects)
    instead = [] if contradictory or "withheld" in settings else laws_in_place(data, (*training, *held), arm)
    if apart := withheld(data, instead):
        return _diagnose(given, settings | {"withheld": apart}, effects)
    if contradictory:
        data = _contradicted(data)
    data["arm"]["name"] = arm.name
    doubt(data, instead)
    say_withheld(data, settings.get("withheld", ()))
    for cause in (*data["causes"], *data["candidates"]):
        if "log" in cause:
            cause["log"] = _WHOLE.sub("", cause["log"])
    data["notes"] = [*given.notes, *data["notes"]]
    checks = [*given.checks, *(_ambiguous_delay(data, training, arm) or _hidden_delay(data, given))]
    if arm.chain is not None and data["verdict"] == "unexplained":
        checks += logs_differ([*training, *held], arm)
    low_pass(data, given.checks)
    torque_loop(data)
    encoder_scale(data, (*training, *held))
    if arm.chain is None:
        center_of_mass(data, arm)
        gear_losses(data)
        common_gain(data)
    data["checks"] = [check.to_dict() for check in checks]
    known, corrected_logs = tables.applied(data, (*training, *held))
    count = len(training)
    if arm.chain is None:
        data["laws"] = laws(known, arm, corrected_logs[:count], corrected_logs[count:])
        data["plausibility"] = plausibility(known, arm)
    else:
        data["plausibility"] = consistency(known, arm)
    gap = data["gap"]
    data["chain"] = (
        [] if contradictory else drive_chain(arm, training, held, horizon=gap["horizon_s"], floor=gap["floor"])
    )
    late_positions(data)
    data["input"] = _input(arm, training, held)
    data["provenance"] = given.provenance
    remarks: list[LogRemark] = [
        {"log": STRETCH.sub("", log.name), "kind": f.kind, "message": f.message}
        for log in (*training, *held)
        for f in log.findings
    ]
    data["log_findings"] = remarks
    return Diagnosis.from_dict(data)


def _attributed(given: PreparedInput, settings: dict[str, Any], tables: TorqueTables) -> dict[str, Any]:
    """Return the result of the compiled core on prepared input, as a dict; custom effects have numbers for names."""
    training, held = given.training, given.holdout
    if given.arm.chain is None:
        settings = settings | {"start": start_beside_file(training, given.arm)}
    try:
        text = _native.diagnose(
            given.arm.to_native(),
            [log.to_native(tables.by_log[log.name]) for log in training],
            [log.to_native(tables.by_log[log.name]) for log in held],
            settings,
            report_progress,
        )
    except ValueError as error:
        raise refused(str(error), training, held) from None
    found: dict[str, Any] = json.loads(text)
    return found


def _input(arm: Arm, training: list[Log], held: list[Log]) -> InputSummary:
    """Return the files and columns, with units, that a diagnosis used; stretches of one log are one entry."""
    found: dict[tuple[str, str], InputLog] = {}
    sets: tuple[tuple[Literal["training", "holdout"], list[Log]], ...] = (("training", training), ("holdout", held))
    for use, logs in sets:
        for log in logs:
            name = STRETCH.sub("", log.name)
            file = None if log.path is None else str(log.path)
            entry: InputLog = {
                "name": name,
                "file": file,
                "set": use,
                "rows": 0,
                "columns": dict(log.columns),
                "units": dict(log.units),
            }
            found.setdefault((use, name), entry)["rows"] += len(log)
    return {"logs": list(found.values()), "units": si(_rotary(arm))}


def _rotary(arm: Arm) -> bool | None:
    """Return True if all joints are rotary, False if none is, None for an arm with both kinds."""
    turning = set(arm.rotary_joints)
    return turning.pop() if len(turning) == 1 else None


def _ambiguous_delay(data: dict[str, Any], training: list[Log], arm: Arm) -> list[Check]:
    """Add a time shift of the file to the equivalents of delays that are equal on all joints, and return a warning of it."""
    period = float(np.median(np.concatenate([np.diff(log.t) for log in training])))
    check = causal(data["causes"], arm.n_joints, period)
    if check is None:
        return []
    for cause in data["causes"]:
        if cause["effect"] == "actuator_delay":
            cause["equivalents"].append(beside("time_shift", None, "torques early in the file by as much"))
    return [check]


def _hidden_delay(data: dict[str, Any], given: PreparedInput) -> list[Check]:
    """Return a warning that torques stand too early in the file, by predictions, if the gap is unexplained or all joints have delays or lags."""
    late = {c["joint"] for c in data["causes"] if c["effect"] in ("actuator_delay", "actuator_lag")}
    asked = data["verdict"] == "unexplained" or len(late) == given.arm.n_joints > 1
    if not asked or given.arm.chain is not None or any(check.check == "time_shift" for check in given.checks):
        return []
    check = early(given.training, given.holdout, given.arm, data["gap"]["horizon_s"])
    return [] if check is None else [check]


def _columns(data: dict[str, Any], given: PreparedInput) -> list[Check]:
    """Return a check that the columns do not belong to the arm's joints, where no effect of the library brings predictions near the motion."""
    if given.arm.chain is not None:
        return []
    gap = data["gap"]
    moving = [(after, motion) for after, motion in zip(gap["after"], gap["motion"], strict=True) if motion > 0.0]
    relative = max((after / motion for after, motion in moving), default=0.0)
    return unexplained_columns(given.training, given.holdout, given.arm, gap["horizon_s"], relative)


def _contradicted(data: dict[str, Any]) -> dict[str, Any]:
    """Return the result for logs and arm file that contradict each other: gap with the remedy applied, no causes."""
    gap = data["gap"] | {"after": data["gap"]["refit"]}
    return data | {"verdict": "input", "causes": [], "candidates": [], "gap": gap}
