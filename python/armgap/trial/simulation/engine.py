"""Optional packages of blind trials, imported on use: MuJoCo, and pebble for worker processes with a time limit."""

from __future__ import annotations

import importlib
from multiprocessing import get_context
from typing import Any

from armgap.errors import ArmgapError


class TrialEngineMissingError(ArmgapError, ImportError):
    """Error: a package that blind trials need is not installed; diagnosing a log does not need it.

    Parameters
    ----------
    package : str, default "MuJoCo"
        Name of the missing package.
    work : str
        Work that needs the package.
    extra : str
        Optional extra of armgap that installs the package.
    """

    def __init__(self, package: str = "MuJoCo", work: str = "making trial cases", extra: str = "trial") -> None:
        super().__init__(f"{work} needs {package}, which is not installed", remedy=f"pip install 'armgap[{extra}]'")

    def __str__(self) -> str:
        """Return the error as one line of text."""
        return str(self.args[0])


def mujoco() -> Any:
    """Return the ``mujoco`` module.

    Raises
    ------
    TrialEngineMissingError
        MuJoCo cannot be imported.
    """
    try:
        return importlib.import_module("mujoco")
    except ImportError as error:
        raise TrialEngineMissingError from error


def worker_pool(workers: int) -> Any:
    """Return a pool of fresh processes whose tasks can be given a time limit, `pebble.ProcessPool`.

    Raises
    ------
    TrialEngineMissingError
        pebble cannot be imported.
    """
    try:
        pebble = importlib.import_module("pebble")
    except ImportError as error:
        raise TrialEngineMissingError("pebble", "answering cases") from error
    return pebble.ProcessPool(max_workers=workers, context=get_context("spawn"))
