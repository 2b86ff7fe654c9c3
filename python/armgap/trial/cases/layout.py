"""Where things lie in the folder of a trial."""

from __future__ import annotations

from pathlib import Path

__all__ = ["ANSWERS", "ARM_FILE", "MANIFEST", "MOST_CASES", "belongs", "case_folders_in", "case_name"]

MANIFEST = "trial.json"
ANSWERS = "answers"
ARM_FILE = "arm.toml"
#: Cases of a trial at most.
MOST_CASES = 100_000
_CASE = "case-"


def case_name(number: int) -> str:
    """Name of a case's folder."""
    return f"{_CASE}{number:04d}"


def case_folders_in(folder: Path) -> list[Path]:
    """Folders of the cases of a trial, in order; those that are being made have hidden names."""
    return sorted(p.parent for p in folder.glob(f"*/{ARM_FILE}") if not p.parent.name.startswith("."))


def belongs(entry: Path) -> bool:
    """Whether an entry of a trial's folder is one of the trial's own; pages of scores may lie beside them."""
    return entry.name in (MANIFEST, ANSWERS) or entry.name.startswith(_CASE) or (entry / ARM_FILE).exists()
