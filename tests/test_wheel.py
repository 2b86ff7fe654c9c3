"""What makes importing fast and the wheel complete; `make wheel-check` installs one and measures."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import armgap

HEAVY = ("bokeh", "jinja2", "mujoco", "numpy", "polars", "rich")


@pytest.mark.parametrize(
    ("statement", "allowed"),
    [
        ("import armgap", ()),
        ("import armgap.cli", ()),
        ("import armgap.report", ()),
        ("from armgap import Arm", ("numpy",)),
        ("from armgap import diagnose, identify, simulate, correct", ("numpy", "polars")),
        ("import armgap.cli.diagnosis_commands.diagnose", ("rich",)),
        ("import armgap.cli.model_commands.export", ("rich",)),
        ("import armgap.cli.demo", ("rich",)),
    ],
)
def test_importing_loads_only_what_is_needed(statement: str, allowed: tuple[str, ...]) -> None:
    code = f"import sys; {statement}; print(*(m for m in {HEAVY} if m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) <= set(allowed)


def test_the_sample_case_is_in_the_package() -> None:
    from armgap.cli.demo import CASE_FOLDER

    assert CASE_FOLDER.is_relative_to(Path(armgap.__file__).parent)
    assert {p.name for p in CASE_FOLDER.iterdir()} >= {"arm.toml", "key.json", "train-1.parquet", "holdout-1.parquet"}
