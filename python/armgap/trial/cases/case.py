"""One case of a trial: an arm, its motions, its hidden effects, and its files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from armgap.errors import ArmgapError
from armgap.files.output import write
from armgap.trial.cases.armfile import arm_toml, draw_nominal
from armgap.trial.cases.key import KEY_FILE, HiddenEffect, Key
from armgap.trial.cases.layout import ARM_FILE
from armgap.trial.cases.visibility import Visibility, visibility
from armgap.trial.effects.base import REGISTRY, Draw, NoTravelError, usage
from armgap.trial.simulation.arms import TrialArm, random_arm
from armgap.trial.simulation.engine import mujoco
from armgap.trial.simulation.excitation import STYLES, Excitation, Tracked, acceptable, draw_excitation, rings
from armgap.trial.simulation.plant import PlantConfig
from armgap.trial.simulation.simulated_arm import SimulatedArm, Trace, run

#: Largest number of motions drawn for one log before its case is given up.
ATTEMPTS = 30
#: Largest number of sizes tried for a hidden effect until it is visible, and increase of the size (on its scale from 0 to 1) from one to the next.
GROWTHS, _SIZE_INCREASE = 8, 0.15
#: One in `SHRUNK_ONE_IN` hidden effects is made smaller while it stays visible: largest number of steps, and decrease of its size (0 to 1) per step.
SHRUNK_ONE_IN, _MAX_SHRINK_STEPS, SHRINK = 5, 6, 0.4
#: Position and speed beyond which a simulated arm counts as diverged, rad and rad/s (m and m/s).
_DIVERGED_POSITION, SPEED = 10.0, 30.0
#: Largest number of controllers tried on an arm with hidden effects, each half as stiff as the preceding one.
DETUNINGS = 6

#: Effect to be hidden: its name, and its joint from 1; None for an effect of the whole arm.
EffectRequest = tuple[str, int | None]
#: Hidden effects, their size from 0 to 1, and their visibility.
SizedEffects = tuple[list[HiddenEffect], float, Visibility]


class NoMotionError(ArmgapError, RuntimeError):
    """Error: no acceptable motion was found for an arm of a trial; another seed helps."""


@dataclass(frozen=True)
class Case:
    """A finished case of a blind trial: arm file, simulated logs, and key with the hidden effects.

    Attributes
    ----------
    name : str
        Name of the case.
    arm_file : str
        Text of ``arm.toml``.
    logs : dict of str to Trace
        Simulated logs by name: ``train-1``, ``holdout-1``, ...
    key : Key
        Key with the hidden effects.
    """

    name: str
    arm_file: str
    logs: dict[str, Trace]
    key: Key

    def write(self, folder: str | Path) -> Path:
        """Write ``arm.toml``, one Parquet file per log, and ``key.json`` into a case folder."""
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        write(target / ARM_FILE, self.arm_file)
        write(target / KEY_FILE, self.key.to_json())
        for name, trace in self.logs.items():
            write(target / f"{name}.parquet", partial(_frame(trace).write_parquet, compression="zstd"))
        return target


def make_case(
    seed: int | Sequence[int],
    effects: Sequence[EffectRequest] = (),
    *,
    model: str = "direct-drive",
    size: float | None = None,
    nominal: str = "off",
    style: str | None = None,
    sample_period: float | None = None,
    duration: float = 10.0,
    n_train: int = 1,
    n_holdout: int = 1,
) -> Case:
    """Make a case of a trial; equal arguments make equal cases.

    Parameters
    ----------
    seed : int or sequence of int
        Seed of all random draws.
    effects : sequence of (name, joint), default none
        Effects to hide; joints from 1, None for an effect of the whole arm.
    model : {"direct-drive", "geared", "pendulum", "axis"}
        Machine around whose parameters the arm is drawn.
    size : float, optional
        Size of the effects, from 0, just above detectable, to 1, large; drawn by default.
    nominal : {"off", "exact"}
        Whether the arm file's parameters have errors drawn from their standard deviations, or are the true ones.
    style : {"multisine", "paper", "tracked"}, optional
        Style of the motions; drawn for each log by default.
    sample_period : float, optional
        Sample period [s]; drawn from 1 to 5 ms by default.
    duration : float, default 10
        Length of each log, s.
    n_train, n_holdout : int, default 1
        Numbers of training and holdout logs, each with its own motion.

    Raises
    ------
    ValueError
        An effect's name or joint is impossible for the arm.
    NoMotionError
        No acceptable motion was found.
    """
    rng = np.random.default_rng(seed)
    arm = random_arm(rng, model, sample_period)
    _check(arm, effects)
    names = [f"train-{i + 1}" for i in range(n_train)] + [f"holdout-{i + 1}" for i in range(n_holdout)]
    motions, plain = _draw_motions(rng, arm, names, style, duration)
    hidden, logs, seen = _hide(rng, arm, effects, size, motions, plain, duration)
    stated = draw_nominal(rng, arm, nominal == "exact")
    details = {
        "seed": _plain(seed),
        "engine": f"mujoco {mujoco().__version__}",
        "model": model,
        "kind": arm.kind,
        "motions": _styles(motions),
        **seen,
    }
    key = Key(hidden, nominal, arm.theta, details, rng.bytes(16).hex())
    return Case(model, arm_toml(arm, stated, f"trial arm ({model})", key.sha256), logs, key)


def simulated_arm_of(arm: TrialArm, hidden: Sequence[HiddenEffect], log: str | None = None) -> SimulatedArm:
    """Return a new simulated arm with hidden effects, as they act in one log."""
    sim = SimulatedArm(PlantConfig(arm))
    for h in hidden:
        if h.log in (None, log):
            REGISTRY[h.effect].apply(sim, (h.joint or 1) - 1, h.parameters)
    return sim


def possible(kind: str, n_joints: int, families: Sequence[str] = ("library",)) -> list[EffectRequest]:
    """Return all pairs of effect and joint that are possible on a kind of arm."""
    requests: list[EffectRequest] = []
    for e in REGISTRY.values():
        if e.family in families and kind in e.kinds:
            requests += [(e.name, j + 1) for j in range(n_joints)] if e.per_joint else [(e.name, None)]
    return requests


def _check(arm: TrialArm, effects: Sequence[EffectRequest]) -> None:
    allowed = possible(arm.kind, arm.n_joints, ("library", "further", "outside"))
    for request in effects:
        if tuple(request) not in allowed:
            raise ValueError(f"no effect {request[0]!r} on joint {request[1]} of a {arm.kind} arm")


def _draw_motions(
    rng: np.random.Generator, arm: TrialArm, names: list[str], style: str | None, duration: float
) -> tuple[dict[str, tuple[str, Excitation]], dict[str, Trace]]:
    motions, traces = {}, {}
    for name in names:
        motions[name], traces[name] = _draw_motion(rng, arm, style, duration)
    return motions, traces


def _draw_motion(
    rng: np.random.Generator, arm: TrialArm, style: str | None, duration: float
) -> tuple[tuple[str, Excitation], Trace]:
    vigour = float(rng.uniform(0.8, 1.3))
    for _ in range(ATTEMPTS):
        chosen = style or str(rng.choice(STYLES, p=[0.4, 0.2, 0.4]))
        motion = draw_excitation(rng, arm, chosen, vigour)
        trace = run(SimulatedArm(PlantConfig(arm)), motion.source(arm), duration)
        good, factor = acceptable(trace, arm)
        if good:
            return (chosen, motion), trace
        vigour = min(max(vigour * factor, 0.1), 4.0)
    raise NoMotionError(f"no motion found in {ATTEMPTS} attempts for a {arm.kind} arm", remedy="take another seed")


def _hide(
    rng: np.random.Generator,
    arm: TrialArm,
    effects: Sequence[EffectRequest],
    size: float | None,
    motions: dict[str, tuple[str, Excitation]],
    plain: dict[str, Trace],
    duration: float,
) -> tuple[tuple[HiddenEffect, ...], dict[str, Trace], dict[str, Any]]:
    """Draw a case's hidden effects, enlarge those that change no log by more than its noise, and simulate the logs with all of them."""
    draws = [int(x) for x in rng.integers(0, 2**63, len(effects))]
    hidden: list[HiddenEffect] = []
    sizes, seen = [], {}
    for number, request in zip(draws, effects, strict=True):
        first = float(rng.uniform()) if size is None else size
        sized = _fit_size(number, first, size is None, partial(_alone, arm, number, request, motions, plain, duration))
        if sized is None:
            raise NoMotionError(f"{request[0]} drives the arm away", remedy="take another seed")
        hidden += sized[0]
        sizes.append(round(sized[1], 3))
        seen[f"{request[0]}:{request[1] or ''}"] = sized[2].to_dict()
    logs = _measure(arm, hidden, motions, duration)
    if not _sane(logs):
        raise NoMotionError("the effects drive the arm away", remedy="take another seed")
    visible = all(x["visible"] for x in seen.values())
    return tuple(hidden), logs, {"size": sizes, "visible": visible, "visibility": seen}


def _alone(
    arm: TrialArm,
    number: int,
    request: EffectRequest,
    motions: dict[str, tuple[str, Excitation]],
    plain: dict[str, Trace],
    duration: float,
    size: float,
) -> SizedEffects | None:
    """Return one hidden effect of a given size (0 to 1), simulated without the other ones, and its visibility; None if the arm diverges."""
    hidden = list(_draw_hidden([number], [size], arm, [request], list(plain.values()), list(plain)))
    logs = _measure(arm, hidden, motions, duration)
    if not _sane(logs):
        return None
    return hidden, size, visibility(arm, plain, logs, everywhere=all(h.log is None for h in hidden))


def _fit_size(
    number: int, size: float, may_shrink: bool, at: Callable[[float], SizedEffects | None]
) -> SizedEffects | None:
    """Enlarge a hidden effect until it is visible, or as far as possible; shrink one in :data:`SHRUNK_ONE_IN` to the limit of visibility."""
    best = at(size)
    for growth in range(1, GROWTHS):
        if best is None or best[2].visible:
            break
        best = at(size + _SIZE_INCREASE * growth) or best
    if best is None or not best[2].visible or not may_shrink or number % SHRUNK_ONE_IN:
        return best
    for _ in range(_MAX_SHRINK_STEPS):
        smaller = at(best[1] - SHRINK)
        if smaller is None or not smaller[2].visible:
            break
        best = smaller
    return best


def _draw_hidden(
    draws: Any,
    sizes: list[float],
    arm: TrialArm,
    effects: Sequence[EffectRequest],
    plain: list[Trace],
    names: list[str],
) -> tuple[HiddenEffect, ...]:
    hidden: list[HiddenEffect] = []
    for number, size, (name, joint) in zip(draws, sizes, effects, strict=True):
        rng, index = np.random.default_rng(int(number)), (joint or 1) - 1
        d = Draw(rng, size, arm, index, usage(plain, index))
        hidden += _events(d, joint) if name == "external_pulse" else [_one(d, name, joint)]
    return tuple(hidden)


def _one(d: Draw, name: str, joint: int | None, log: str | None = None) -> HiddenEffect:
    try:
        drawn = {key: float(f"{value:.6g}") for key, value in REGISTRY[name].draw(d).items()}
    except NoTravelError:
        raise NoMotionError(
            f"the logs have next to no positions of joint {joint} in common", remedy="take another seed"
        ) from None
    return HiddenEffect(name, joint, drawn, log, REGISTRY[name].family)


def _events(d: Draw, joint: int | None) -> list[HiddenEffect]:
    pulses = [_one(d, "external_pulse", joint, "train-1") for _ in range(int(d.rng.integers(1, 4)))]
    pulses.sort(key=lambda p: p.parameters["time"])
    apart = [pulses[0]]
    for pulse in pulses[1:]:
        if pulse.parameters["time"] - apart[-1].parameters["time"] > 0.5:
            apart.append(pulse)
    return apart


def _measure(
    arm: TrialArm, hidden: Sequence[HiddenEffect], motions: dict[str, tuple[str, Excitation]], duration: float
) -> dict[str, Trace]:
    return {name: _log(arm, hidden, name, motion, duration) for name, (_, motion) in motions.items()}


def _log(arm: TrialArm, hidden: Sequence[HiddenEffect], name: str, motion: Excitation, duration: float) -> Trace:
    """Simulate one log; the stiffness of a controller that oscillates on the altered arm is reduced first."""
    for _ in range(DETUNINGS):
        trace = run(simulated_arm_of(arm, hidden, name), motion.source(arm), duration)
        if not (isinstance(motion, Tracked) and rings(trace)):
            break
        motion = motion.softer()
    return trace


def _sane(logs: dict[str, Trace]) -> bool:
    """Return whether no log of a case diverges."""
    return all(
        bool(np.max(np.abs(x.q)) < _DIVERGED_POSITION and np.max(np.abs(x.dq_true)) < SPEED) for x in logs.values()
    )


def _styles(motions: dict[str, tuple[str, Excitation]]) -> dict[str, str]:
    return {name: style for name, (style, _) in motions.items()}


def _plain(seed: int | Sequence[int]) -> int | list[int]:
    return seed if isinstance(seed, int) else [int(s) for s in seed]


def _frame(trace: Trace) -> Any:
    import polars as pl

    n = trace.q.shape[1]
    columns = {"t": trace.t}
    columns |= {f"q{j + 1}": trace.q[:, j] for j in range(n)}
    columns |= {f"tau{j + 1}": trace.tau[:, j] for j in range(n)}
    return pl.DataFrame(columns)
