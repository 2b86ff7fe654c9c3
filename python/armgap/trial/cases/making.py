"""Making of a trial on disk: numbered case folders, and a manifest that does not reveal the hidden effects.

An interrupted trial can be resumed: a case folder appears only when it is complete, and existing case folders are kept.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from armgap import _native
from armgap.errors import OptionError, ResultError
from armgap.files.output import write, write_folder
from armgap.trial.cases.key import sealed_hash
from armgap.trial.cases.layout import MANIFEST, case_name
from armgap.trial.simulation.engine import mujoco
from armgap.trial.trial import Plan, plan_trial

__all__ = ["MANIFEST", "Manifest", "make_cases", "read_manifest", "seal_of_all"]

SCHEMA = "armgap.trial-cases/1"


@dataclass(frozen=True)
class Manifest:
    """Settings with which a trial was made, sufficient to make it again with equal versions.

    Attributes
    ----------
    seed, cases : int
        Seed of the trial and number of its cases.
    duration : float
        Length of each log [s].
    version, engine : str
        Versions of armgap and of the physics engine.
    """

    seed: int
    cases: int
    duration: float
    version: str
    engine: str

    def to_json(self) -> str:
        """Return the manifest as JSON."""
        return json.dumps({"schema": SCHEMA, **self.__dict__}, indent=1) + "\n"


def make_cases(folder: Path, seed: int, cases: int, duration: float = 10.0, workers: int = 1) -> Iterator[Path]:
    """Make the missing cases of a trial.

    Parameters
    ----------
    folder : Path
        Folder of the trial: new, empty, or with cases of this trial.
    seed, cases : int
        Seed and number of cases.
    duration : float, default 10
        Length of each log [s].
    workers : int, default 1
        Number of processes.

    Yields
    ------
    Path
        Every case's folder, in order.

    Raises
    ------
    OptionError
        The folder holds other files.
    """
    wanted = Manifest(seed, cases, duration, _native.__version__, f"mujoco {mujoco().__version__}")
    _claim(folder, wanted)
    plans = [replace(p, duration=duration) for p in plan_trial(seed, cases)]
    targets = [folder / case_name(i) for i in range(cases)]
    if workers == 1:
        yield from map(_make, plans, targets)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield from pool.map(_make, plans, targets)


def read_manifest(folder: str | Path) -> Manifest | None:
    """Return the manifest of a folder of cases; None if it has none."""
    path = Path(folder) / MANIFEST
    if not path.is_file():
        return None
    data = _load(path)
    try:
        return Manifest(**{key: value for key, value in data.items() if key != "schema"})
    except TypeError:
        raise OptionError("is no list of a trial's cases", remedy="make the trial again", file=path) from None


def seal_of_all(cases: list[Path]) -> str:
    """Return one SHA-256 over the seals of all cases of a trial."""
    return hashlib.sha256("".join(sealed_hash(c) for c in cases).encode()).hexdigest()


def _claim(folder: Path, wanted: Manifest) -> None:
    """Write the manifest to a new or empty folder, or check that the folder's manifest is equal."""
    path = folder / MANIFEST
    if path.is_file():
        if _load(path) != json.loads(wanted.to_json()):
            raise OptionError("holds another trial", remedy="name a new folder", file=folder)
        return
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise OptionError("exists and is not empty", remedy="name a new folder", file=folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultError(f"cannot be made ({error.strerror})", remedy="choose another place", file=folder) from None
    write(path, wanted.to_json())


def _load(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise OptionError(f"cannot be read ({error})", remedy="name a new folder", file=path) from None
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise OptionError("is no list of a trial's cases", remedy="name a new folder", file=path)
    return data


def _make(plan: Plan, target: Path) -> Path:
    if not target.exists():
        case = plan.make()
        try:
            write_folder(target, case.write)
        except ResultError:
            if not target.is_dir():  # otherwise another process has made the same case meanwhile
                raise
    return target
