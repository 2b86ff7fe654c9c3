"""Sub-command ``armgap simulate``: log of a simulated arm."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from armgap.cli.common import (
    arm_option,
    columns_option,
    console,
    parse_columns,
    parse_units,
    quiet_option,
    units_option,
)
from armgap.cli.files import Command, InputFile, OutputFile, Words
from armgap.cli.numbers import Number, Seed
from armgap.cli.progress import working
from armgap.errors import OptionError, ResultError
from armgap.files.output import STANDARD_STREAM, is_stdout, write

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from armgap.log.log import Log

__all__ = ["command"]

MOST_SAMPLES = 10**8
"""Largest number of samples of a simulation: days of motion, and more than a computer's memory as a rule."""
SEED = "seed"
"""Value of option ``--torque`` that stands for the torques of Reyes and Kelly (1997)."""


@click.command("simulate", cls=Command)
@arm_option
@click.option(
    "--torque",
    type=InputFile(words=(SEED,)),
    required=True,
    metavar="LOG|seed",
    help="Log whose times and torques to use, or `seed`.",
)
@click.option("--duration", type=float, help="Duration [s]; 10 for the seed's torques, the whole log otherwise.")
@click.option(
    "--effect",
    "effect_texts",
    type=Words(),
    multiple=True,
    metavar="NAME:JOINT:key=value,…",
    help="Effect to add; may be repeated.",
)
@click.option("--noise", default=0.0, show_default=True, help="White noise on positions [rad or m].")
@click.option(
    "--seed",
    default=0,
    show_default=True,
    type=Seed(),
    help="Seed of the noise.",
)
@click.option(
    "--tolerance",
    type=Number(min=0, min_open=True),
    help="Largest change of a position when steps are halved [rad or m]; 1e-9 per second by default.",
)
@click.option(
    "-o",
    "--output",
    type=OutputFile(),
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
    tolerance: float | None,
    output: str,
    columns: str | None,
    units: str | None,
    quiet: bool,
) -> None:
    """Simulate the arm of an arm file, with effects on request, and write the log."""
    import numpy as np

    from armgap.arm.arm import Arm
    from armgap.log.log import Log
    from armgap.simulation import Effect, seed_torque, simulate

    if output != STANDARD_STREAM and Path(output).suffix.lower() not in (".parquet", ".pq", ".csv"):
        raise ResultError("has an unknown ending", remedy="write .parquet or .csv", file=output)
    arm = Arm.read(Path(arm_file))
    effects = [Effect.parse(text) for text in effect_texts]
    if duration is not None and not (math.isfinite(duration) and duration > 0):
        raise OptionError(f"--duration is {duration}", remedy="give a positive number of seconds")
    start: tuple[NDArray[np.float64], NDArray[np.float64]] | tuple[None, None]
    if torque == SEED:
        if arm.n_joints != 2:
            raise OptionError("the seed's torques are for two joints", remedy="give a log with --torque LOG")
        count = (duration or 10.0) / arm.sample_period
        if count > MOST_SAMPLES:
            remedy = f"give at most {MOST_SAMPLES * arm.sample_period:g} s"
            raise OptionError(f"--duration is {duration:g}, {count:.2g} samples", remedy=remedy)
        t = np.arange(round(count)) * arm.sample_period
        tau, start, name = seed_torque(t), (None, None), SEED
    else:
        source = Log.read(torque, columns=parse_columns(columns), units=parse_units(units), arm=arm)
        for finding in () if quiet else source.findings:
            console(error=True).print(f"note: {source.name}: {finding.message}", highlight=False, markup=False)
        source = source.with_torques("a simulation")
        if duration is not None and not source.sample_period <= duration <= source.duration + source.sample_period:
            raise OptionError(
                f"--duration is {duration:g}, but the torques of {source.name} last {source.duration:.6g} s",
                remedy=f"give {source.sample_period:g} to {source.duration:.6g} s, or longer torques",
            )
        keep = source.t <= (duration if duration is not None else source.duration)
        t, tau, start, name = source.t[keep], source.tau[keep], _start(source), source.name
    with working("simulating", quiet=quiet):
        log = simulate(
            arm,
            t,
            tau,
            q0=start[0],
            dq0=start[1],
            effects=effects,
            noise=noise,
            seed=seed,
            tolerance=tolerance,
            name=name,
        )
    if output == STANDARD_STREAM:
        write(output, log.to_polars().write_csv())
    else:
        log.write(output)
    if not (quiet or is_stdout(output)):
        console().print(f"{output}: {len(log)} samples, {log.duration:.3g} s")


def _start(log: Log) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return position and velocity at the start of a log; without a velocity sensor, the slope of the first samples."""
    from armgap.estimation.identification import velocity

    if log.dq is not None:
        return log.q[0], log.dq[0]
    return log.q[0], velocity(log.t, log.q, "local-cubic", half_width=10)[0]
