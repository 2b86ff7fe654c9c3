"""The diagnosis: where the gap lies, which effect causes it, how far it shrinks."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from armgap import _native, options
from armgap._renamed import old_names
from armgap.arm import Arm
from armgap.check import Check, Corrections, torque_unit
from armgap.check.time_shift import causal
from armgap.custom_effect import CustomEffect, TorqueTables, check_effects
from armgap.errors import OptionError
from armgap.evidence import consistency, laws, plausibility
from armgap.literals import Status, Verdict
from armgap.log import Log
from armgap.log.findings import remarks
from armgap.log.units import si
from armgap.prepared_input import PreparedInput, prepare, refused
from armgap.progress import ProgressCallback, report_progress, use_callback
from armgap.report.notebook import NotebookDisplay
from armgap.serial_settings import serial_settings

__all__ = ["Bound", "Cause", "Diagnosis", "Equivalent", "Gap", "Location", "RuledOut", "Sanity", "Value", "diagnose"]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__)

#: What a part of a log is called after the log's own name.
_WHOLE = re.compile(r"( \((first|last) part\))?( \(\S+ to \S+ s\))?$")
#: What a stretch of a log is called after the log's own name.
_STRETCH = re.compile(r" \(\S+ to \S+ s\)$")
MOST_BYTES = 2**28
"""Size of a diagnosis' file; the largest hold some MB."""
MOST_CAUSES = 1000
"""More than the library can name on any arm."""
LogLike = Any  # a Log, a path, a pattern such as "logs/*.parquet", or a table


@dataclass(frozen=True)
class Value:
    """A number with its standard deviation and SI unit."""

    value: float
    sigma: float
    unit: str


@dataclass(frozen=True)
class GapAtHorizon:
    """RMS position error per joint on the holdout at one prediction horizon [s]; fields as in `Gap` [rad or m]."""

    horizon_s: float
    before: tuple[float, ...]
    refit: tuple[float, ...]
    after: tuple[float, ...]
    floor: tuple[float, ...]


@dataclass(frozen=True)
class Gap:
    """How far predictions miss on the holdout: RMS position error per joint.

    Attributes
    ----------
    horizon_s : float
        Prediction horizon [s].
    before, refit, after, floor : tuple of float
        With the arm file as it is, with its parameters re-estimated, with the named causes added, and what measurement
        noise alone leaves [rad or m].
    closed : float
        Share of the gap above the floor that is closed, over all joints.
    closed_ci : tuple of float
        95 % interval of it, from resampled windows.
    free_run_before, free_run_after : tuple of float
        RMS error over the whole holdout, simulated from its first sample [rad or m].
    horizons : tuple of GapAtHorizon
        RMS errors at other prediction horizons, as far as the logs are long enough.
    motion : tuple of float
        RMS displacement over the horizon [rad or m].
    unexplained : float
        Share of the gap above the floor with parameters re-estimated that the named causes leave, from 0 to 1.
    """

    horizon_s: float
    before: tuple[float, ...]
    refit: tuple[float, ...]
    after: tuple[float, ...]
    floor: tuple[float, ...]
    closed: float
    closed_ci: tuple[float, float]
    free_run_before: tuple[float, ...]
    free_run_after: tuple[float, ...]
    horizons: tuple[GapAtHorizon, ...] = ()
    motion: tuple[float, ...] = ()
    unexplained: float = 0.0


@dataclass(frozen=True)
class Location:
    """Where a part of the gap lies."""

    joint: int
    share: float
    regime: str
    detail: str
    variable: str | None = None
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Equivalent:
    """An effect that these logs do not tell from a named one, and why."""

    effect: str
    joint: int | None
    why: str


@dataclass(frozen=True)
class Cause:
    """A named cause, or a candidate, which says `why` it is not named; a push belongs to one log.

    An elastic or slack transmission has `sides`: ``encoder`` and ``friction`` at the ``"motor"`` or the ``"link"``, and whether its ``rotor``
    ``"rides"`` on the joints before or is ``"geared"``.
    """

    effect: str
    title: str
    joint: int | None
    probability: float
    parameters: dict[str, Value]
    closed: float
    equivalents: tuple[Equivalent, ...]
    log: str | None = None
    why: str | None = None
    sides: dict[str, str] | None = None


@dataclass(frozen=True)
class Bound:
    """An upper bound on an effect's size."""

    parameter: str
    value: float
    unit: str
    level: float


@dataclass(frozen=True)
class RuledOut:
    """A candidate that was looked for and not found: ``absent``, ``not excited`` or ``undecided``."""

    effect: str
    joint: int | None
    status: Status
    bound: Bound | None
    why: str | None


@dataclass(frozen=True)
class Sanity:
    """A re-estimated parameter that is not to be believed as it stands.

    Attributes
    ----------
    parameter : str
        Name as in the arm's parameters.
    kind : str
        ``"sign"``: gravity turned over; ``"sigma"``: more than five of the arm file's standard deviations away; ``"zero"``: friction
        of the arm file is gone; ``"unmoved"``: it stayed where it began, beside a gap.
    message : str
        The same in words, with the figures.
    """

    parameter: str
    kind: str
    message: str


_Record = TypeVar("_Record", Value, Equivalent, Bound, Sanity)


@dataclass(frozen=True)
class Diagnosis(NotebookDisplay):
    """The result of `diagnose`.

    Attributes
    ----------
    verdict : {"none", "parameters", "effect", "unexplained", "input"}
        ``"none"``: the gap is within noise; ``"parameters"``: right structure, wrong values; ``"effect"``: causes
        named; ``"unexplained"``: a gap that no effect in the library explains; ``"input"``: logs and arm file contradict each other.
    gap : Gap
        How far.
    where : tuple of Location
        Where, most of the gap first.
    causes : tuple of Cause
        Which, strongest first.
    ruled_out : tuple of RuledOut
        What was looked for and not found.
    parameters : dict
        ``nominal``, ``refit`` and ``with_causes``: name to `Value`.
    checks : tuple of Check
        What was noticed about the input, errors first.
    candidates : tuple of Cause
        What was found and is not fit to be named, each with its `why`; not part of the model with causes.
    sanity : tuple of Sanity
        Re-estimated parameters of the model with causes that are not to be believed as they stand.
    extra : dict
        What a report draws besides: curves, ranking, options.
    """

    verdict: Verdict
    gap: Gap
    where: tuple[Location, ...]
    causes: tuple[Cause, ...]
    ruled_out: tuple[RuledOut, ...]
    parameters: dict[str, dict[str, Value]]
    checks: tuple[Check, ...] = ()
    candidates: tuple[Cause, ...] = ()
    sanity: tuple[Sanity, ...] = ()
    extra: dict[str, Any] = field(default_factory=dict, repr=False)
    _data: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Diagnosis:
        """Build a diagnosis from its JSON object."""
        known = {
            "schema", "verdict", "gap", "where", "causes", "candidates", "ruled_out", "parameters", "sanity", "checks",
        }  # fmt: skip
        gap = data["gap"]
        parameters = {
            stage: {name: _take(Value, value) for name, value in values.items()}
            for stage, values in data["parameters"].items()
        }
        return cls(
            verdict=data["verdict"],
            gap=Gap(
                gap["horizon_s"],
                tuple(gap["before"]),
                tuple(gap["refit"]),
                tuple(gap["after"]),
                tuple(gap["floor"]),
                gap["closed"],
                (gap["closed_ci"][0], gap["closed_ci"][1]),
                tuple(gap["free_run"]["before"]),
                tuple(gap["free_run"]["after"]),
                tuple(_at_horizon(h) for h in gap.get("horizons", ())),
                tuple(gap.get("motion", ())),
                gap.get("unexplained", 0.0),
            ),
            where=tuple(_location(p) for p in data["where"]),
            causes=tuple(_cause(c) for c in data["causes"]),
            ruled_out=tuple(_ruled_out(r) for r in data["ruled_out"]),
            parameters=parameters,
            checks=tuple(Check.from_dict(c) for c in data.get("checks", ())),
            candidates=tuple(_cause(c) for c in data.get("candidates", ())),
            sanity=tuple(_take(Sanity, s) for s in data.get("sanity", ())),
            extra={key: value for key, value in data.items() if key not in known},
            _data=data,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object, schema ``armgap.diagnosis/1``."""
        return self._data

    def to_json(self, indent: int | None = None) -> str:
        """Return the diagnosis as JSON, schema ``armgap.diagnosis/1``."""
        return json.dumps(self._data, indent=indent, allow_nan=False)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader should know: notes on the diagnosis, and what was noticed in the logs, one line per kind."""
        return (*self.extra.get("notes", ()), *remarks(self.extra.get("log_findings", ())))

    def summary(self) -> str:
        """Return the verdict and the three answers (where, which, how far) as text, one line each."""
        from armgap.report import words

        answers = (f"{answer.question} {answer.text}" for answer in words.answers(self._data))
        return "\n".join([words.verdict(self._data), *answers])


def _take(kind: type[_Record], data: dict[str, Any]) -> _Record:
    """Build a record from the entries it knows."""
    return kind(**{f.name: data[f.name] for f in fields(kind) if f.name in data})


def _at_horizon(data: dict[str, Any]) -> GapAtHorizon:
    errors = (tuple(data[key]) for key in ("before", "refit", "after", "floor"))
    return GapAtHorizon(data["horizon_s"], *errors)


def _location(data: dict[str, Any]) -> Location:
    spread = data.get("range") or {}
    return Location(
        data["joint"], data["share"], data["regime"], data["detail"],
        spread.get("variable"), spread.get("from"), spread.get("to"),
    )  # fmt: skip


def _cause(data: dict[str, Any]) -> Cause:
    return Cause(
        data["effect"],
        data.get("title", data["effect"].replace("_", " ")),
        data["joint"],
        data["probability"],
        {name: _take(Value, value) for name, value in data["parameters"].items()},
        data["closed"],
        tuple(_take(Equivalent, e) for e in data["equivalents"]),
        data.get("log"),
        data.get("why"),
        data.get("sides"),
    )


def _ruled_out(data: dict[str, Any]) -> RuledOut:
    bound = data.get("bound")
    return RuledOut(
        data["effect"], data["joint"], data["status"], _take(Bound, bound) if bound else None, data.get("why")
    )


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
    logs, and judged on windows of the holdout logs, whose motion should be another.

    Parameters
    ----------
    logs : Log, path, pattern, table, or sequence of these
        Training logs: anything that `Log.read` or `Log.from_frame` takes, and patterns such as ``"logs/*.parquet"``.
    arm : Arm or path
        Nominal model.
    holdout : Log, path, pattern, table, or sequence of these, optional
        Logs to judge on. Without it the last 40 % of every training log are held out.
    horizon : float, default 0.25
        Prediction horizon [s].
    max_causes : int, default 4
        Causes named at most.
    seed : int, default 1
        Seed of the resampling behind probabilities and intervals.
    effects : sequence of CustomEffect, default none
        Custom effects that take part in the ranking, four at most.
    repair : bool, default True
        Whether defects of the input are repaired that leave nothing to guess (see `armgap.check`); without it they are only said.
    corrections : Corrections, optional
        How columns are to be read otherwise than they stand, on top of what the arm file says.
    progress : callable, optional
        ``progress(work, fraction)`` is called now and then with what is being done and an estimate of how much of it is done, from 0
        to 1.

    Returns
    -------
    Diagnosis

    Raises
    ------
    ArmgapError
        A leaf of it, if a log, the arm or an option cannot be used.
    KeyboardInterrupt
        On an interrupt, within a fifth of a second.
    """
    settings = {
        "horizon": options.positive(horizon, "horizon"),
        "max_causes": options.whole(max_causes, "number of causes", 0, MOST_CAUSES),
        "seed": options.seed(seed),
    }
    check_effects(effects)
    arm = arm if isinstance(arm, Arm) else Arm.read(Path(arm))
    if arm.chain is not None and effects:
        raise OptionError(
            "a serial arm's diagnosis takes no effects of your own",
            remedy="leave them out, or use a planar kind of arm",
        )
    with use_callback(progress):
        given = prepare(logs, holdout, arm, corrections or Corrections(), settings, repair=repair)
        return _diagnose(given, settings, effects)


def _diagnose(given: PreparedInput, settings: dict[str, Any], effects: Sequence[CustomEffect]) -> Diagnosis:
    """Hand over to the core, and add what is known on this side."""
    training, held, arm = given.training, given.holdout, given.arm
    contradictory = any(check.severity == "error" for check in given.checks)
    if contradictory:
        # No effect is asked to explain a contradiction: the figures are those of the arm's own parameters.
        settings = settings | {"max_causes": 0}
    tables = TorqueTables.of(effects, training, held)
    settings = settings | {"own": [e.joint - 1 for e in effects]}
    if arm.chain is not None:
        changed, notes = serial_settings(given.checks)
        settings, given = settings | changed, replace(given, notes=(*given.notes, *notes))
    try:
        text = _native.diagnose(
            arm.to_native(),
            [log.to_native(tables.by_log[log.name]) for log in training],
            [log.to_native(tables.by_log[log.name]) for log in held],
            settings,
            report_progress,
        )
    except ValueError as error:
        raise refused(str(error), training, held) from None
    data = tables.named(json.loads(text))
    if factors := torque_unit.refined(given.factors, data["causes"], arm.n_joints):
        return _diagnose(replace(given.with_factors(factors), factors={}), settings, effects)
    if contradictory:
        data = _contradicted(data)
    data["arm"]["name"] = arm.name
    for cause in (*data["causes"], *data["candidates"]):
        if "log" in cause:
            cause["log"] = _WHOLE.sub("", cause["log"])
    data["notes"] = [*given.notes, *data["notes"]]
    checks = [*given.checks, *_ambiguous_delay(data, training, arm)]
    _ambiguous_lag(data, given.checks)
    data["checks"] = [check.to_dict() for check in checks]
    known, corrected_logs = tables.applied(data, (*training, *held))
    count = len(training)
    if arm.chain is None:
        data["laws"] = laws(known, arm, corrected_logs[:count], corrected_logs[count:])
        data["plausibility"] = plausibility(known, arm)
    else:
        data["plausibility"] = consistency(known, arm)
    data["input"] = _input(arm, training, held)
    data["provenance"] = given.provenance
    data["log_findings"] = [
        {"log": _STRETCH.sub("", log.name), "kind": f.kind, "message": f.message}
        for log in (*training, *held)
        for f in log.findings
    ]
    return Diagnosis.from_dict(data)


def _input(arm: Arm, training: list[Log], held: list[Log]) -> dict[str, Any]:
    """Which columns of which files were used, in which units; stretches of one log are one entry."""
    found: dict[tuple[str, str], dict[str, Any]] = {}
    for use, logs in (("training", training), ("holdout", held)):
        for log in logs:
            name = _STRETCH.sub("", log.name)
            file = None if log.path is None else str(log.path)
            entry = {
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
    """Whether all joints turn, or none does; None where some do."""
    turning = set(arm.rotary_joints)
    return turning.pop() if len(turning) == 1 else None


def _ambiguous_delay(data: dict[str, Any], training: list[Log], arm: Arm) -> list[Check]:
    """List the shift of the file among the equivalents of delays that are equal on all joints, and warn of it."""
    period = float(np.median(np.concatenate([np.diff(log.t) for log in training])))
    check = causal(data["causes"], arm.n_joints, period)
    if check is None:
        return []
    for cause in data["causes"]:
        if cause["effect"] == "actuator_delay":
            cause["equivalents"].append(
                {"effect": "time_shift", "joint": None, "why": "torques early in the file by as much"}
            )
    return [check]


def _ambiguous_lag(data: dict[str, Any], checks: Sequence[Check]) -> None:
    """List a low-pass of the positions among the equivalents of what delays a joint's torque; as long as nobody knows, each has half."""
    joints = {check.joint for check in checks if check.check == "filtered_positions"}
    for cause in data["causes"]:
        if cause["joint"] in joints and cause["effect"] in ("actuator_lag", "actuator_delay"):
            cause["probability"] *= 0.5
            why = f"q{cause['joint']} is smoother than its encoder: a low-pass before logging delays positions as much"
            cause["equivalents"].append({"effect": "filtered_positions", "joint": cause["joint"], "why": why})


def _contradicted(data: dict[str, Any]) -> dict[str, Any]:
    """Return the result of logs and arm file that contradict each other: figures with the remedy applied, no causes."""
    gap = data["gap"] | {"after": data["gap"]["refit"]}
    return data | {"verdict": "input", "causes": [], "candidates": [], "gap": gap}
