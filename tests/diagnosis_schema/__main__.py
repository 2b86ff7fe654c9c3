"""Make cases, diagnose them, compare the JSON with its schema: ``python -m tests.diagnosis_schema --help``."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import click

#: Environment variables that set the number of threads of a process.
THREADS = ("RAYON_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS")


def planar(seed: int, cases: int) -> Iterator[tuple[str, str]]:
    """Yield name and JSON text of the diagnoses of planar arms."""
    from armgap import diagnose
    from armgap.trial.cases.making import make_cases
    from armgap.trial.cases.sealed import SealedCase

    with TemporaryDirectory() as folder:
        for place in make_cases(Path(folder) / "cases", seed, cases, duration=6.0):
            case = SealedCase.read(place)
            yield f"planar {case.name}", diagnose(case.training, case.arm, holdout=case.holdout).to_json()


def serial(seed: int, cases: int) -> Iterator[tuple[str, str]]:
    """Yield name and JSON text of the diagnoses of serial arms, every other one behind position controllers."""
    from armgap import diagnose

    from ..serial_trial.case import make_case

    for number in range(cases):
        case = make_case(seed, number, commanded=number % 2 == 1)
        yield f"serial {number}", diagnose(case.training, case.arm, holdout=case.holdout).to_json()


@click.command(name="python -m tests.diagnosis_schema", context_settings={"show_default": True})
@click.option("--seed", type=click.IntRange(0), required=True, help="Seed of all cases.")
@click.option("--cases", type=click.IntRange(1), default=40, help="Cases; one in four is a serial arm.")
def main(seed: int, cases: int) -> None:
    """Compare diagnoses of planar and serial arms with the JSON Schema, and check that reading and writing leaves each unchanged."""
    os.environ.update(dict.fromkeys(THREADS, "1"))
    from .checking import losses, misfits

    failed = count = 0
    for made in (planar(seed, cases - cases // 4), serial(seed, cases // 4)):
        for name, text in made:
            problems = [*misfits(json.loads(text)), *losses(text)]
            count, failed = count + 1, failed + bool(problems)
            for line in problems[:10]:
                click.echo(f"{name}: {line}")
    click.echo(f"{count} diagnoses, {count - failed} of them as the schema says and the same after reading and writing")
    raise SystemExit(1 if failed else 0)


if __name__ == "__main__":
    main()
