"""Ways in which an entry of a fleet is broken. Each takes copies of the entry's arm file and log, and spoils them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import polars as pl

#: Given the arm file and the training log, both to be overwritten or removed.
Way = Callable[[Path, Path], None]


def no_log(arm: Path, log: Path) -> None:
    """The log is not there."""
    log.unlink()


def no_arm(arm: Path, log: Path) -> None:
    """The arm file is not there."""
    arm.unlink()


def empty_log(arm: Path, log: Path) -> None:
    """The log holds nothing."""
    log.write_bytes(b"")


def cut_log(arm: Path, log: Path) -> None:
    """The log was cut off while it was copied."""
    log.write_bytes(log.read_bytes()[: log.stat().st_size // 2])


def no_torque(arm: Path, log: Path) -> None:
    """A column that is needed is missing."""
    _rewrite(log, lambda table: table.drop("tau1"))


def few_rows(arm: Path, log: Path) -> None:
    """The robot was stopped at once."""
    _rewrite(log, lambda table: table.head(5))


def backwards(arm: Path, log: Path) -> None:
    """Time runs backwards."""
    _rewrite(log, lambda table: table.with_columns(t=-pl.col("t")))


def no_positions(arm: Path, log: Path) -> None:
    """The encoder was not connected."""
    _rewrite(log, lambda table: table.with_columns(q1=pl.lit(None, pl.Float64)))


def no_toml(arm: Path, log: Path) -> None:
    """The arm file is no TOML."""
    arm.write_text(arm.read_text(encoding="utf-8").replace("=", ":", 1), encoding="utf-8")


def unknown_kind(arm: Path, log: Path) -> None:
    """The arm file names a kind of arm that there is not."""
    lines = [
        ('kind = "delta"' if line.startswith("kind") else line) for line in arm.read_text(encoding="utf-8").splitlines()
    ]
    arm.write_text("\n".join(lines) + "\n", encoding="utf-8")


WAYS: tuple[Way, ...] = (
    no_log, no_arm, empty_log, cut_log, no_torque, few_rows, backwards, no_positions, no_toml, unknown_kind,
)  # fmt: skip


def _rewrite(log: Path, change: Callable[[pl.DataFrame], pl.DataFrame]) -> None:
    change(pl.read_parquet(log)).write_parquet(log)
