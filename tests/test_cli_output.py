"""The command line: options with many values, and results that are written whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path

import click
import numpy as np
import polars as pl
import pytest

from armgap import Log
from armgap.cli.common import ManyValues
from armgap.errors import ResultError
from armgap.files.output import write


@click.command(cls=ManyValues)
@click.argument("logs", nargs=-1)
@click.option("--holdout", multiple=True)
@click.option("--arm")
@click.option("--quiet", is_flag=True)
def command(logs, holdout, arm, quiet):
    click.echo(json.dumps([logs, holdout, arm, quiet]))


@pytest.mark.parametrize(
    ("words", "logs", "holdout"),
    [
        ("a b --holdout c d --arm x", ["a", "b"], ["c", "d"]),
        ("a --holdout c --holdout d --arm x", ["a"], ["c", "d"]),
        ("--arm x a b --holdout c d --quiet", ["a", "b"], ["c", "d"]),
        ("--holdout c d --arm x a b", ["a", "b"], ["c", "d"]),
        ("--arm x --holdout c d -- a", ["a"], ["c", "d"]),
        ("a --arm x --holdout=c --holdout d -", ["a"], ["c", "d", "-"]),
        ("a --arm x", ["a"], []),
    ],
)
def test_holdout_takes_every_log_up_to_the_next_option(words, logs, holdout, capsys):
    command.main(args=words.split(), standalone_mode=False)
    assert json.loads(capsys.readouterr().out)[:3] == [logs, holdout, "x"]


def test_simulated_logs_are_the_same_in_every_format(run, arm_file, tmp_path):
    common = ["simulate", "--arm", arm_file, "--torque", "seed", "--duration", "0.5", "--quiet"]
    for name in ("o.parquet", "o.csv"):
        assert run(*common, "-o", tmp_path / name) == (0, "", "")
    status, out, err = run(*common, "-o", "-")
    assert (status, err) == (0, "")
    assert out == (tmp_path / "o.csv").read_text()
    table = pl.read_parquet(tmp_path / "o.parquet")
    assert table.shape == (200, 5)
    assert table.equals(pl.read_csv(tmp_path / "o.csv"))


def test_a_log_simulated_again_is_the_same(run, arm_file, seed_log, tmp_path):
    """With velocities in the log the start is known exactly, so its torques give its positions again."""
    seed_log.write(tmp_path / "first.parquet")
    run("simulate", "--arm", arm_file, "--torque", tmp_path / "first.parquet", "-o", tmp_path / "again.parquet")
    np.testing.assert_array_equal(Log.read(tmp_path / "again.parquet").q, seed_log.q)


def test_results_replace_what_was_there_or_leave_it(tmp_path):
    target = tmp_path / "out.json"
    write(target, "first")
    write(target, "second")
    assert target.read_text() == "second"

    def breaks(path: Path) -> None:
        path.write_text("half of i")
        raise OSError(28, "No space left on device")

    with pytest.raises(ResultError, match="No space left"):
        write(target, breaks)
    assert target.read_text() == "second"
    assert list(tmp_path.iterdir()) == [target]


def test_a_log_that_cannot_be_written_leaves_nothing(seed_log, tmp_path):
    (tmp_path / "taken.parquet").mkdir()
    with pytest.raises(ResultError, match=r"taken\.parquet"):
        seed_log.write(tmp_path / "taken.parquet")
    assert [p.name for p in tmp_path.iterdir()] == ["taken.parquet"]
