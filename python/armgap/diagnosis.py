"""The diagnosis: where the gap lies, which effect causes it, how far it shrinks."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from armgap import _native
from armgap.arm import Arm
from armgap.errors import LogShapeError, OptionError
from armgap.evidence import laws, plausibility
from armgap.log import Log, gather
from armgap.log.findings import remarks
from armgap.log.stretches import choose
from armgap.own import OwnEffect, Tables
from armgap.progress import Told, following, tell
from armgap.report.notebook import Shown

__all__ = ["Bound", "Cause", "Diagnosis", "Equivalent", "Gap", "Place", "RuledOut", "Sanity", "Value", "diagnose"]

#: What a part of a log is called after the log's own name.
_WHOLE = re.compile(r"( \((first|last) part\))?( \(\S+ to \S+ s\))?$")
#: What a stretch of a log is called after the log's own name.
_STRETCH = re.compile(r" \(\S+ to \S+ s\)$")
_HELD_OUT = 0.4
LogLike = Any  # a Log, a path, a pattern such as "logs/*.parquet", or a table


@dataclass(frozen=True)
class Value:
    """A number with its standard deviation and SI unit."""

    value: float
    sigma: float
    unit: str


@dataclass(frozen=True)
class AtHorizon:
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
        The same over the whole holdout, simulated from its first sample.
    horizons : tuple of AtHorizon
        The same at other prediction horizons, as far as the logs are long enough.
    motion : tuple of float
        RMS displacement over the horizon [rad or m].
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
    horizons: tuple[AtHorizon, ...] = ()
    motion: tuple[float, ...] = ()


@dataclass(frozen=True)
class Place:
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
    """A named cause, or a candidate, which says `why` it is not named; a push belongs to one log."""

    effect: str
    title: str
    joint: int | None
    probability: float
    parameters: dict[str, Value]
    closed: float
    equivalents: tuple[Equivalent, ...]
    log: str | None = None
    why: str | None = None


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
    status: str
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
class Diagnosis(Shown):
    """The result of `diagnose`.

    Attributes
    ----------
    verdict : str
        ``"none"``: the gap is within noise; ``"parameters"``: right structure, wrong values; ``"effect"``: causes
        named; ``"unexplained"``: a gap that no effect in the library explains.
    gap : Gap
        How far.
    where : tuple of Place
        Where, most of the gap first.
    causes : tuple of Cause
        Which, strongest first.
    ruled_out : tuple of RuledOut
        What was looked for and not found.
    parameters : dict
        ``nominal``, ``refit`` and ``with_causes``: name to `Value`.
    candidates : tuple of Cause
        What was found and is not fit to be named, each with its `why`; not part of the model with causes.
    sanity : tuple of Sanity
        Re-estimated parameters of the model with causes that are not to be believed as they stand.
    extra : dict
        What a report draws besides: curves, ranking, options.
    """

    verdict: str
    gap: Gap
    where: tuple[Place, ...]
    causes: tuple[Cause, ...]
    ruled_out: tuple[RuledOut, ...]
    parameters: dict[str, dict[str, Value]]
    candidates: tuple[Cause, ...] = ()
    sanity: tuple[Sanity, ...] = ()
    extra: dict[str, Any] = field(default_factory=dict, repr=False)
    _data: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Diagnosis:
        """Build a diagnosis from its JSON object."""
        known = {"schema", "verdict", "gap", "where", "causes", "candidates", "ruled_out", "parameters", "sanity"}
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
            ),
            where=tuple(_place(p) for p in data["where"]),
            causes=tuple(_cause(c) for c in data["causes"]),
            ruled_out=tuple(_ruled_out(r) for r in data["ruled_out"]),
            parameters=parameters,
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


def _at_horizon(data: dict[str, Any]) -> AtHorizon:
    errors = (tuple(data[key]) for key in ("before", "refit", "after", "floor"))
    return AtHorizon(data["horizon_s"], *errors)


def _place(data: dict[str, Any]) -> Place:
    spread = data.get("range") or {}
    return Place(
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
    effects: Sequence[OwnEffect] = (),
    progress: Told | None = None,
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
    holdout : the same, optional
        Logs to judge on. Without it the last 40 % of every training log are held out.
    horizon : float, default 0.25
        Prediction horizon [s].
    max_causes : int, default 4
        Causes named at most.
    seed : int, default 1
        Seed of the resampling behind probabilities and intervals.
    effects : sequence of OwnEffect, default none
        Effects of your own that take part in the ranking, four at most.
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
    with following(progress):
        return _diagnose(logs, arm, holdout, horizon, max_causes, seed, effects)


def _diagnose(
    logs: LogLike | Sequence[LogLike],
    arm: Arm | str | os.PathLike[str],
    holdout: LogLike | Sequence[LogLike] | None,
    horizon: float,
    max_causes: int,
    seed: int,
    effects: Sequence[OwnEffect],
) -> Diagnosis:
    """Check, read, split, choose; hand over to the core; and add what is known on this side."""
    arm = arm if isinstance(arm, Arm) else Arm.read(Path(arm))
    if not (np.isfinite(horizon) and horizon > 0):
        raise OptionError(f"the horizon is {horizon}", remedy="give a positive number of seconds")
    if max_causes < 0:
        raise OptionError(f"the number of causes is {max_causes}", remedy="give 0 or more")
    training = _logs(logs, arm)
    notes = []
    if holdout is None:
        training, held = _split(training)
        notes.append(f"no holdout was given: the last {100 * _HELD_OUT:.0f} % of every log were held out")
    else:
        held = _logs(holdout, arm)
        notes += _overlap(training, held)
    training, held = (choose(group, horizon=horizon) for group in _tell_apart(training, held))
    for log in (*training, *held):
        if log.duration < horizon:
            raise LogShapeError(
                f"lasts {log.duration:.3g} s, less than the horizon of {horizon:g} s",
                remedy="give a longer log or a shorter --horizon",
                file=log.path or log.name,
            )
    own = Tables.of(effects, training, held)
    joints = [e.joint - 1 for e in effects]
    options = {"horizon": float(horizon), "max_causes": int(max_causes), "seed": int(seed), "own": joints}
    try:
        text = _native.diagnose(arm.to_native(), _columns(training, own), _columns(held, own), options, tell)
    except ValueError as error:
        raise _refused(str(error), training, held) from None
    data = own.named(json.loads(text))
    data["arm"]["name"] = arm.name
    for cause in (*data["causes"], *data["candidates"]):
        if "log" in cause:
            cause["log"] = _WHOLE.sub("", cause["log"])
    data["notes"] = notes + data["notes"]
    known, logs_with_own = own.applied(data, (*training, *held))
    count = len(training)
    data["laws"] = laws(known, arm, logs_with_own[:count], logs_with_own[count:])
    data["plausibility"] = plausibility(known, arm)
    data["log_findings"] = [
        {"log": _STRETCH.sub("", log.name), "kind": f.kind, "message": f.message}
        for log in (*training, *held)
        for f in log.findings
    ]
    return Diagnosis.from_dict(data)


def _logs(logs: LogLike | Sequence[LogLike], arm: Arm) -> list[Log]:
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
    return read


def _refused(message: str, training: list[Log], held: list[Log]) -> LogShapeError:
    """Name the logs that the core could not work with."""
    problem, _, remedy = message.partition("; ")
    logs = held if "holdout" in problem else training
    files = ", ".join(dict.fromkeys(str(log.path or log.name) for log in logs))
    return LogShapeError(problem, remedy=remedy or "see the log and the options", file=files)


def _overlap(training: list[Log], held: list[Log]) -> list[str]:
    """Say which logs are both learnt from and judged on."""
    seen = {log.path.resolve() for log in training if log.path is not None}
    both = [log.name for log in held if log.path is not None and log.path.resolve() in seen]
    return [f"{name} is learnt from and judged on too: its figures flatter" for name in both]


def _tell_apart(training: list[Log], held: list[Log]) -> tuple[list[Log], list[Log]]:
    """Give logs of the same name their folder's name, then a number."""
    logs = [*training, *held]
    for rename in (_with_folder, _with_number):
        names = [log.name for log in logs]
        logs = [rename(log, i) if names.count(log.name) > 1 else log for i, log in enumerate(logs, start=1)]
    return logs[: len(training)], logs[len(training) :]


def _with_folder(log: Log, _: int) -> Log:
    return log if log.path is None else replace(log, name=f"{log.path.resolve().parent.name}/{log.name}")


def _with_number(log: Log, number: int) -> Log:
    return replace(log, name=f"{log.name} ({number})")


def _split(logs: list[Log]) -> tuple[list[Log], list[Log]]:
    training, held = [], []
    for log in logs:
        cut = int(np.searchsorted(log.t, log.t[0] + (1 - _HELD_OUT) * log.duration))
        training.append(log.part(0, cut, f"{log.name} (first part)"))
        held.append(log.part(cut, len(log), f"{log.name} (last part)"))
    return training, held


def _columns(logs: list[Log], own: Tables) -> list[tuple[str, Any, Any, Any, list[Any]]]:
    fix = np.ascontiguousarray
    return [(log.name, fix(log.t), fix(log.q), fix(log.tau), own.by_log[log.name]) for log in logs]
