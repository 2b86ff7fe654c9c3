"""Ways in which an entry of a fleet is broken: functions that damage copies of the entry's arm file and log."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import polars as pl

#: Function of the paths of an arm file and a training log, which overwrites or removes one of them.
Way = Callable[[Path, Path], None]


def no_log(arm: Path, log: Path) -> None:
    """Remove the log."""
    log.unlink()


def no_arm(arm: Path, log: Path) -> None:
    """Remove the arm file."""
    arm.unlink()


def empty_log(arm: Path, log: Path) -> None:
    """Make the log an empty file."""
    log.write_bytes(b"")


def cut_log(arm: Path, log: Path) -> None:
    """Cut the log file off, as an interrupted copy does."""
    log.write_bytes(log.read_bytes()[: log.stat().st_size // 2])


def no_torque(arm: Path, log: Path) -> None:
    """Remove the torque column of joint 1."""
    _rewrite(log, lambda table: table.drop("tau1"))


def few_rows(arm: Path, log: Path) -> None:
    """Keep only the first five rows of the log, as of a robot that was stopped at once."""
    _rewrite(log, lambda table: table.head(5))


def backwards(arm: Path, log: Path) -> None:
    """Negate the time stamps of the log, so that time runs backwards."""
    _rewrite(log, lambda table: table.with_columns(t=-pl.col("t")))


def no_positions(arm: Path, log: Path) -> None:
    """Replace the positions of joint 1 by missing values, as of an encoder that was not connected."""
    _rewrite(log, lambda table: table.with_columns(q1=pl.lit(None, pl.Float64)))


def no_toml(arm: Path, log: Path) -> None:
    """Make the arm file invalid TOML."""
    arm.write_text(arm.read_text(encoding="utf-8").replace("=", ":", 1), encoding="utf-8")


def unknown_kind(arm: Path, log: Path) -> None:
    """Replace the kind of arm in the arm file by an unknown one."""
    lines = [
        ('kind = "delta"' if line.startswith("kind") else line) for line in arm.read_text(encoding="utf-8").splitlines()
    ]
    arm.write_text("\n".join(lines) + "\n", encoding="utf-8")


WAYS: tuple[Way, ...] = (
    no_log, no_arm, empty_log, cut_log, no_torque, few_rows, backwards, no_positions, no_toml, unknown_kind,
)  # fmt: skip


def _rewrite(log: Path, change: Callable[[pl.DataFrame], pl.DataFrame]) -> None:
    change(pl.read_parquet(log)).write_parquet(log)
