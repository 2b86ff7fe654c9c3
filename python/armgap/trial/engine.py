"""MuJoCo, loaded only when a case is made."""

from __future__ import annotations

import importlib
from typing import Any

from armgap.errors import ArmgapError


class TrialEngineMissingError(ArmgapError, ImportError):
    """MuJoCo is not installed; blind trials need it, diagnosing a log does not."""

    def __init__(self) -> None:
        super().__init__(
            "making trial cases needs MuJoCo, which is not installed", remedy="pip install 'armgap[trial]'"
        )

    def __str__(self) -> str:
        """Return the one-line text."""
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
