"""Layout of the folder of a trial."""

from __future__ import annotations

from pathlib import Path

__all__ = ["ANSWERS", "ARM_FILE", "MANIFEST", "MOST_CASES", "belongs", "case_folders_in", "case_name"]

MANIFEST = "trial.json"
ANSWERS = "answers"
ARM_FILE = "arm.toml"
#: Largest number of cases of a trial.
MOST_CASES = 100_000
_CASE = "case-"


def case_name(number: int) -> str:
    """Return the name of the folder of case `number`, counted from 0."""
    return f"{_CASE}{number:04d}"


def case_folders_in(folder: Path) -> list[Path]:
    """Return the case folders in a trial's folder, sorted by name, without unfinished ones, whose names begin with a dot."""
    return sorted(p.parent for p in folder.glob(f"*/{ARM_FILE}") if not p.parent.name.startswith("."))


def belongs(entry: Path) -> bool:
    """Return whether a file or folder in a trial's folder is part of the trial; other files there may be pages of scores."""
    return entry.name in (MANIFEST, ANSWERS) or entry.name.startswith(_CASE) or (entry / ARM_FILE).exists()
