"""Cases of the blind trials' generator, kept in a folder together with their true motion."""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from armgap.trial.cases.case import Case, NoMotionError, possible
from armgap.trial.cases.key import Key, open_key
from armgap.trial.simulation.arms import MODELS
from armgap.trial.trial import Plan, plan_trial

from .case import Array, Inputs, Table, Truth

TRUE_MOTION = "true-motion.npz"
#: Name of the marker file in the folder of a case for which the generator found no motion.
NONE = "no-motion"
FIELDS = ("t", "q", "tau", "q_true", "dq_true")


@dataclass(frozen=True)
class Kept:
    """A case as the generator made it, without a defect.

    Attributes
    ----------
    name : str
        Name of the case's folder.
    inputs : Inputs
        Logs and arm file without a defect.
    truth : Truth
        True arm.
    key : Key
        Key of the case with the hidden effects.
    """

    name: str
    inputs: Inputs
    truth: Truth
    key: Key

    @property
    def hidden(self) -> tuple[tuple[str, int | None], ...]:
        """Distinct hidden effects, each with its joint (from 1; None for the whole arm)."""
        return tuple(dict.fromkeys((h.effect, h.joint) for h in self.key.effects))


def plans(seed: int, count: int, models: Sequence[str], share: float, duration: float) -> dict[str, Plan]:
    """Return the plans of cases, by name, that take the arm models in turn; a share of the cases hides one effect of the library.

    Parameters
    ----------
    seed, count : int
        Seed of everything random, and number of cases; the first cases of a longer list are those of a shorter one.
    models : sequence of str
        Names of the trial's arm models.
    share : float
        Share of cases with a hidden effect, 0 to 1.
    duration : float
        Length of each log [s].
    """
    made = {}
    for number in range(count):
        model = models[number % len(models)]
        name = f"defects-{seed}-{number:04d}-{model}-{share:g}-{duration:g}s"
        made[name] = _plan(seed, number, model, share, duration)
    return made


def _plan(seed: int, number: int, model: str, share: float, duration: float) -> Plan:
    rng = np.random.default_rng([seed, number])
    arm = MODELS[model]
    wishes = possible(arm.kind, arm.n_joints, ("library", "further"))
    wish = wishes[int(rng.integers(len(wishes)))]
    effects = (wish,) if rng.uniform() < share else ()
    return Plan((seed, number), "single", model, effects, str(rng.choice(["exact", "off"])), duration)


def trial_plans(seed: int, count: int, duration: float) -> dict[str, Plan]:
    """Return the plans of a blind trial's cases; the names contain seed and size of the trial, because both determine each case."""
    drawn = plan_trial(seed, count)
    return {f"trial-{seed}-{count}-{i:04d}-{duration:g}s": replace(p, duration=duration) for i, p in enumerate(drawn)}


def make(plan: Plan, folder: Path) -> bool:
    """Make a case unless its folder exists; return False where the generator found no motion."""
    if (folder / NONE).exists():
        return False
    if folder.exists():
        return True
    try:
        keep(plan.make(), folder)
    except NoMotionError:
        folder.mkdir(parents=True)
        (folder / NONE).touch()
        return False
    return True


def keep(case: Case, folder: Path) -> None:
    """Write a case and its true motion; the folder gets its name only when it is complete."""
    partial = folder.with_name(f".{folder.name}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    case.write(partial)
    motion = {f"{log}/{name}": getattr(x, name) for log, x in case.logs.items() for name in FIELDS}
    np.savez_compressed(partial / TRUE_MOTION, **motion)
    partial.rename(folder)


def read(folder: Path) -> Kept:
    """Read a case that `make` has made from its folder."""
    arm = tomllib.loads((folder / "arm.toml").read_text(encoding="utf-8"))
    key = open_key(folder)
    del arm["sealed"]
    with np.load(folder / TRUE_MOTION) as motion:
        names = dict.fromkeys(name.split("/")[0] for name in motion.files)
        tables = {log: Table(*(motion[f"{log}/{name}"] for name in FIELDS)) for log in names}
    training, holdout = ({k: x for k, x in tables.items() if k.startswith(part)} for part in ("train", "holdout"))
    kind = key.details["kind"]
    counts: Array = np.array(arm["encoder"]["counts_per_rev"], dtype=float)
    truth = Truth(
        model=key.details["model"],
        kind=kind,
        theta=np.array(key.theta),
        step=(1.0 if kind == "axis" else 2 * np.pi) / counts,
        limit=np.array(arm["actuator"]["torque_limit"]),
        period=arm["sample_period"],
    )
    return Kept(folder.name, Inputs(training, holdout, arm), truth, key)
