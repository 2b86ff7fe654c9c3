"""Manifest of a fleet made from cases of a blind trial, some of whose entries are broken."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import numpy as np
import polars as pl

from .broken import WAYS

ARM, LOGS = "arm.toml", ("train-1.parquet", "holdout-1.parquet")
DAYS = ("2026-01-05", "2026-01-06")


def write_entries(cases: Path, broken: int, seconds: float, folder: Path) -> Path:
    """Write the manifest of two entries per case with the first `seconds` of its logs; `broken` entries are damaged, by all `WAYS` in turn."""
    folder.mkdir(parents=True, exist_ok=True)
    entries = []
    for case in sorted(p for p in cases.iterdir() if (p / ARM).is_file()):
        own = (folder / case.name).resolve()
        own.mkdir(exist_ok=True)
        shutil.copyfile(case / ARM, own / ARM)
        for log in LOGS:
            pl.scan_parquet(case / log).filter(pl.col("t") < seconds).collect().write_parquet(own / log)
        for day, (trained, held) in zip(DAYS, (LOGS, LOGS[::-1]), strict=True):
            entries.append((case.name, str(own / ARM), str(own / trained), str(own / held), day))
    spoilt = np.random.default_rng(len(entries)).choice(len(entries), broken, replace=False)
    for number, place in enumerate(spoilt):
        way = WAYS[number % len(WAYS)]
        robot, arm, log, held, day = entries[place]
        own = (folder / f"broken-{number:02d}-{way.__name__}").resolve()
        own.mkdir(exist_ok=True)
        copies = own / ARM, own / Path(log).name
        for original, copy in zip((arm, log), copies, strict=True):
            shutil.copyfile(original, copy)
        way(*copies)
        entries[place] = robot, str(copies[0]), str(copies[1]), held, day
    manifest = folder / "manifest.csv"
    with manifest.open("w", newline="", encoding="utf-8") as text:
        csv.writer(text).writerows([("robot", "arm", "logs", "holdout", "time"), *entries])
    return manifest
