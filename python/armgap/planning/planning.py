"""The function `plan`, which plans the next experiment from a diagnosis, and its result `Plan`."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armgap import options
from armgap.arm.arm import Arm, arm_of, only_planar
from armgap.diagnosis.nominal import mismatch
from armgap.diagnosis.result import Diagnosis
from armgap.errors import OptionError, ResultError
from armgap.evidence.hypothesis import Hypothesis
from armgap.files.json_result import JsonResult
from armgap.files.output import STANDARD_STREAM, write
from armgap.planning.criterion import PredictedMotion, Setting
from armgap.planning.dynamics import inverse_dynamics
from armgap.planning.limits import TORQUE_MARGIN, PlanLimits, limits_of
from armgap.planning.motion import Motion
from armgap.planning.open_questions.hypotheses import HypothesisBuilder, TestedQuestion
from armgap.planning.open_questions.questions import NONE, Question, asked, known_model, open_questions, rank, spelt
from armgap.planning.open_questions.sizes import Scales
from armgap.planning.outcome import Outcome
from armgap.planning.search import Search
from armgap.progress import ProgressCallback, use_callback

if TYPE_CHECKING:
    import polars as pl

__all__ = ["Plan", "PlannedQuestion", "plan"]

Array = NDArray[np.float64]

#: Largest number of open questions of a diagnosis that a motion is planned for by default, and of all pairs of an effect and a rival, those against
#: effects that imitate it among them. The more imitators are left out, the more the search finds motions that some of them fit: small oscillations
#: around two poses show a torque over position at two places only.
MOST_QUESTIONS, MOST_PAIRS = 5, 10
#: Log-likelihood ratio that a decision needs, in addition to the logarithm of the number of candidates.
DECISION = 3.0
#: Expected log-likelihood ratio below which evidence counts as none.
NEXT_TO_NOTHING = 1.0
#: Part of the difference that an effect makes, left after the rival is fitted, below which the models are equivalent.
SAME = 1e-3
#: Part of the difference that an effect makes, left by a fit of all values of another one, below which the two are identical. Rounding leaves
#: 1e-20; a hardening spring, which larger motions tell from a tilted base, was seen to leave 2e-6.
IDENTICAL = 1e-10
#: Largest number of effects that are tried as imitations of an effect in question.
_TRIED = 8
SCHEMA = "armgap.plan/1"


@dataclass(frozen=True)
class PlannedQuestion:
    """Expected evidence of a planned motion for one question.

    Attributes
    ----------
    effect, joint : str, int or None
        The effect in question.
    against, against_joint : str, int or None
        Rival effect and its joint; ``"none"`` for the absence of `effect`.
    expected_log_likelihood_ratio : float
        Expected log-likelihood ratio of effect and rival if the effect is in the arm, mean over the effect's sizes.
    settled : float
        Probability that a diagnosis of the motion's log decides the question if the effect is in the arm, mean over its sizes.
    origin : {"asked", "equivalents", "candidate", "undecided", "not excited"}
        Reason why the question is open.
    sizes : (str, float, float), optional
        Parameter, and range of its values over which means are taken [SI].
    why : str
        Reason why the question may stay open; empty where it is practically settled.
    """

    effect: str
    joint: int | None
    against: str
    against_joint: int | None
    expected_log_likelihood_ratio: float
    settled: float
    origin: str
    sizes: tuple[str, float, float] | None = None
    why: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the question as a JSON object."""
        against: dict[str, Any] = {"effect": self.against}
        if self.against != NONE:
            against["joint"] = self.against_joint
        sizes = None if self.sizes is None else dict(zip(("parameter", "from", "to"), self.sizes, strict=True))
        return {
            "effect": self.effect,
            "joint": self.joint,
            "against": against,
            "expected_log_likelihood_ratio": self.expected_log_likelihood_ratio,
            "settled": self.settled,
            "origin": self.origin,
            "sizes": sizes,
            "why": self.why,
        }


@dataclass(frozen=True)
class Plan(JsonResult):
    """A planned experiment, the result of `plan`.

    Attributes
    ----------
    arm : str
        Name of the arm.
    kind : str
        Kind of the arm.
    t : ndarray, shape (n_samples,)
        Times, evenly spaced by the arm's sample period [s].
    q_ref, dq_ref, tau_ff : ndarray, shape (n_samples, n_joints)
        Reference positions and velocities, and the torque that the best model needs for them from each sample to the next [SI].
    questions : tuple of PlannedQuestion
        Questions that the motion is planned for.
    left_out : tuple of str
        Open questions that the motion is not planned for, as ``effect:joint against rival``.
    limits : PlanLimits
        Limits of the motion.
    threshold : float
        Log-likelihood ratio that a decision needs.
    evaluations : int
        Number of motions compared in the search.
    notes : tuple of str
        Remarks on the plan.
    """

    arm: str
    kind: str
    t: Array = field(repr=False)
    q_ref: Array = field(repr=False)
    dq_ref: Array = field(repr=False)
    tau_ff: Array = field(repr=False)
    questions: tuple[PlannedQuestion, ...]
    left_out: tuple[str, ...]
    limits: PlanLimits
    threshold: float
    evaluations: int
    notes: tuple[str, ...]

    @property
    def duration(self) -> float:
        """Length of the planned motion [s]."""
        return float(self.t[-1])

    def to_dict(self) -> dict[str, Any]:
        """Return the plan without its motion as a JSON object, schema ``armgap.plan/1``."""
        return {
            "schema": SCHEMA,
            "arm": {"name": self.arm, "kind": self.kind},
            "duration_s": self.duration,
            "samples": len(self.t),
            "questions": [q.to_dict() for q in self.questions],
            "left_out": list(self.left_out),
            "limits": self.limits.to_dict(),
            "used": {
                "position_min": self.q_ref.min(axis=0).tolist(),
                "position_max": self.q_ref.max(axis=0).tolist(),
                "speed": np.abs(self.dq_ref).max(axis=0).tolist(),
                "torque": np.abs(self.tau_ff).max(axis=0).tolist(),
            },
            "start": self.q_ref[0].tolist(),
            "threshold": self.threshold,
            "evaluations": self.evaluations,
            "notes": list(self.notes),
        }

    def to_polars(self) -> pl.DataFrame:
        """Return the motion as a table with the columns ``t, q_ref1, ..., dq_ref1, ..., tau_ff1, ...``."""
        import polars as pl

        columns = {"t": self.t}
        for name, values in (("q_ref", self.q_ref), ("dq_ref", self.dq_ref), ("tau_ff", self.tau_ff)):
            columns |= {f"{name}{j + 1}": values[:, j] for j in range(values.shape[1])}
        return pl.DataFrame(columns)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the reference motion, as CSV or Parquet by the name's ending; ``-`` is CSV on standard output.

        Raises
        ------
        ResultError
            If the name has another ending, or the file cannot be written.
        """
        check_output(path)
        table = self.to_polars()
        if Path(path).suffix.lower() in _PARQUET:
            write(path, partial(table.write_parquet, compression="zstd"))
        else:
            write(path, table.write_csv())

    def summary(self) -> str:
        """Return the purpose of the plan and its expected certainty, one line per question."""
        from armgap.planning.page import lines

        return "\n".join(lines(self))


_PARQUET = (".parquet", ".pq")


def check_output(path: str | os.PathLike[str]) -> None:
    """Raise an error if the ending of a path names no format in which a motion can be written."""
    if os.fspath(path) != STANDARD_STREAM and Path(path).suffix.lower() not in (*_PARQUET, ".csv"):
        raise ResultError("has an unknown ending", remedy="write .csv or .parquet", file=path)


def plan(
    diagnosis: Diagnosis | str | os.PathLike[str],
    arm: Arm | str | os.PathLike[str],
    *,
    questions: Sequence[str] = (),
    duration: float = 10.0,
    seed: int = 1,
    progress: ProgressCallback | None = None,
) -> Plan:
    """Plan the motion that best settles the questions a diagnosis left open.

    Of the motions tried, the one with the most expected evidence is taken: the log-likelihood ratio of the effect in question against its rival, both
    with all values fitted to the planned motion (T-optimality, Atkinson and Fedorov 1975). The motion keeps to the arm file's limits, or to the range
    of the diagnosed logs, and begins and ends at rest.

    Parameters
    ----------
    diagnosis : Diagnosis or path
        Diagnosis of the arm.
    arm : Arm or path
        The arm that was diagnosed.
    questions : sequence of str, default none
        Effects to settle, ``"EFFECT:JOINT"`` each, against their absence and their equivalents. By default the five open
        questions with the largest consequences.
    duration : float, default 10
        Length of the motion [s], 2 to 120.
    seed : int, default 1
        Seed of the search; equal seeds give equal motions.
    progress : callable, optional
        Function that is called with the name of the work and the fraction that is done, 0 to 1, as for `armgap.diagnose`.

    Returns
    -------
    Plan

    Raises
    ------
    ArmgapError
        A subclass of it, if the diagnosis, the arm or an option cannot be used, or nothing is open.
    """
    seconds = options.positive(duration, "duration")
    shortest, longest = options.SHORTEST_PLAN_S, options.LONGEST_PLAN_S
    if not shortest <= seconds <= longest:
        raise OptionError(f"the duration is {seconds:g} s", remedy=f"give {shortest:g} to {longest:g} s")
    number = options.seed(seed)
    arm = arm_of(arm)
    only_planar(arm, "plan")
    check_optimiser()
    data = _usable(diagnosis, arm)
    with use_callback(progress):
        return _plan(data, arm, questions, seconds, number)


def check_optimiser() -> None:
    """Raise an error if scipy, the package for differential evolution, is not installed."""
    from importlib.util import find_spec

    if find_spec("scipy") is None:
        raise OptionError(
            "planning needs scipy, which is not installed", remedy="install it with pip install 'armgap[plan]'"
        )


def _usable(diagnosis: Diagnosis | str | os.PathLike[str], arm: Arm) -> dict[str, Any]:
    """Return the JSON object of a diagnosis, after a check that it belongs to the arm and leaves a question open."""
    from armgap.export.read import read_diagnosis

    if isinstance(diagnosis, list | tuple):
        raise OptionError(f"{len(diagnosis)} diagnoses were given", remedy="give one; diagnose its logs together first")
    read = diagnosis if isinstance(diagnosis, Diagnosis) else read_diagnosis(Path(diagnosis))
    file = None if isinstance(diagnosis, Diagnosis) else diagnosis
    data = read.to_dict()
    if read.verdict == "input":
        raise OptionError(
            "its verdict is `input`: logs and arm file contradict each other",
            remedy="apply the remedy that it names and diagnose again",
            file=file,
        )
    described = (data.get("arm") or {}).get("kind", arm.kind)
    if described != arm.kind:
        problem = f"is of an arm of kind {described!r}, the arm file's is {arm.kind!r}"
        raise OptionError(problem, remedy="give the arm file that was diagnosed", file=file)
    if (found := mismatch(read, arm)) is not None:
        problem, name = found
        raise OptionError(problem, remedy="give the arm file that was diagnosed", file=arm.path, column=name)
    if "noise" not in data:
        raise OptionError(
            "says nothing of the noise", remedy="give the JSON that `armgap diagnose --json` wrote", file=file
        )
    return data


def _plan(data: dict[str, Any], arm: Arm, wanted: Sequence[str], duration: float, seed: int) -> Plan:
    limits = limits_of(arm, data)
    model, notes = known_model(data, arm)
    setting, search, usual, more = _usual_motion(data, model, limits, duration)
    model, notes = setting.model, (*notes, *more)
    builder = HypothesisBuilder(data, usual, scales_of(arm, data, limits, usual, setting), model.effects)
    questions, remarks = open_questions(data)
    named = asked(wanted, data, arm)
    tested = []
    for question in named or questions:
        try:
            one = builder.pose(question)
        except ValueError:
            remarks.append(f"{question.text}: cannot be predicted along a motion within these limits")
            continue
        if one is not None:
            tested.append(one)
        else:
            remarks.append(f"{question.text}: these limits leave nothing that the diagnosed logs did not cover")
    if not named:
        tested.sort(key=_urgency)
    chosen = tested if named else tested[:MOST_QUESTIONS]
    if len(chosen) < MOST_PAIRS:
        chosen += _against_look_alikes(builder, chosen, usual, remarks)
    settling = {p.question.text for p in chosen}
    left = (
        [q for q in (p.question for p in tested) if q.text not in settling]
        if not named
        else [q for q in questions if q.text not in settling]
    )
    if not chosen:
        if remarks:
            remedy = "ask for another effect with --for, or widen [limits]"
            raise OptionError(f"nothing can be planned for: {remarks[0]}", remedy=remedy)
        raise OptionError("the diagnosis leaves nothing open", remedy="ask for an effect, such as --for backlash:2")
    candidates = len(data["causes"]) + len(data.get("candidates") or []) + len(data["ruled_out"])
    threshold = DECISION + math.log(max(candidates, 1))
    found = search.best(chosen, threshold, seed)
    motion = found.motion
    played = search.play(motion)
    answered = [
        _answer(p, played.outcome(p.pair), float(most), threshold) for p, most in zip(chosen, found.most, strict=True)
    ]
    t, q, dq, tau = _sampled(motion, setting)
    return Plan(
        arm.name,
        arm.kind,
        t,
        q,
        dq,
        tau,
        tuple(answered),
        tuple(q.text for q in left),
        limits,
        threshold,
        found.evaluations,
        (*_limit_notes(limits, arm), *notes, *remarks),
    )


def _usual_motion(
    data: dict[str, Any], model: Hypothesis, limits: PlanLimits, duration: float
) -> tuple[Setting, Search, PredictedMotion, tuple[str, ...]]:
    """Return the setting, the search, and a usual motion; without causes with which the arm diverges along it, and a remark on them.

    A drag that falls with the cube of the velocity is bounded in a slow log, and in a fast motion makes the arm diverge.
    """
    setting = Setting.of(data, model)
    search = Search(setting, limits, duration)
    try:
        return setting, search, search.usual(), ()
    except OptionError:
        if not model.effects:
            raise
    setting = Setting.of(data, model.only(()))
    search = Search(setting, limits, duration)
    gone = ", ".join(spelt(e.effect, e.joint) for e in model.effects)
    remark = f"the planned motion is predicted without {gone}: with the diagnosed values the arm diverges within these limits"
    return setting, search, search.usual(), (remark,)


def _against_look_alikes(
    builder: HypothesisBuilder, chosen: Sequence[TestedQuestion], usual: PredictedMotion, remarks: list[str]
) -> list[TestedQuestion]:
    """Return questions of each chosen effect, asked against its absence, against effects that imitate it; add remarks on identical ones."""
    known = {frozenset((p.question.place, p.question.rival)) for p in chosen}
    unseen = [p for p in chosen if p.question.against == NONE]
    likely = [q for p in unseen for q in builder.look_alikes(p)[:_TRIED]]
    posed = []
    for question in (q for q in likely if frozenset((q.place, q.rival)) not in known):
        with suppress(ValueError):  # an imitation that cannot be predicted is none
            posed.append(builder.pose(question))
    weighed = [(usual.outcome(p.quick), p) for p in posed if p is not None]
    remarks += [f"{p.question.text}: a usual motion does not tell them apart" for x, p in weighed if x.kept < IDENTICAL]
    doubtful = sorted(((x.expected, p) for x, p in weighed if x.kept >= IDENTICAL), key=lambda x: x[0])
    return [p for _, p in doubtful][: MOST_PAIRS - len(chosen)]


def _urgency(tested: TestedQuestion) -> tuple[int, float]:
    """Return the sort key of a question: causes against equivalents, then candidates, then the rest; in each, the largest prediction error first."""
    first = min(rank(tested.question), 2)
    return first, -min(tested.consequence, 1e9)


def scales_of(arm: Arm, data: dict[str, Any], limits: PlanLimits, usual: PredictedMotion, setting: Setting) -> Scales:
    """Return typical torques, speeds and positions of a usual motion, and the ranges that the diagnosed logs covered (`regimes`)."""
    edges = {r["variable"]: r["edges"] for r in data.get("regimes") or []}
    n, motion = arm.n_joints, limits.motion
    seen = [edges.get(f"q{j}") or [0.0, 0.0] for j in range(1, n + 1)]
    torque = np.array([(edges.get(f"abs(tau{j})") or [0.0])[-1] for j in range(1, n + 1)], dtype=np.float64)
    most = np.abs(usual.tau).max(axis=0) if limits.torque is None else limits.torque
    return Scales.of(
        arm,
        (usual.q, usual.dq),
        usual.tau,
        setting.model.inertia(limits.home[None])[0],
        low=motion.position_min,
        high=motion.position_max,
        seen_low=np.array([s[0] for s in seen], dtype=np.float64),
        seen_high=np.array([s[-1] for s in seen], dtype=np.float64),
        seen_torque=torque,
        most_torque=np.maximum(most, 1e-9),
    )


def _sampled(motion: Motion, setting: Setting) -> tuple[Array, Array, Array, Array]:
    """Return the motion at the arm's sample period: times, positions, velocities, and torques, each for the middle of its interval."""
    period = setting.arm.sample_period
    t = period * np.arange(round(motion.duration / period) + 1, dtype=np.float64)
    q, dq, _ = motion.at(t)
    tau = inverse_dynamics(setting.model, *motion.at(t + 0.5 * period))
    return t, q, dq, tau


def _answer(tested: TestedQuestion, outcome: Outcome, most: float, threshold: float) -> PlannedQuestion:
    question, settled = tested.question, outcome.settled(threshold)
    return PlannedQuestion(
        *question.place,
        *question.rival,
        outcome.expected,
        settled,
        question.origin,
        tested.sizes,
        _obstacle(question, outcome, max(most, outcome.expected)) if settled < 0.5 else "",
    )


def _obstacle(question: Question, outcome: Outcome, most: float) -> str:
    """Return the reason why a question may stay open after the motion."""
    other = "the arm's own values" if question.against == NONE else spelt(*question.rival)
    if outcome.kept < SAME and float(outcome.weight @ outcome.plain) > NEXT_TO_NOTHING:
        return f"fitting {other} gives the same motion: this motion does not tell them apart"
    if most < NEXT_TO_NOTHING:
        return "none of the motions tried within these limits would show it"
    return (
        "at most of its sizes, motions within these limits and of this length give less evidence than a decision needs"
    )


def _limit_notes(limits: PlanLimits, arm: Arm) -> list[str]:
    notes = []
    if limits.source == "logs":
        notes.append(
            "the arm file has no [limits]; the motion keeps to the positions, speeds and accelerations of the diagnosed logs"
        )
    if limits.motion.space is None and arm.link_length is not None:
        notes.append(
            "the arm file gives no link_radius and boxes; only the joints' limits keep the arm from itself and from what is around it"
        )
    if limits.torque is None:
        notes.append("the arm file has no torque_limit; torques are not limited")
    else:
        notes.append(
            f"the feed-forward torque takes at most {TORQUE_MARGIN:.0%} of torque_limit; the rest is the controller's"
        )
    return notes
