"""Sub-command ``armgap identify``: parameters from logs by recursive least squares."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from armgap.cli.common import (
    arm_option,
    columns_option,
    console,
    corrections_options,
    interruptible,
    json_option,
    parse_columns,
    parse_units,
    quiet_option,
    read_arm,
    units_option,
)
from armgap.cli.files import Command, InputFile, Words
from armgap.cli.progress import working
from armgap.files.output import is_stdout, write
from armgap.literals import FILTERS, SCHEMES
from armgap.progress import part_callback, use_callback

if TYPE_CHECKING:
    from armgap.arm.arm import Arm
    from armgap.estimation.identification import Identification
    from armgap.literals import Scheme
    from armgap.log.log import Log

__all__ = ["command"]


@click.command("identify", cls=Command)
@click.argument("logs", nargs=-1, required=True, type=InputFile(), metavar="LOG…")
@arm_option
@click.option("--scheme", type=click.Choice([*SCHEMES, "all"]), default="all", show_default=True)
@click.option("--filters", type=click.Choice(FILTERS), default="exact", show_default=True)
@click.option("--cutoff", default=50.0, show_default=True, help="Filter cut-off [rad/s].")
@click.option(
    "--velocity",
    type=click.Choice(["backward", "central", "local-cubic", "sensor", "midpoint"]),
    help="Velocity estimate; backward for the paper's filters, central for the exact ones. midpoint: as online.",
)
@click.option("--asymmetry", is_flag=True, help="Estimate a torque offset per joint (asymmetric Coulomb friction) too.")
@click.option(
    "--fixed",
    type=Words(),
    metavar="NAME,…",
    help="Parameters of a serial arm that keep the arm file's value: mass7, or rotor for all joints.",
)
@corrections_options
@json_option
@columns_option
@units_option
@quiet_option
def command(
    logs: tuple[str, ...],
    arm_file: str,
    scheme: str,
    filters: str,
    cutoff: float,
    velocity: str | None,
    asymmetry: bool,
    fixed: str | None,
    json_file: str | None,
    columns: str | None,
    units: str | None,
    quiet: bool,
    **corrections: Any,
) -> None:
    """Estimate the arm's parameters from LOGs by recursive least squares, with the seed paper's three schemes."""
    import json

    from rich.table import Table

    from armgap.log import gather
    from armgap.log.findings import remarks

    arm = read_arm(arm_file, corrections)
    schemes = [s for s in SCHEMES if scheme in (s, "all")]
    with working("reading", quiet=quiet):
        read = gather(logs, arm, columns=parse_columns(columns), units=parse_units(units))
        settings: dict[str, Any] = {"filters": filters, "cutoff": cutoff, "velocity": velocity, "asymmetry": asymmetry}
        settings["fixed"] = [name.strip() for name in fixed.split(",")] if fixed else []
        results = interruptible(lambda: _identified(read, arm, schemes, settings))
    if json_file is not None:
        write(json_file, json.dumps([r.to_dict() for r in results], indent=2))
    if quiet or is_stdout(json_file):
        return
    noticed = [{"log": log.name, "kind": f.kind, "message": f.message} for log in read for f in log.findings]
    for remark in remarks(noticed):
        console().print(f"note: {remark}", highlight=False, markup=False)
    for log in read:
        mine = [r for r in results if r.log == log.name]
        table = Table(title=f"{log.name}: {filters} filters, {cutoff:g} rad/s")
        table.add_column("parameter")
        table.add_column("arm file", justify="right")
        for r in mine:
            table.add_column(r.scheme, justify="right")
        table.add_column("unit")
        for i, name in enumerate(mine[0].parameter_names):
            nominal = "" if mine[0].nominal[i] != mine[0].nominal[i] else f"{mine[0].nominal[i]:.4g}"
            cells = [f"{r.theta[i]:.4g} ± {r.sigma[i]:.2g}" for r in mine]
            table.add_row(name, nominal, *cells, mine[0].parameter_units[i])
        console().print(table)
        if mine[0].base is not None:
            console().print("Base parameters are sums of the arm's parameters:", highlight=False)
            for text in mine[0].base.texts:
                console().print(f"  {text}", highlight=False, markup=False)
        for r in mine:
            for note in r.notes:
                console().print(f"[bold]{r.scheme}:[/bold] {note}.")


def _identified(
    logs: Sequence[Log], arm: Arm, schemes: Sequence[Scheme], settings: dict[str, Any]
) -> list[Identification]:
    """Return the identification by every scheme on every log."""
    from armgap.estimation.identification import identify

    work = [(log, scheme) for log in logs for scheme in schemes]
    results = []
    for number, (log, scheme) in enumerate(work):
        with use_callback(part_callback("identifying", number, len(work))):
            results.append(identify(log, arm, scheme=scheme, **settings))
    return results
