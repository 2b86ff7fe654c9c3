"""A case as a method under trial sees it: arm file and logs, never the key."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from armgap.arm.arm import Arm
from armgap.errors import OptionError
from armgap.log.log import Log
from armgap.trial.cases.layout import ARM_FILE, case_folders_in

__all__ = ["SealedCase", "case_folders"]


@dataclass(frozen=True)
class SealedCase:
    """Case of a trial without its key: arm, training logs, and holdout logs.

    Attributes
    ----------
    name : str
        Name of the case's folder.
    arm : Arm
        Arm as in the arm file.
    training, holdout : tuple of Log
        Training and holdout logs, at least one each.
    """

    name: str
    arm: Arm
    training: tuple[Log, ...]
    holdout: tuple[Log, ...]

    @classmethod
    def read(cls, folder: str | Path) -> SealedCase:
        """Read arm file and logs of a case folder, but not its key.

        Raises
        ------
        ArmgapError
            A file is missing or cannot be used.
        """
        target = Path(folder)
        arm = Arm.read(target / ARM_FILE)
        training, holdout = (_logs(target, part, arm) for part in ("train", "holdout"))
        return cls(target.name, arm, training, holdout)


def case_folders(folder: str | Path) -> list[Path]:
    """Return the folders of the cases of a trial, in order.

    Raises
    ------
    OptionError
        The folder holds no cases.
    """
    found = case_folders_in(Path(folder))
    if not found:
        raise OptionError("holds no cases", remedy="make some with armgap trial make -o DIR", file=folder)
    return found


def _logs(folder: Path, part: str, arm: Arm) -> tuple[Log, ...]:
    paths = sorted(folder.glob(f"{part}-*.parquet"))
    if not paths:
        raise OptionError(f"holds no {part}-*.parquet", remedy="make the case again", file=folder)
    return tuple(Log.read(path, arm=arm) for path in paths)
