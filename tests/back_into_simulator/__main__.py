"""Diagnose and export arms, and simulate the exported files in MuJoCo: ``python -m tests.back_into_simulator --help``."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import click

#: Environment variables that set the number of threads of a process.
THREADS = ("RAYON_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS")
#: Largest relative difference between the RMS error of MuJoCo's predictions and the diagnosis' `gap.after` that counts as agreement.
CLOSE = 0.05
_COLUMNS = ("before", "after", "MJCF", "URDF", "URDF, told")


class Answer(NamedTuple):
    """Verdict and causes of a diagnosis, gap before it, and gaps per joint after it: by the diagnosis, MJCF, URDF, and URDF with added fields."""

    verdict: str
    causes: str
    before: list[float]
    gaps: list[tuple[float, ...]]


@click.command(name="python -m tests.back_into_simulator", context_settings={"show_default": True})
@click.option("--seed", type=click.IntRange(0), default=3, help="Seed of all cases.")
@click.option("--case", "only", type=click.IntRange(0, 4), multiple=True, help="Number of a case; all by default.")
def main(seed: int, only: tuple[int, ...]) -> None:
    """Compare RMS errors over the windows of the holdout: of the diagnosis, and of MuJoCo with the exported files.

    In the last column armature, springs and the solver settings of dry friction are added to the URDF model: URDF has no fields for these.
    """
    os.environ.update(dict.fromkeys(THREADS, "1"))
    from .cases import CASES, make

    click.echo(f"{'':<46} joint  {_COLUMNS[0]:>9}  {_COLUMNS[1]:>9}  " + "  ".join(f"{c:>10}" for c in _COLUMNS[2:]))
    inside, total = [0, 0, 0], 0
    for number in only or range(len(CASES)):
        case = make(seed, number)
        answer = compare(case)
        title = f"{case.key['joints']} joints, {case.key['effect']}: {answer.causes or answer.verdict}"
        if answer.verdict == "input":
            click.echo(f"{title:<46} logs and arm file contradict each other: nothing to compare")
            continue
        for j, (before, (after, *others)) in enumerate(zip(answer.before, answer.gaps, strict=True), start=1):
            shares = "  ".join(f"{100 * (x / after - 1):+9.1f}%" for x in others)
            click.echo(f"{title if j == 1 else '':<46} {j:>5}  {before:9.3g}  {after:9.3g}  {shares}")
            inside = [n + (abs(x / after - 1) <= CLOSE) for n, x in zip(inside, others, strict=True)]
            total += 1
    counts = ", ".join(f"{name} {n}" for name, n in zip(_COLUMNS[2:], inside, strict=True))
    click.echo(f"joints within {CLOSE:.0%} of `after`, of {total}: {counts}")


def compare(case: Any) -> Answer:
    """Diagnose a case, export it, and return the gaps of the exported files over the windows of the holdout."""
    import mujoco
    import numpy as np

    import armgap

    from .windows import missed, windows_of

    found = armgap.diagnose(case.training, case.arm, holdout=case.holdout)
    causes = ", ".join(c.effect for c in found.causes)
    if found.verdict == "input":
        return Answer(found.verdict, causes, [], [])
    corrected = armgap.correct(found, case.arm)
    log = case.holdout[0]
    windows = windows_of(found.to_dict(), log.t, log.q)
    with tempfile.TemporaryDirectory() as folder:
        files = {form: Path(folder) / f"arm.{form}" for form in ("mjcf", "urdf")}
        for form, file in files.items():
            file.write_text(corrected.render(form))
        mjcf, bare, told = (mujoco.MjModel.from_xml_path(str(files[form])) for form in ("mjcf", "urdf", "urdf"))
    joints = json.loads(corrected.render("json"))["joints"]
    for model in (bare, told):
        model.opt.timestep, model.opt.integrator = mjcf.opt.timestep, mjcf.opt.integrator
    told.dof_armature[:] = [joint["armature"] for joint in joints]
    told.dof_solref[:], told.dof_solimp[:] = mjcf.dof_solref, mjcf.dof_solimp
    told.jnt_stiffness[:] = [joint["stiffness"] for joint in joints]
    told.qpos_spring[:] = [joint["rest"] for joint in joints]
    gaps = [missed(mjcf, windows, log.t, log.q, log.tau, apply_torque=False)]
    gaps += [missed(model, windows, log.t, log.q, log.tau, apply_torque=True) for model in (bare, told)]
    rows = np.array([found.gap.after, *gaps]).T
    return Answer(found.verdict, causes, list(found.gap.before), [tuple(row) for row in rows])


if __name__ == "__main__":
    main()
