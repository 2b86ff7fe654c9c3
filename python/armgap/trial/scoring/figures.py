"""Figures of a trial: scores of all cases, summarised by hidden effect and by method."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from armgap.errors import OptionError
from armgap.trial.answers import Answer, read_answer
from armgap.trial.cases.key import Key, open_key, sealed_hash
from armgap.trial.running import answer_file
from armgap.trial.scoring.calibration import Calibration, calibrate, wilson
from armgap.trial.scoring.case_score import GROUPS, CaseScore, score_case
from armgap.trial.scoring.closing import Closing, closing
from armgap.trial.scoring.sizes import BoundScore, SizeScore, bound_scores, size_scores

__all__ = ["BANDS", "CONFIDENT", "Figures", "Share", "figures", "opened_keys"]

#: Probability from which a cause counts as named with confidence.
CONFIDENT = 0.9
#: Lower edges of the bands in which cases are counted by how well their hidden effects are seen: by the prediction error, as a multiple of the noise
#: floor, that the arm without its least visible effect leaves once its parameters are re-estimated. In the first band an effect shows only as a
#: change of the estimated parameters.
BANDS = (0.0, 2.0, 10.0, 50.0, 250.0)


@dataclass(frozen=True)
class Share:
    """Share of right answers: numbers of right and of all answers, with the 95 % interval."""

    right: int
    of: int

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % confidence interval of the share."""
        return wilson(self.right, self.of)

    @property
    def value(self) -> float:
        """Value of the share; 0 of 0 counts as 0."""
        return self.right / self.of if self.of else 0.0


@dataclass(frozen=True)
class Figures:
    """Scores of one method over all cases of a trial.

    Attributes
    ----------
    method : str
        Name of the method.
    cases : tuple of CaseScore
        Scores of the method's answers, one per case.
    sizes : tuple of SizeScore
        Scores of the sizes of rightly named causes.
    bounds : tuple of BoundScore
        Scores of the bounds of hidden effects that were called absent.
    closings : tuple of Closing
        Prediction errors of arm file, answer and true model, for visible cases that can be simulated.
    version : str
        Version, or versions, of the software that answered.
    """

    method: str
    cases: tuple[CaseScore, ...]
    sizes: tuple[SizeScore, ...]
    bounds: tuple[BoundScore, ...]
    closings: tuple[Closing, ...] = ()
    version: str = ""

    @property
    def visible(self) -> tuple[CaseScore, ...]:
        """Scores of the cases with visible effects of the library, in which a cause has to be named."""
        return tuple(c for c in self.cases if c.group in ("one effect", "two effects"))

    @property
    def headline(self) -> Share:
        """Share of visible cases whose first cause and joint are right."""
        return share(self.visible)

    @property
    def quiet(self) -> tuple[CaseScore, ...]:
        """Scores of the cases without hidden effects, in which any named cause is a false alarm."""
        return tuple(c for c in self.cases if c.group in ("no effect", "parameters only"))

    @property
    def calibration(self) -> Calibration:
        """Calibration of all causes named in all cases."""
        return calibrate([(n.probability, m) for c in self.cases for n, m in zip(c.named, c.matches, strict=True)])

    @property
    def confident(self) -> Share:
        """Share of right causes among those named with a probability of at least `CONFIDENT`."""
        sure = [m for c in self.cases for n, m in zip(c.named, c.matches, strict=True) if n.probability >= CONFIDENT]
        return Share(sum(sure), len(sure))

    @property
    def extra(self) -> float:
        """Mean number per case of named causes that are neither hidden effects nor equivalent to one."""
        return _mean([c.extra for c in self.cases])

    @property
    def alike(self) -> float:
        """Mean number of look-alikes listed with the first cause, per case with a named cause."""
        return _mean([len(c.named[0].look_alikes) for c in self.cases if c.named])

    @property
    def size_error(self) -> float | None:
        """Median relative error of the sizes of rightly named causes."""
        return statistics.median(s.error for s in self.sizes) if self.sizes else None

    @property
    def coverage(self) -> Share:
        """Share of 95 % intervals of sizes that contain the true size."""
        stated = [s.covered for s in self.sizes if s.covered is not None]
        return Share(sum(stated), len(stated))

    @property
    def bounds_hold(self) -> Share:
        """Share of hidden effects called absent whose size is within the 95 % bound that was stated."""
        return Share(sum(b.holds for b in self.bounds), len(self.bounds))

    @property
    def closed(self) -> tuple[float, float] | None:
        """Median and lower decile over cases of the share that answers close of the gap above the true model's error; None without cases."""
        if not self.closings:
            return None
        shares = sorted(c.closed for c in self.closings)
        return statistics.median(shares), shares[len(shares) // 10]

    @property
    def ratio(self) -> tuple[float, float] | None:
        """Median and upper decile over cases of the answer's RMS error on the holdout over the true model's; None without cases."""
        if not self.closings:
            return None
        ratios = sorted(c.ratio for c in self.closings)
        return statistics.median(ratios), ratios[len(ratios) * 9 // 10]

    @property
    def located(self) -> dict[str, Share]:
        """Share of cases, by group, in which the joint named for most of the gap is that of the hidden effect."""
        groups: dict[str, list[bool]] = {}
        for c in self.cases:
            if c.located is not None:
                groups.setdefault(c.group, []).append(c.located)
        return {g: Share(sum(stated), len(stated)) for g, stated in groups.items()}

    @property
    def seconds(self) -> tuple[float, float]:
        """Median and largest CPU time per case, s."""
        times = [c.seconds for c in self.cases]
        return (statistics.median(times), max(times)) if times else (0.0, 0.0)

    def by(
        self, key: Callable[[CaseScore], Iterable[str]], cases: Sequence[CaseScore] | None = None
    ) -> dict[str, Share]:
        """Return the share of rightly answered cases for each label that `key` gives to cases."""
        found: dict[str, list[CaseScore]] = {}
        for case in self.cases if cases is None else cases:
            for name in key(case):
                found.setdefault(name, []).append(case)
        return {name: share(part) for name, part in found.items()}

    @property
    def by_group(self) -> dict[str, Share]:
        """Shares of rightly answered cases by group, in the order of :data:`GROUPS`."""
        found = self.by(lambda c: [c.group])
        return {group: found[group] for group in GROUPS if group in found}

    @property
    def by_band(self) -> dict[str, Share]:
        """Shares of rightly answered cases by band of visibility of the hidden effects."""
        found = self.by(lambda c: [band(c.visible)], self.visible)
        return {name: found[name] for name in map(_band_name, range(len(BANDS))) if name in found}

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as a JSON object."""
        return {
            "method": self.method,
            "version": self.version,
            "right": _share_dict(self.headline),
            "groups": {name: _share_dict(s) for name, s in self.by_group.items()},
            "bands": {name: _share_dict(s) for name, s in self.by_band.items()},
            "confident": _share_dict(self.confident),
            "calibration": asdict(self.calibration),
            "extra_per_case": self.extra,
            "look_alikes_per_case": self.alike,
            "closed": None
            if self.closed is None
            else {"median": self.closed[0], "lower_decile": self.closed[1], "of": len(self.closings)},
            "ratio": None if self.ratio is None else {"median": self.ratio[0], "upper_decile": self.ratio[1]},
            "located": {name: _share_dict(s) for name, s in self.located.items()},
            "size_error": self.size_error,
            "intervals_hold": _share_dict(self.coverage),
            "bounds_hold": _share_dict(self.bounds_hold),
            "seconds": {"median": self.seconds[0], "largest": self.seconds[1]},
            "cases": [_case_dict(c) for c in self.cases],
        }


def opened_keys(cases: Sequence[Path]) -> dict[str, Key]:
    """Open the keys of all cases, each checked against its seal.

    Raises
    ------
    SealError
        A key is not the one that was sealed.
    """
    return {case.name: open_key(case) for case in cases}


def figures(cases: Sequence[Path], keys: dict[str, Key], method: str) -> Figures:
    """Score a method's answers to all cases.

    Raises
    ------
    OptionError
        An answer is missing, cannot be read, or belongs to another case.
    """
    answers = {case.name: _answer_to(case, method) for case in cases}
    pairs = [(name, answer, keys[name]) for name, answer in answers.items()]
    scores = tuple(score_case(name, answer, key) for name, answer, key in pairs)
    asking = {c.case for c in scores if c.group in ("one effect", "two effects")}
    return Figures(
        method,
        scores,
        tuple(s for _, answer, key in pairs for s in size_scores(answer, key)),
        tuple(b for _, answer, key in pairs for b in bound_scores(answer, key)),
        tuple(c for x in cases if x.name in asking if (c := closing(x, answers[x.name], keys[x.name])) is not None),
        ", ".join(sorted({a.version for a in answers.values()})),
    )


def _answer_to(case: Path, method: str) -> Answer:
    path = answer_file(case, method)
    answer = read_answer(path)
    if answer.seal != sealed_hash(case):
        raise OptionError("answers another case of this name", remedy="delete it and run again", file=path)
    return answer


def share(cases: Sequence[CaseScore]) -> Share:
    """Return the share of rightly answered cases."""
    return Share(sum(c.right for c in cases), len(cases))


def band(visible: float) -> str:
    """Return the name of the band for a visibility, a multiple of the noise floor."""
    return _band_name(max(i for i, low in enumerate(BANDS) if visible >= low))


def _band_name(i: int) -> str:
    if i == 0:
        return "by its parameters only"
    if i == len(BANDS) - 1:
        return f"over {BANDS[i]:g} x floor"
    return f"{BANDS[i]:g} to {BANDS[i + 1]:g} x floor"


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values) if values else 0.0


def _share_dict(s: Share) -> dict[str, Any]:
    return {"right": s.right, "of": s.of, "interval": [round(x, 4) for x in s.interval]}


def _case_dict(c: CaseScore) -> dict[str, Any]:
    return {
        "case": c.case,
        "group": c.group,
        "right": c.right,
        "exact": c.exact,
        "listed": c.listed,
        "hidden": [list(h) for h in c.hidden],
        "named": [{"effect": n.effect, "joint": n.joint, "probability": n.probability} for n in c.named],
        "matches": list(c.matches),
        "verdict": c.verdict,
        "error": c.error,
        "seconds": c.seconds,
    }
