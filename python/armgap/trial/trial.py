"""Whole trials: many sealed cases of several families from one seed."""

from __future__ import annotations

import secrets
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from armgap.files.output import write_folder
from armgap.trial.cases.case import Case, EffectRequest, NoMotionError, make_case, possible
from armgap.trial.cases.layout import case_name
from armgap.trial.simulation.arms import MODELS

#: Families of trial cases and their default shares.
FAMILIES = {"single": 0.65, "null": 0.08, "parameters": 0.07, "pair": 0.12, "outside": 0.08}
#: Kinds of machine with the share of cases drawn from each.
MACHINES = {"direct-drive": 0.45, "geared": 0.35, "pendulum": 0.12, "axis": 0.08}
#: Seed of the trial cases that the diagnosis may be developed on; reported scores use fresh seeds.
DEVELOPMENT_SEED = 1997
#: All seeds whose trial cases were used in development.
DEVELOPMENT_SEEDS = (11, DEVELOPMENT_SEED)
#: Largest number of seeds tried for one case until one gives an acceptable motion.
RETRIES = 10


@dataclass(frozen=True)
class Plan:
    """Plan of one trial case.

    Attributes
    ----------
    seed : tuple of int
        Seed of the trial and number of the case.
    family : str
        Key of :data:`FAMILIES`.
    model : str
        Kind of machine, a key of :data:`MACHINES`.
    effects : tuple of (name, joint)
        Effects to hide, with joints from 1; None for an effect of the whole arm.
    nominal : {"exact", "off"}
        Whether the arm file's parameters are exact or off.
    duration : float
        Length of each log [s].
    """

    seed: tuple[int, ...]
    family: str
    model: str
    effects: tuple[EffectRequest, ...]
    nominal: str
    duration: float = 10.0

    def make(self) -> Case:
        """Make the planned case; if a seed gives no acceptable motion, the next seed is tried.

        Raises
        ------
        NoMotionError
            No seed gave an acceptable motion.
        """
        for attempt in range(RETRIES):
            try:
                return self._make((*self.seed, attempt))
            except NoMotionError:
                continue
        raise NoMotionError(f"no motion for case {self.seed} of {self.model} in {RETRIES} attempts")

    def _make(self, seed: tuple[int, ...]) -> Case:
        return make_case(seed, self.effects, model=self.model, nominal=self.nominal, duration=self.duration)


def fresh_seed() -> int:
    """Return a random seed below 2^31 for a trial with cases that development has not used."""
    return secrets.randbelow(2**31)


def plan_trial(seed: int, n_cases: int, families: Mapping[str, float] | None = None) -> list[Plan]:
    """Return plans with the hidden effects of each case of a trial, in random order, so that numbers reveal nothing.

    Parameters
    ----------
    seed : int
        Seed of the trial: :data:`DEVELOPMENT_SEED`, or one of :func:`fresh_seed` for a score to be reported.
    n_cases : int
        Number of cases.
    families : mapping of str to float, optional
        Families and their shares; default :data:`FAMILIES`.

    Raises
    ------
    ValueError
        A family is unknown.
    """
    shares = dict(families or FAMILIES)
    unknown = set(shares) - set(FAMILIES)
    if unknown:
        raise ValueError(f"unknown family {sorted(unknown)[0]!r}; known are {', '.join(FAMILIES)}")
    rng = np.random.default_rng([seed, n_cases])
    names = _deal(shares, n_cases)
    rng.shuffle(names)
    singles = {model: _endless(rng, model, ("library", "further")) for model in MODELS}
    others = {model: _endless(rng, model, ("outside",)) for model in MODELS}
    return [_plan(rng, (seed, i), name, singles, others) for i, name in enumerate(names)]


def make_trial(
    seed: int,
    n_cases: int,
    families: Mapping[str, float] | None = None,
    *,
    folder: str | Path,
    duration: float = 10.0,
    workers: int = 1,
) -> list[Path]:
    """Make a trial on disk: one folder per case, named by number only.

    Parameters
    ----------
    seed, n_cases, families
        See :func:`plan_trial`.
    folder : path
        Folder for the case folders.
    duration : float, default 10
        Length of each log, s.
    workers : int, default 1
        Number of processes.

    Returns
    -------
    list of Path
        The case folders.
    """
    plans = [replace(p, duration=duration) for p in plan_trial(seed, n_cases, families)]
    targets = [Path(folder) / case_name(i) for i in range(n_cases)]
    Path(folder).mkdir(parents=True, exist_ok=True)
    if workers == 1:
        return [_make(p, t) for p, t in zip(plans, targets, strict=True)]
    with ProcessPoolExecutor(workers) as pool:
        return list(pool.map(_make, plans, targets))


def _make(plan: Plan, target: Path) -> Path:
    return write_folder(target, plan.make().write)


def _deal(shares: Mapping[str, float], n: int) -> list[str]:
    """Return family names of n cases in proportion to the shares, by largest remainder."""
    total = sum(shares.values())
    exact = {name: n * share / total for name, share in shares.items()}
    names = [name for name, x in exact.items() for _ in range(int(x))]
    rest = sorted(exact, key=lambda name: exact[name] % 1, reverse=True)
    return names + rest[: n - len(names)]


def _endless(rng: np.random.Generator, model: str, families: tuple[str, ...]) -> Iterator[EffectRequest]:
    """Yield every effect and joint of a machine in random order, endlessly."""
    arm = MODELS[model]
    requests = possible(arm.kind, arm.n_joints, families)
    while True:
        for i in rng.permutation(len(requests)):
            yield requests[int(i)]


def _plan(
    rng: np.random.Generator,
    seed: tuple[int, int],
    family: str,
    singles: dict[str, Iterator[EffectRequest]],
    others: dict[str, Iterator[EffectRequest]],
) -> Plan:
    model = str(rng.choice(list(MACHINES), p=list(MACHINES.values())))
    nominal = {"null": "exact", "parameters": "off"}.get(family) or str(rng.choice(["exact", "off"]))
    if family == "pair" and model in ("pendulum", "axis"):
        model = "direct-drive"
    effects: tuple[EffectRequest, ...] = ()
    if family == "single":
        effects = (next(singles[model]),)
    elif family == "outside":
        effects = (next(others[model]),)
    elif family == "pair":
        effects = _pair(singles[model])
    return Plan(seed, family, model, effects, nominal)


def _pair(requests: Iterator[EffectRequest]) -> tuple[EffectRequest, EffectRequest]:
    first = next(requests)
    second = next(w for w in requests if w[0] != first[0] and not _alike(first, w))
    return first, second


#: Pairs of effects that motion cannot distinguish, which are not hidden together.
LOOK_ALIKES = (
    {"torque_offset", "coulomb_asymmetry"},
    {"base_tilt", "encoder_offset"},
    {"joint_elasticity", "backlash"},
)


def _alike(a: EffectRequest, b: EffectRequest) -> bool:
    return any({a[0], b[0]} == pair for pair in LOOK_ALIKES)
