"""Sub-command ``armgap model``: arm file from a URDF or MJCF model."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from armgap.arm.serial.trust import TRUSTS
from armgap.cli.common import console, freeze_option, frozen_positions, quiet_option
from armgap.cli.files import Command, InputFile, OutputFile, Words
from armgap.files.output import is_stdout, write

if TYPE_CHECKING:
    from rich.table import Table

    from armgap.arm.serial.chain import SerialChain

__all__ = ["command"]


@click.command("model", cls=Command)
@click.argument("description", type=InputFile(), metavar="FILE.urdf|FILE.xml")
@click.option("--base", type=Words(), metavar="LINK", help="First link, which stands still; the root by default.")
@click.option("--tip", type=Words(), metavar="LINK", help="Last link; needed where several branches move.")
@click.option(
    "--trust",
    type=click.Choice(list(TRUSTS)),
    default="cad",
    show_default=True,
    help="How far masses and inertias are trusted: to 10 %, 30 %, 100 %, or not at all.",
)
@freeze_option
@click.option("--name", type=Words(), help="Name of the arm; the description's by default.")
@click.option("--sample-period", default=0.002, show_default=True, help="Sample period of the logs [s].")
@click.option(
    "-o", "--output", type=OutputFile(), required=True, metavar="ARM.toml", help="Arm file to write; - is stdout."
)
@quiet_option
def command(
    description: str,
    base: str | None,
    tip: str | None,
    trust: str,
    freeze: tuple[str, ...],
    name: str | None,
    sample_period: float,
    output: str,
    quiet: bool,
) -> None:
    """Make an arm file of a URDF or MJCF model: the chain of moving joints from base to tip, with all that hangs on it."""
    from armgap.arm.model import read_model

    arm = read_model(
        description,
        base=base,
        tip=tip,
        frozen=frozen_positions(freeze),
        trust=trust,
        name=name,
        sample_period=sample_period,
    )
    write(output, arm.to_toml())
    if not (quiet or is_stdout(output)):
        assert arm.chain is not None
        say = console()
        say.print(_table(arm.chain, [float(m) for m in arm.theta[: 10 * arm.n_joints : 10]]))
        for note in arm.notes:
            say.print(f"note: {note}", highlight=False, markup=False)
        say.print(f"arm file: {output}", highlight=False, markup=False)


def _table(chain: SerialChain, masses: list[float]) -> Table:
    """Return a table of the chain's joints for the terminal, one row per joint."""
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("", "joint", "kind", "link"):
        table.add_column(heading)
    for heading in ("mass [kg]", "position", "speed", "torque"):
        table.add_column(heading, justify="right")
    for j, joint in enumerate(chain.joint_names):
        angle, force = ("rad", "N m") if chain.rotary[j] else ("m", "N")
        low, high = float(chain.lower[j]), float(chain.upper[j])
        span = "" if math.isinf(low) and math.isinf(high) else f"{low:.4g} to {high:.4g} {angle}"
        table.add_row(
            str(j + 1),
            escape(joint),
            chain.kinds[j],
            escape(chain.link_names[j]),
            f"{masses[j]:.4g}" if masses[j] else "unknown",
            span,
            _limit(float(chain.speed[j]), f"{angle}/s"),
            _limit(float(chain.effort[j]), force),
        )
    return table


def _limit(value: float, unit: str) -> str:
    return f"{value:.4g} {unit}" if math.isfinite(value) else ""
