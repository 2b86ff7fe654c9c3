"""``armgap simulate``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from armgap.cli.common import (
    arm_option,
    check_outputs,
    columns_option,
    console,
    parse_columns,
    parse_units,
    quiet_option,
    units_option,
    write,
)
from armgap.cli.progress import working
from armgap.errors import OptionError, ResultError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from armgap.log import Log

__all__ = ["command"]


@click.command("simulate")
@arm_option
@click.option("--torque", required=True, metavar="LOG|seed", help="Log whose times and torques to use, or `seed`.")
@click.option("--duration", type=float, help="Duration [s]; 10 for the seed's torques, the whole log otherwise.")
@click.option(
    "--effect",
    "effect_texts",
    multiple=True,
    metavar="NAME:JOINT:key=value,…",
    help="Effect to add; may be repeated.",
)
@click.option("--noise", default=0.0, show_default=True, help="White noise on positions [rad or m].")
@click.option("--seed", default=0, show_default=True, help="Seed of the noise.")
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="OUT.parquet",
    help="Log to write, .parquet or .csv; - writes CSV to standard output.",
)
@columns_option
@units_option
@quiet_option
def command(
    arm_file: str,
    torque: str,
    duration: float | None,
    effect_texts: tuple[str, ...],
    noise: float,
    seed: int,
    output: str,
    columns: str | None,
    units: str | None,
    quiet: bool,
) -> None:
    """Simulate the arm of an arm file, with effects on request, and write the log."""
    import numpy as np

    from armgap.arm import Arm
    from armgap.log import Log
    from armgap.simulation import Effect, seed_torque, simulate

    check_outputs(output)
    if output != "-" and Path(output).suffix.lower() not in (".parquet", ".pq", ".csv"):
        raise ResultError("has an unknown ending", remedy="write .parquet or .csv", file=output)
    arm = Arm.read(Path(arm_file))
    effects = [Effect.parse(text) for text in effect_texts]
    if duration is not None and not (math.isfinite(duration) and duration > 0):
        raise OptionError(f"--duration is {duration}", remedy="give a positive number of seconds")
    start: tuple[NDArray[np.float64], NDArray[np.float64]] | tuple[None, None]
    if torque == "seed":
        if arm.n_joints != 2:
            raise OptionError("the seed's torques are for two joints", remedy="give a log with --torque LOG")
        t = np.arange(round((duration or 10.0) / arm.sample_period)) * arm.sample_period
        tau, start, name = seed_torque(t), (None, None), "seed"
    else:
        source = Log.read(torque, columns=parse_columns(columns), units=parse_units(units), arm=arm)
        for finding in () if quiet else source.findings:
            console(error=True).print(f"note: {source.name}: {finding.message}", highlight=False, markup=False)
        keep = source.t <= (duration if duration is not None else source.duration)
        t, tau, start, name = source.t[keep], source.tau[keep], _start(source), source.name
    with working("simulating", quiet=quiet):
        log = simulate(arm, t, tau, q0=start[0], dq0=start[1], effects=effects, noise=noise, seed=seed, name=name)
    if output == "-":
        write(output, log.to_polars().write_csv().rstrip())
    else:
        log.write(output)
    if not quiet and output != "-":
        console().print(f"{output}: {len(log)} samples, {log.duration:.3g} s")


def _start(log: Log) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the state a log starts from; its velocity is the slope of its first samples where no sensor gives it."""
    from armgap.identification import velocity

    if log.dq is not None:
        return log.q[0], log.dq[0]
    return log.q[0], velocity(log.t, log.q, "local-cubic", half_width=10)[0]
