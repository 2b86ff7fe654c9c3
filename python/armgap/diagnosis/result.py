"""The result of a diagnosis, as frozen types that its JSON is read into."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

from armgap.check.check import Check
from armgap.diagnosis.dependence import Dependence, DependenceGrid, DependenceLaw, dependence
from armgap.files.json_result import JsonResult
from armgap.literals import ChainStage, Status, Verdict
from armgap.log.findings import remarks
from armgap.report.forms.notebook import NotebookDisplay

__all__ = [
    "Bound",
    "Cause",
    "ChainPart",
    "Dependence",
    "DependenceGrid",
    "DependenceLaw",
    "Diagnosis",
    "Equivalent",
    "Gap",
    "GapAtHorizon",
    "Location",
    "RuledOut",
    "Sanity",
    "Value",
    "Values",
]

MOST_BYTES = 2**28
"""Largest accepted size of a diagnosis' file, bytes; the largest diagnoses have some MB."""


@dataclass(frozen=True)
class Value:
    """A number with its standard deviation and SI unit."""

    value: float
    sigma: float
    unit: str


@dataclass(frozen=True)
class Values:
    """Values of one parameter on several joints, in the joints' order, with standard deviations and SI unit."""

    value: tuple[float, ...]
    sigma: tuple[float, ...]
    unit: str


@dataclass(frozen=True)
class GapAtHorizon:
    """RMS position errors per joint [rad or m] on the holdout at the prediction horizon `horizon_s` [s], for the models in `Gap`.

    `before`: arm file; `refit`: parameters re-estimated; `after`: with the named causes; `floor`: of a perfect model.
    """

    horizon_s: float
    before: tuple[float, ...]
    refit: tuple[float, ...]
    after: tuple[float, ...]
    floor: tuple[float, ...]

    @classmethod
    def read(cls, data: dict[str, Any]) -> GapAtHorizon:
        """Build the RMS errors at one prediction horizon from their JSON entries."""
        before, refit, after, floor = (tuple(data[key]) for key in ("before", "refit", "after", "floor"))
        return cls(data["horizon_s"], before, refit, after, floor)


@dataclass(frozen=True)
class SecondHalves:
    """RMS position error per joint on the second half of each holdout log, with the named causes added.

    Attributes
    ----------
    after : tuple of float
        Error with positions as they were measured [rad or m].
    with_zeros : tuple of float
        Error with the encoder zeros estimated from the first half of each log [rad or m].
    """

    after: tuple[float, ...]
    with_zeros: tuple[float, ...]


@dataclass(frozen=True)
class TrainingErrors:
    """RMS position error per joint [rad or m] on the training logs: `after` of the re-estimated arm, `floor` of a perfect model."""

    after: tuple[float, ...]
    floor: tuple[float, ...]


@dataclass(frozen=True)
class Gap:
    """Gap on the holdout: RMS error of predicted positions per joint.

    Attributes
    ----------
    horizon_s : float
        Prediction horizon [s].
    before, refit, after, floor : tuple of float
        RMS error with the arm file's parameters, with re-estimated parameters, with the named causes added, and by
        a perfect model: noise, and errors of the measured starts carried along the window [rad or m].
    closed : float
        Share of the gap above the floor that is closed, over all joints.
    closed_ci : tuple of float
        95 % confidence interval of `closed`, from resampled windows.
    free_run_before, free_run_after : tuple of float
        RMS error over the whole holdout, simulated from its first sample [rad or m].
    horizons : tuple of GapAtHorizon
        RMS errors at other prediction horizons, for which the logs are long enough.
    motion : tuple of float
        RMS displacement over the horizon [rad or m].
    unexplained : float
        Share of the gap above the floor, parameters re-estimated, that remains with the named causes, from 0 to 1.
    second_halves : SecondHalves, optional
        Gap with encoder zeros re-estimated per recording; None for a single training recording.
    training : TrainingErrors, optional
        Gap on the training logs where no cause is named and the holdout shows none; else None.
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
    second_halves: SecondHalves | None = None
    training: TrainingErrors | None = None


@dataclass(frozen=True)
class Location:
    """Joint (from 1) and regime of motion in which a part of the gap lies, with its share of the gap.

    `variable`, `low` and `high` are the regime's variable and its limits in SI units; None for a joint's whole motion.
    """

    joint: int
    share: float
    regime: str
    detail: str
    variable: str | None = None
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Equivalent:
    """An effect that the logs do not tell from a cause, why, and whether another motion may; `joints` and `row` as in `Cause`."""

    effect: str
    joint: int | None
    why: str
    motion_separates: bool = True
    joints: tuple[int, ...] | None = None
    row: tuple[int, int] | None = None


@dataclass(frozen=True)
class Cause:
    """A named cause, or a candidate with the reason `why` it is not named; an external disturbance belongs to one log.

    An elastic or slack transmission has `sides`: ``encoder`` and ``friction`` at the ``"motor"`` or the ``"link"``, and ``rotor``, which
    ``"rides"`` on the preceding joints or is ``"geared"``. An external push has a `shape` over time: ``"rectangle"``, or ``"bell"``, a raised cosine
    with the variance of a rectangle of its duration. Load-dependent friction has the shape ``"torque"`` where the load is the actuator's torque,
    friction that varies with position ``"twice_per_turn"`` where it does so.

    A common law on several `joints` is one cause: `joint` is None, `parameters` are empty, and `values` has one entry per joint
    (`by_joint` splits it into causes of single joints). A term that acts on a sum or a difference of two joints' motion has the factors of
    the joints as `row`.
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
    joints: tuple[int, ...] | None = None
    row: tuple[int, int] | None = None
    values: dict[str, Values] = field(default_factory=dict)
    shape: str | None = None

    def by_joint(self) -> tuple[Cause, ...]:
        """Return the cause itself, or one cause per joint where a common law acts on several joints."""
        if not self.joints or self.row:
            return (self,)
        return tuple(
            replace(
                self,
                joint=joint,
                joints=None,
                values={},
                parameters={name: Value(v.value[i], v.sigma[i], v.unit) for name, v in self.values.items()},
            )
            for i, joint in enumerate(self.joints)
        )


@dataclass(frozen=True)
class Bound:
    """Upper confidence limit `value`, at the confidence level `level`, of the parameter that gives the size of an effect that was not found."""

    parameter: str
    value: float
    unit: str
    level: float


@dataclass(frozen=True)
class RuledOut:
    """A candidate effect that was not found: ``absent``, ``not excited`` or ``undecided``; `joints` and `row` as in `Cause`."""

    effect: str
    joint: int | None
    status: Status
    bound: Bound | None
    why: str | None
    joints: tuple[int, ...] | None = None
    row: tuple[int, int] | None = None


@dataclass(frozen=True)
class Sanity:
    """A warning about an implausible re-estimated parameter of the arm.

    Attributes
    ----------
    parameter : str
        Name as in the arm's parameters.
    kind : str
        ``"sign"``: reversed gravity; ``"sigma"``: more than five of the arm file's standard deviations away; ``"zero"``: no friction
        where the arm file has some; ``"unmoved"``: at its nominal value in spite of a gap.
    message : str
        The warning in words, with its figures.
    """

    parameter: str
    kind: str
    message: str


@dataclass(frozen=True)
class ChainPart:
    """Share of the gap at one joint that arises in a stage of the chain from command to measured position.

    Attributes
    ----------
    stage : {"drive", "transmission", "mechanics", "sensor"}
        Stage of the chain: between command and measured torque, first and second encoder, measured torque and position, position and sensor.
    joint : int
        Joint, from 1.
    share : float
        Share of the squared gap, parameters re-estimated, from 0 to 1; see `armgap.diagnosis.drive_chain`.
    parameters : dict
        Parameters of a drive: ``delay``, ``gain``, ``offset``, ``viscous`` and ``inertia``, see `armgap.diagnosis.drive`.
    detail : str
        The share and its basis in words, with figures.
    """

    stage: ChainStage
    joint: int
    share: float
    parameters: dict[str, Value]
    detail: str


_Record = TypeVar("_Record", Equivalent, Value, Bound, Sanity)


@dataclass(frozen=True)
class Diagnosis(JsonResult, NotebookDisplay):
    """Result of `diagnose`: size, location and causes of the gap between an arm's nominal model and its logs.

    Attributes
    ----------
    verdict : {"none", "parameters", "effect", "unexplained", "input"}
        ``"none"``: the gap is within noise; ``"parameters"``: right structure, wrong values; ``"effect"``: causes
        named; ``"unexplained"``: a gap that no effect in the library explains; ``"input"``: logs and arm file contradict each other.
    gap : Gap
        RMS prediction errors on the holdout, before and after parameters are re-estimated and causes added.
    where : tuple of Location
        Joints and regimes where the gap lies, the largest share first.
    causes : tuple of Cause
        Named causes, strongest first.
    ruled_out : tuple of RuledOut
        Candidate effects that were not found.
    parameters : dict
        ``nominal``, ``refit`` and ``with_causes``: name to `Value`.
    checks : tuple of Check
        Defects of the input, errors first.
    candidates : tuple of Cause
        Effects found but not named, each with its reason `why`; not part of the model with causes.
    sanity : tuple of Sanity
        Re-estimated parameters of the model with causes that are implausible.
    unnamed : tuple of Dependence
        Dependences of the remaining residual torque, strongest first; empty where it is within noise.
    chain : tuple of ChainPart
        Share of the gap at each stage between command and position, largest share first; empty where the logs hold neither measured
        torques nor second encoders.
    extra : dict
        Further data for reports: curves, ranking, options.
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
    unnamed: tuple[Dependence, ...] = ()
    chain: tuple[ChainPart, ...] = ()
    extra: dict[str, Any] = field(default_factory=dict, repr=False)
    _data: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Diagnosis:
        """Build a diagnosis from its JSON object."""
        known = {
            "schema", "verdict", "gap", "where", "causes", "candidates", "ruled_out", "parameters", "sanity", "checks",
            "unnamed",
            "chain",
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
                tuple(GapAtHorizon.read(h) for h in gap.get("horizons", ())),
                tuple(gap.get("motion", ())),
                gap.get("unexplained", 0.0),
                SecondHalves(**{key: tuple(x) for key, x in halves.items()})
                if (halves := gap.get("second_halves"))
                else None,
                TrainingErrors(**{key: tuple(x) for key, x in errors.items()})
                if (errors := gap.get("training"))
                else None,
            ),
            where=tuple(_location(p) for p in data["where"]),
            causes=tuple(_cause(c) for c in data["causes"]),
            ruled_out=tuple(_ruled_out(r) for r in data["ruled_out"]),
            parameters=parameters,
            checks=tuple(Check.from_dict(c) for c in data.get("checks", ())),
            candidates=tuple(_cause(c) for c in data.get("candidates", ())),
            sanity=tuple(_take(Sanity, s) for s in data.get("sanity", ())),
            unnamed=tuple(dependence(d) for d in data.get("unnamed", ())),
            chain=tuple(_chain_part(p) for p in data.get("chain", ())),
            extra={key: value for key, value in data.items() if key not in known},
            _data=data,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the diagnosis as a JSON object, schema ``armgap.diagnosis/1``."""
        return self._data

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for a reader of the diagnosis: its notes, and findings in the logs, one line per kind."""
        return (*self.extra.get("notes", ()), *remarks(self.extra.get("log_findings", ())))

    def summary(self) -> str:
        """Return the verdict and the three answers (where, which, how far) as text, one line each."""
        from armgap.report import words

        answers = (f"{answer.question} {answer.text}" for answer in words.answers(self._data))
        return "\n".join([words.verdict(self._data), *answers])


def _take(kind: type[_Record], data: dict[str, Any]) -> _Record:
    """Build a record from those entries of a JSON object that the record's type has."""
    return kind(**{f.name: data[f.name] for f in fields(kind) if f.name in data})


def _location(data: dict[str, Any]) -> Location:
    spread = data.get("range") or {}
    return Location(
        data["joint"], data["share"], data["regime"], data["detail"],
        spread.get("variable"), spread.get("from"), spread.get("to"),
    )  # fmt: skip


def _several(data: dict[str, Any]) -> dict[str, Any]:
    """Return the entries `joints` and `row` of a JSON object, for an effect on several joints."""
    return {key: tuple(data[key]) for key in ("joints", "row") if data.get(key)}


def _cause(data: dict[str, Any]) -> Cause:
    parameters = data["parameters"].items()
    single = {name: _take(Value, v) for name, v in parameters if not isinstance(v["value"], list)}
    values = {
        name: Values(tuple(v["value"]), tuple(v["sigma"]), v["unit"]) for name, v in parameters if name not in single
    }
    return Cause(
        data["effect"],
        data.get("title", data["effect"].replace("_", " ")),
        data["joint"],
        data["probability"],
        single,
        data["closed"],
        tuple(_take(Equivalent, e | _several(e)) for e in data["equivalents"]),
        data.get("log"),
        data.get("why"),
        data.get("sides"),
        values=values,
        shape=data.get("shape"),
        **_several(data),
    )


def _chain_part(data: dict[str, Any]) -> ChainPart:
    parameters = {name: _take(Value, value) for name, value in data.get("parameters", {}).items()}
    return ChainPart(data["stage"], data["joint"], data["share"], parameters, data["detail"])


def _ruled_out(data: dict[str, Any]) -> RuledOut:
    bound = data.get("bound")
    return RuledOut(
        data["effect"],
        data["joint"],
        data["status"],
        _take(Bound, bound) if bound else None,
        data.get("why"),
        **_several(data),
    )
