"""Logs of a whole fleet from the physics engine of the blind trial, and their diagnoses."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl

from armgap.fleet import read_manifest, run_fleet
from armgap.fleet.series import moving
from armgap.trial.cases.armfile import arm_toml, draw_nominal
from armgap.trial.simulation.arms import TrialArm, random_arm
from armgap.trial.simulation.excitation import acceptable, draw_excitation
from armgap.trial.simulation.plant import PlantConfig
from armgap.trial.simulation.simulated_arm import SimulatedArm, Trace, run

from .judging import ask, report, truth_name
from .truth import Array, Design, Truth, day, draw, robot_name

#: Largest number of motions drawn for a visit before the study ends with an error.
ATTEMPTS = 40
PERIOD_S = 0.004


def study(seed: int, model: str, robots: int, duration: float, workers: int, folder: Path) -> str:
    """Make and diagnose the logs of one fleet, ask which parameters drift, and return the tables."""
    rng = np.random.default_rng([seed, robots])
    design = Design(robots=robots)
    arms = [random_arm(rng, model, PERIOD_S) for _ in range(robots)]
    truth = draw(rng, design, 2 * arms[0].n_joints)
    manifest = _make(rng, arms, truth, design, duration, folder)
    fleet = run_fleet(read_manifest(manifest), folder / "fleet", {"max_causes": 0}, workers=workers)
    if fleet.failed.height > 0.1 * len(fleet.summary):
        raise RuntimeError(f"{fleet.failed.height} entries without a diagnosis, the first: {fleet.failed['error'][0]}")
    rows = fleet.parameters.with_columns(
        visit=pl.col("time")
        .str.slice(0, 10)
        .replace_strict({day(k): k for k in range(design.visits)}, return_dtype=pl.Int64)
    ).sort("visit", maintain_order=True)
    true = _true_rows(arms, truth, design)
    names = _friction(arms[0])
    assert truth.rising is not None
    wanted = truth_name(truth.rising[1], names[truth.rising[0]])
    answers = [
        ask(table, design, wanted, lambda rows: [(m.robot, m.name) for m in moving(rows)])
        for table in (rows, true.with_columns(sigma=pl.lit(None, pl.Float64)))
    ]
    lines = [
        f"{robots} {model} arms, {len(fleet.failed)} entries without a diagnosis; {wanted} rises",
        _errors(rows, true),
    ]
    for what, answer in zip(("estimates", "true values"), answers, strict=True):
        lines += [f"from {what}:", report([answer], []), f"named beside it: {sorted(answer.false)}"]
    return "\n".join(lines)


def _friction(arm: TrialArm) -> list[str]:
    return [f"{kind}{j + 1}" for kind in ("viscous", "coulomb") for j in range(arm.n_joints)]


def _at(arm: TrialArm, factors: Array) -> TrialArm:
    """Return the arm with its friction multiplied by factors, viscous friction of all joints before Coulomb friction."""
    viscous, coulomb = np.split(np.array(arm.viscous + arm.coulomb) * factors, 2)
    return replace(arm, viscous=tuple(viscous.tolist()), coulomb=tuple(coulomb.tolist()))


def _make(
    rng: np.random.Generator, arms: list[TrialArm], truth: Truth, design: Design, duration: float, folder: Path
) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    entries = []
    for i, arm in enumerate(arms):
        own = np.random.default_rng([i, *rng.integers(0, 2**31, 2).tolist()])
        file = f"arm-{i + 1:02d}.toml"
        (folder / file).write_text(arm_toml(arm, draw_nominal(own, arm, exact=False), robot_name(i), "0" * 64))
        for visit in range(design.visits):
            log = f"{i + 1:02d}-{visit + 1:02d}.parquet"
            motion = np.random.default_rng([visit, *own.integers(0, 2**31, 2).tolist()])
            if not (folder / log).is_file():
                _frame(_motion(motion, _at(arm, truth.factors[:, i, visit]), duration)).write_parquet(folder / log)
            entries.append((robot_name(i), file, log, day(visit)))
    with (folder / "manifest.csv").open("w", newline="") as text:
        csv.writer(text).writerows([("robot", "arm", "logs", "time"), *entries])
    return folder / "manifest.csv"


def _motion(rng: np.random.Generator, arm: TrialArm, duration: float) -> Trace:
    """Return a random motion that a controller tracks, drawn again until the arm moves enough."""
    vigour = float(rng.uniform(0.8, 1.3))
    for _ in range(ATTEMPTS):
        trace = run(SimulatedArm(PlantConfig(arm)), draw_excitation(rng, arm, "tracked", vigour).source(arm), duration)
        good, factor = acceptable(trace, arm)
        if good:
            return trace
        vigour = min(max(vigour * factor, 0.1), 4.0)
    raise RuntimeError(f"no motion of a {arm.kind} arm in {ATTEMPTS} attempts")


def _frame(trace: Trace) -> pl.DataFrame:
    columns = {"t": trace.t}
    for j in range(trace.q.shape[1]):
        columns |= {f"q{j + 1}": trace.q[:, j], f"tau{j + 1}": trace.tau[:, j]}
    return pl.DataFrame(columns)


def _true_rows(arms: list[TrialArm], truth: Truth, design: Design) -> pl.DataFrame:
    inertial = [f"theta{k + 1}" for k in range(len(arms[0].inertial))]
    rows = [
        (robot_name(i), day(visit), "arm", name, float(value), visit)
        for visit in range(design.visits)
        for i, arm in enumerate(arms)
        for name, value in zip((*inertial, *_friction(arm)), _at(arm, truth.factors[:, i, visit]).theta, strict=True)
    ]
    return pl.DataFrame(rows, schema=["robot", "time", "of", "name", "value", "visit"], orient="row")


def _errors(rows: pl.DataFrame, true: pl.DataFrame) -> str:
    """Return a table of the estimates' errors: relative standard errors, errors over these, and correlation with the true scatter."""
    keys = ["robot", "name", "visit"]
    both = rows.join(true.select(*keys, true="value"), on=keys)
    lines = [
        f"{'parameter':10} {'standard error, median':>24} {'spread (log)':>14} {'RMS error/stated':>18} {'RMS error':>11} {'with scatter':>14}"
    ]
    for (name,), part in both.sort("name").group_by(["name"], maintain_order=True):
        value, truth, sigma = (part[c].to_numpy() for c in ("value", "true", "sigma"))
        relative, error = sigma / np.abs(truth), value / truth - 1.0
        scatter = np.log(truth) - part.select(pl.col("true").log().mean().over("robot")).to_series().to_numpy()
        moved = np.std(scatter) > 1e-12
        correlation = f"{np.corrcoef(error, scatter)[0, 1]:14.2f}" if moved else f"{'-':>14}"
        spread = 1.4826 * np.median(np.abs(np.log(relative) - np.median(np.log(relative))))
        rms, ratio = np.sqrt(np.mean(error**2)), np.sqrt(np.mean((error / relative) ** 2))
        lines.append(f"{name!s:10} {np.median(relative):24.5f} {spread:14.2f} {ratio:18.2f} {rms:11.5f} {correlation}")
    return "\n".join(lines)
