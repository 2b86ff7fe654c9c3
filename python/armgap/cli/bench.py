"""Sub-command ``armgap bench``: cost of the online estimator per sample."""

from __future__ import annotations

import json
import platform
from typing import Any

import click

from armgap.cli.common import console, interruptible, json_option, quiet_option
from armgap.cli.files import Command
from armgap.cli.numbers import Number
from armgap.cli.progress import working
from armgap.files.output import is_stdout, write
from armgap.literals import SCHEMES
from armgap.progress import report_progress

__all__ = ["command", "measure"]

FIELDS = ("typical_ns", "median_ns", "p99_ns", "p9999_ns", "max_ns")
SCHEMA = "armgap.bench/1"


@click.command("bench", cls=Command)
@click.option("--samples", type=click.IntRange(1000, 100_000_000), default=1_000_000, show_default=True)
@click.option("--period", type=Number(1e-6, 10.0), default=0.0025, show_default=True, help="Sample period [s].")
@click.option("--all", "everything", is_flag=True, help="The form of the covariance that is not the default too.")
@json_option
@quiet_option
def command(samples: int, period: float, everything: bool, json_file: str | None, quiet: bool) -> None:
    """Cost of one sample of the online estimator on this machine, against the sample period."""
    with working("measuring", quiet=quiet):
        result = interruptible(lambda: measure(samples, period, everything=everything))
    if json_file is not None:
        write(json_file, json.dumps(result, indent=2))
    if not (quiet or is_stdout(json_file)):
        _show(result)


def measure(samples: int, period: float, *, everything: bool = False) -> dict[str, Any]:
    """Measure the online estimator for every scheme, filter pair, precision and, with `everything`, form of the covariance."""
    from armgap import _native

    noise = dict(zip(FIELDS, _native.bench(None, False, False, False, samples), strict=True))
    rows: list[dict[str, Any]] = []
    count = len(SCHEMES) * 2 * (4 if everything else 2)
    for scheme in SCHEMES:
        for filters in ("paper", "exact"):
            for single in (False, True):
                report_progress("measuring", len(rows) / count)
                for plain in (True, False) if everything else (not single,):
                    times = _native.bench(scheme, filters == "paper", plain, single, samples)
                    row: dict[str, Any] = {
                        "scheme": scheme,
                        "filters": filters,
                        "precision": "single" if single else "double",
                        "form": "plain" if plain else "factorized",
                    }
                    row |= dict(zip(FIELDS, times, strict=True))
                    row["periods_per_sample"] = period * 1e9 / row["typical_ns"]
                    rows.append(row)
    return {
        "schema": SCHEMA,
        "samples": samples,
        "period_s": period,
        "machine": f"{platform.machine()} {platform.system()}",
        "noise": noise,
        "rows": rows,
    }


def _show(result: dict[str, Any]) -> None:
    from rich.table import Table

    period = result["period_s"]
    table = Table(title=f"one sample of the two-link arm, {result['samples']:,} samples, period {period * 1e3:g} ms")
    for name in ("scheme", "filters", "precision", "form"):
        table.add_column(name, no_wrap=True)
    for name in ("typical", "median", "99 %", "99.99 %", "max", "per period"):
        table.add_column(name, justify="right")
    for row in result["rows"]:
        cells = [_time(row[field]) for field in FIELDS]
        names = [row[name] for name in ("scheme", "filters", "precision", "form")]
        table.add_row(*names, *cells, f"{row['periods_per_sample']:,.0f}")
    table.add_section()
    table.add_row("noise", "", "", "fixed work", *(_time(result["noise"][field]) for field in FIELDS), "")
    console().print(table)
    console().print(
        "typical: median over whole runs; then single calls, less the clock; per period: how many typical samples one period holds.\n"
        "The last row is the same for fixed arithmetic: as much of a maximum as it shows belongs to the machine.",
        highlight=False,
    )


def _time(nanoseconds: float) -> str:
    if nanoseconds < 1e4:
        return f"{nanoseconds:.0f} ns"
    return f"{nanoseconds / 1e3:.0f} us" if nanoseconds < 1e6 else f"{nanoseconds / 1e6:.1f} ms"
