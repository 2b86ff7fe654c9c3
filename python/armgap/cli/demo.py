"""Sub-command ``armgap demo``: diagnosis of a sample log, checked against its sealed key, or of the user's own logs."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from armgap.cli.common import (
    ManyValues,
    columns_option,
    console,
    json_option,
    parse_columns,
    parse_units,
    quiet_option,
    units_option,
)
from armgap.cli.files import InputFile, InputFolder, OutputFile
from armgap.cli.numbers import Seed
from armgap.cli.progress import working
from armgap.errors import OptionError
from armgap.files.output import is_stdout, write

if TYPE_CHECKING:
    from armgap.diagnosis.result import Diagnosis
    from armgap.trial.cases.key import Key

__all__ = ["command"]

REPORT = "armgap-demo.html"
_NEXT = "your own logs: armgap inspect LOG, then armgap diagnose LOG --arm ARM.toml --report OUT.html"
PACKAGE = Path(__file__).resolve().parents[1]
#: Folder of the sample case that is part of the package.
CASE_FOLDER = PACKAGE / "demo_case"


@click.command("demo", cls=ManyValues, reads=(CASE_FOLDER,))
@click.argument("logs", nargs=-1, type=InputFile(), metavar="[LOG…]")
@click.option("--arm", "arm_file", type=InputFile(), metavar="ARM.toml", help="Arm file, for logs of your own.")
@click.option("--holdout", multiple=True, type=InputFile(), metavar="LOG…", help="Logs of your own to judge on.")
@click.option("--case", "case_folder", type=InputFolder(), metavar="DIR", help="Folder of another sealed case.")
@click.option("--fresh", type=Seed(), metavar="SEED", help="Make a new sealed case (needs MuJoCo).")
@click.option(
    "--report",
    "report_file",
    type=OutputFile(),
    default=REPORT,
    show_default=True,
    metavar="OUT",
    help="Report to write: .html, .md or .json.",
)
@json_option
@columns_option
@units_option
@quiet_option
def command(
    logs: tuple[str, ...],
    arm_file: str | None,
    holdout: tuple[str, ...],
    case_folder: Path | None,
    fresh: int | None,
    report_file: str,
    json_file: str | None,
    columns: str | None,
    units: str | None,
    quiet: bool,
) -> None:
    """Diagnose a sample log whose hidden cause is sealed, then open the key; or diagnose LOGs of your own."""
    from armgap.report.output import check_report

    check_report(report_file)
    outputs = (report_file, json_file, quiet)
    if logs or arm_file or holdout:
        if case_folder is not None or fresh is not None:
            raise OptionError("a case and logs of your own were given", remedy="give one of the two")
        _own_logs(logs, arm_file, holdout, {"columns": parse_columns(columns), "units": parse_units(units)}, outputs)
        return
    with _case(case_folder, fresh, quiet=quiet) as folder:
        _sealed_case(folder, outputs)


def _own_logs(
    logs: tuple[str, ...],
    arm_file: str | None,
    holdout: tuple[str, ...],
    naming: dict[str, Any],
    outputs: tuple[str, str | None, bool],
) -> None:
    if not logs or arm_file is None:
        missing = "no log" if not logs else "no arm file"
        raise OptionError(f"{missing} was given", remedy="write armgap demo LOG… --arm ARM.toml [--holdout LOG…]")
    _diagnose([Path(p) for p in logs], Path(arm_file), [Path(p) for p in holdout], naming, outputs)


def _sealed_case(folder: Path, outputs: tuple[str, str | None, bool]) -> None:
    from armgap.trial.cases.key import check_seal, open_key

    say = _voice(outputs)
    seal = check_seal(folder)
    say.print(f"what is hidden in these logs is sealed: the key's sha256 is {seal[:16]}…", highlight=False)
    training, held = (sorted(folder.glob(f"{part}-*.parquet")) for part in ("train", "holdout"))
    if not training:
        raise OptionError("holds no train-*.parquet", remedy="give the folder of a sealed case", file=folder)
    result = _diagnose(training, folder / "arm.toml", held, {}, outputs)
    say.print(_opened(open_key(folder), result), highlight=False)
    say.print(_NEXT, highlight=False, markup=False)


def _diagnose(
    logs: list[Path],
    arm_file: Path,
    holdout: list[Path],
    naming: dict[str, Any],
    outputs: tuple[str, str | None, bool],
) -> Diagnosis:
    from armgap.arm.arm import Arm
    from armgap.diagnosis.diagnosis import diagnose
    from armgap.log import gather
    from armgap.report.forms.terminal import summary_table
    from armgap.report.output import diagnosis_report

    report_file, json_file, quiet = outputs
    arm = Arm.read(arm_file)
    with working("reading", quiet=quiet):
        training, held = (gather(paths, arm, **naming) for paths in (logs, holdout))
        result = diagnose(training, arm, holdout=held or None)
    write(report_file, diagnosis_report(result, report_file))
    if json_file is not None:
        write(json_file, result.to_json(indent=2))
    say = _voice(outputs)
    say.print(summary_table(result))
    for remark in result.remarks:
        say.print(f"note: {remark}", highlight=False, markup=False)
    hint = " (open it in a browser)" if str(report_file).endswith(".html") else ""
    say.print(f"report: {report_file}{hint}", highlight=False, markup=False)
    return result


def _voice(outputs: tuple[str, str | None, bool]) -> Any:
    """Return the console for the summary, silent if standard output is not for the summary."""
    say = console()
    say.quiet = outputs[2] or is_stdout(*outputs[:2])
    return say


@contextmanager
def _case(folder: Path | None, fresh: int | None, *, quiet: bool) -> Iterator[Path]:
    """Yield the case folder that the user named, or a newly made one, which is deleted when the command ends."""
    if fresh is None:
        yield folder if folder is not None else CASE_FOLDER
        return
    if folder is not None:
        raise OptionError("--case and --fresh were both given", remedy="give one of the two")
    from armgap.trial.cases.demo import make_demo_case

    with tempfile.TemporaryDirectory(prefix="armgap-demo-") as scratch:
        with working(f"making the case of seed {fresh}", quiet=quiet):
            made = make_demo_case(fresh).write(scratch)
        yield Path(made)


def _opened(key: Key, result: Diagnosis) -> str:
    """Return the effect that was hidden in the sample logs, in words, and whether the diagnosis names it."""
    from armgap.trial.verdict import judge

    hidden = [f"{_name(h.effect, h.joint)} ({_values(h.parameters)})" for h in key.effects]
    named = [_name(c.effect, c.joint) for c in result.causes]
    judgement = judge(result, key)
    verdict = "[bold green]right[/]" if judgement.right else "[bold red]wrong[/]"
    lines = [
        f"key opened, its hash is the sealed one: {', '.join(hidden) or 'nothing is hidden'}",
        f"the answer was {verdict}: {named[0] if named else 'no cause named'}",
    ]
    if judgement.right and not judgement.exact:
        lines[-1] += "; no log of motion tells the two apart"
    if judgement.right and judgement.extra:
        lines.append(f"beside it, causes named that are not there: {judgement.extra}")
    return "\n".join(lines)


def _name(effect: str, joint: int | None) -> str:
    return f"{effect} of " + ("the whole arm" if joint is None else f"joint {joint}")


def _values(parameters: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.4g}" for name, value in parameters.items())
