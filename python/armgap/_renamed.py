"""Names that changed in 0.2.0, and modules that moved: the old ones warn and still work; they go with 0.3.0."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

__all__ = ["MOVED", "RENAMED", "find_moved_modules", "old_names"]

#: Old public name to new public name, each with its module.
RENAMED = {
    "armgap.OwnEffect": "armgap.CustomEffect",
    "armgap.own.OwnEffect": "armgap.diagnosis.custom_effect.CustomEffect",
    "armgap.diagnosis.AtHorizon": "armgap.diagnosis.GapAtHorizon",
    "armgap.diagnosis.Place": "armgap.diagnosis.Location",
    "armgap.evidence.hypothesis.Placed": "armgap.evidence.hypothesis.EffectInstance",
    "armgap.inspection.channels.Joint": "armgap.inspection.channels.JointChannels",
    "armgap.inspection.excitation.Parameter": "armgap.inspection.excitation.ParameterExcitation",
    "armgap.progress.Told": "armgap.progress.ProgressCallback",
    "armgap.progress.following": "armgap.progress.use_callback",
    "armgap.progress.of_many": "armgap.progress.part_callback",
    "armgap.progress.tell": "armgap.progress.report_progress",
    "armgap.report.notebook.Shown": "armgap.report.notebook.NotebookDisplay",
    "armgap.report.page.Heat": "armgap.report.page.HeatMap",
    "armgap.report.page.Track": "armgap.report.page.IntervalLine",
    "armgap.report.words.Answer": "armgap.report.words.SummaryAnswer",
    "armgap.trial.Hidden": "armgap.trial.HiddenEffect",
    "armgap.trial.key.Hidden": "armgap.trial.key.HiddenEffect",
    "armgap.trial.peers.PEERS": "armgap.trial.baselines.BASELINES",
}


#: Old module to new module; modules of a package that moved have moved with it.
MOVED = {
    "armgap.arm_file": "armgap.arm.arm_file",
    "armgap.base_columns": "armgap.estimation.base_columns",
    "armgap.check.corrections": "armgap.arm.corrections",
    "armgap.controller": "armgap.arm.controller",
    "armgap.custom_effect": "armgap.diagnosis.custom_effect",
    "armgap.description": "armgap.arm.description",
    "armgap.drive": "armgap.diagnosis.drive",
    "armgap.drive_chain": "armgap.diagnosis.drive_chain",
    "armgap.estimator": "armgap.estimation.estimator",
    "armgap.fitting": "armgap.estimation.fitting",
    "armgap.free_space": "armgap.arm.free_space",
    "armgap.identification": "armgap.estimation.identification",
    "armgap.model": "armgap.arm.model",
    "armgap.prepared_input": "armgap.diagnosis.prepared_input",
    "armgap.provenance": "armgap.diagnosis.provenance",
    "armgap.reproduction.command": "armgap.cli.reproduce",
    "armgap.rigid_body": "armgap.arm.rigid_body",
    "armgap.serial_arm_file": "armgap.arm.serial_arm_file",
    "armgap.serial_chain": "armgap.arm.serial_chain",
    "armgap.serial_links": "armgap.arm.serial_links",
    "armgap.serial_settings": "armgap.diagnosis.serial_settings",
    "armgap.serial_toml": "armgap.arm.serial_toml",
    "armgap.serial_trust": "armgap.arm.serial_trust",
    "armgap.trial.commands": "armgap.cli.trial_commands",
}


def _now(name: str) -> str | None:
    """The new name of a module that moved by itself or with its package."""
    for old, new in MOVED.items():
        if name == old or name.startswith(f"{old}."):
            return new + name.removeprefix(old)
    return None


def _warn(old: str, new: str, stacklevel: int) -> None:
    warnings.warn(f"{old} is now {new}; the old name goes with 0.3.0", DeprecationWarning, stacklevel=stacklevel + 1)


class _MovedModules(MetaPathFinder, Loader):
    """Finds modules by the names they had."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        return ModuleSpec(fullname, self) if fullname.startswith("armgap.") and _now(fullname) else None

    def exec_module(self, module: ModuleType) -> None:
        old = module.__name__
        new = _now(old)
        assert new is not None
        _warn(old, new, stacklevel=2)
        sys.modules[old] = import_module(new)


def find_moved_modules() -> None:
    """Let modules be imported by the names they had."""
    if not any(isinstance(finder, _MovedModules) for finder in sys.meta_path):
        sys.meta_path.insert(0, _MovedModules())


def old_names(module: str, *, stacklevel: int = 2) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a module some of whose names have changed.

    Parameters
    ----------
    module : str
        Name of the module.
    stacklevel : int, default 2
        Frame that the warning names: 2 is the caller of ``__getattr__`` where this is the returned function itself.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always")
    ...     effect = old_names("armgap")("OwnEffect")
    >>> effect.__name__, str(caught[0].message)
    ('CustomEffect', 'armgap.OwnEffect is now armgap.CustomEffect; the old name goes with 0.3.0')
    """

    def find(name: str) -> Any:
        old = f"{module}.{name}"
        if old in MOVED:
            _warn(old, MOVED[old], stacklevel)
            return import_module(MOVED[old])
        if old not in RENAMED:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        new = RENAMED[old]
        _warn(old, new, stacklevel)
        home, _, changed = new.rpartition(".")
        return getattr(import_module(home), changed)

    return find
