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
    """Return the name of a case's folder, by number."""
    return f"{_CASE}{number:04d}"


def case_folders_in(folder: Path) -> list[Path]:
    """Return the folders of the cases of a trial, in order; unfinished ones have hidden names and are left out."""
    return sorted(p.parent for p in folder.glob(f"*/{ARM_FILE}") if not p.parent.name.startswith("."))


def belongs(entry: Path) -> bool:
    """Whether an entry of a trial's folder belongs to the trial; pages of scores may lie beside these."""
    return entry.name in (MANIFEST, ANSWERS) or entry.name.startswith(_CASE) or (entry / ARM_FILE).exists()
