"""Public names and modules that were renamed in armgap 0.2.0: the old names work with a `DeprecationWarning` until 0.3.0."""

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

#: New name of each renamed public object, by its old name; both names include the module.
RENAMED = {
    "armgap.OwnEffect": "armgap.CustomEffect",
    "armgap.diagnosis.AtHorizon": "armgap.diagnosis.GapAtHorizon",
    "armgap.diagnosis.Place": "armgap.diagnosis.Location",
    "armgap.evidence.hypothesis.Placed": "armgap.evidence.hypothesis.EffectInstance",
    "armgap.inspection.channels.Joint": "armgap.inspection.channels.JointChannels",
    "armgap.inspection.excitation.Parameter": "armgap.inspection.excitation.ParameterExcitation",
    "armgap.own.OwnEffect": "armgap.diagnosis.custom_effect.CustomEffect",
    "armgap.progress.Told": "armgap.progress.ProgressCallback",
    "armgap.progress.following": "armgap.progress.use_callback",
    "armgap.progress.of_many": "armgap.progress.part_callback",
    "armgap.progress.tell": "armgap.progress.report_progress",
    "armgap.report.forms.notebook.Shown": "armgap.report.forms.notebook.NotebookDisplay",
    "armgap.report.page.Heat": "armgap.report.page.HeatMap",
    "armgap.report.page.Track": "armgap.report.page.IntervalLine",
    "armgap.report.words.Answer": "armgap.report.words.SummaryAnswer",
    "armgap.trial.Hidden": "armgap.trial.HiddenEffect",
    "armgap.trial.cases.key.Hidden": "armgap.trial.cases.key.HiddenEffect",
    "armgap.trial.peers.PEERS": "armgap.trial.baselines.BASELINES",
}


#: New name of each module or package that moved, by its old name; submodules of a moved package have moved with it.
MOVED = {
    "armgap.arm.serial_arm_file": "armgap.arm.serial.arm_file",
    "armgap.arm.serial_chain": "armgap.arm.serial.chain",
    "armgap.arm.serial_links": "armgap.arm.serial.links",
    "armgap.arm.serial_toml": "armgap.arm.serial.toml",
    "armgap.arm.serial_trust": "armgap.arm.serial.trust",
    "armgap.arm_file": "armgap.arm.arm_file",
    "armgap.base_columns": "armgap.estimation.base_columns",
    "armgap.check.copied": "armgap.check.log_checks.copied",
    "armgap.check.corrections": "armgap.arm.corrections",
    "armgap.check.data": "armgap.check.log_checks.data",
    "armgap.check.filtered": "armgap.check.log_checks.filtered",
    "armgap.check.gravity_missing": "armgap.check.readings.gravity_missing",
    "armgap.check.gravity_sign": "armgap.check.readings.gravity_sign",
    "armgap.check.joint_order": "armgap.check.readings.joint_order",
    "armgap.check.numbers": "armgap.check.log_checks.numbers",
    "armgap.check.outcome": "armgap.check.log_checks.outcome",
    "armgap.check.position_sign": "armgap.check.readings.position_sign",
    "armgap.check.position_unit": "armgap.check.readings.position_unit",
    "armgap.check.position_zero": "armgap.check.readings.position_zero",
    "armgap.check.quantized": "armgap.check.log_checks.quantized",
    "armgap.check.reading": "armgap.check.readings.reading",
    "armgap.check.relative_angle": "armgap.check.readings.relative_angle",
    "armgap.check.repeated": "armgap.check.log_checks.repeated",
    "armgap.check.spike": "armgap.check.log_checks.spike",
    "armgap.check.stamps": "armgap.check.log_checks.stamps",
    "armgap.check.torque_sign": "armgap.check.readings.torque_sign",
    "armgap.check.wrapped": "armgap.check.log_checks.wrapped",
    "armgap.cli.compare": "armgap.cli.diagnosis_commands.compare",
    "armgap.cli.diagnose": "armgap.cli.diagnosis_commands.diagnose",
    "armgap.cli.export": "armgap.cli.model_commands.export",
    "armgap.cli.fleet": "armgap.cli.diagnosis_commands.fleet",
    "armgap.cli.identify": "armgap.cli.diagnosis_commands.identify",
    "armgap.cli.inspect": "armgap.cli.diagnosis_commands.inspect",
    "armgap.cli.model": "armgap.cli.model_commands.model",
    "armgap.cli.plan": "armgap.cli.diagnosis_commands.plan",
    "armgap.cli.replay": "armgap.cli.model_commands.replay",
    "armgap.cli.simulate": "armgap.cli.model_commands.simulate",
    "armgap.comparison": "armgap.diagnosis.comparison",
    "armgap.controller": "armgap.arm.controller",
    "armgap.custom_effect": "armgap.diagnosis.custom_effect",
    "armgap.description": "armgap.arm.description",
    "armgap.drive": "armgap.diagnosis.drive",
    "armgap.drive_chain": "armgap.diagnosis.drive_chain",
    "armgap.estimator": "armgap.estimation.estimator",
    "armgap.export.bodies": "armgap.export.chain.bodies",
    "armgap.export.header": "armgap.export.formats.header",
    "armgap.export.joint": "armgap.export.chain.joint",
    "armgap.export.links": "armgap.export.chain.links",
    "armgap.export.mjcf": "armgap.export.formats.mjcf",
    "armgap.export.model": "armgap.export.chain.model",
    "armgap.export.motion": "armgap.export.chain.motion",
    "armgap.export.original": "armgap.export.formats.original",
    "armgap.export.original_mjcf": "armgap.export.formats.original_mjcf",
    "armgap.export.original_urdf": "armgap.export.formats.original_urdf",
    "armgap.export.planar": "armgap.export.chain.planar",
    "armgap.export.serial": "armgap.export.chain.serial",
    "armgap.export.toml": "armgap.export.formats.toml",
    "armgap.export.urdf": "armgap.export.formats.urdf",
    "armgap.fitting": "armgap.estimation.fitting",
    "armgap.free_space": "armgap.arm.free_space",
    "armgap.identification": "armgap.estimation.identification",
    "armgap.json_schema": "armgap.files.json_schema",
    "armgap.log.clocks": "armgap.log.conversion.clocks",
    "armgap.log.columns": "armgap.log.conversion.columns",
    "armgap.log.index": "armgap.log.conversion.index",
    "armgap.log.spellings": "armgap.log.conversion.spellings",
    "armgap.log.turns": "armgap.log.conversion.turns",
    "armgap.log.units": "armgap.log.conversion.units",
    "armgap.model": "armgap.arm.model",
    "armgap.output": "armgap.files.output",
    "armgap.planning.hypotheses": "armgap.planning.open_questions.hypotheses",
    "armgap.planning.questions": "armgap.planning.open_questions.questions",
    "armgap.planning.sizes": "armgap.planning.open_questions.sizes",
    "armgap.prepared_input": "armgap.diagnosis.prepared_input",
    "armgap.provenance": "armgap.diagnosis.provenance",
    "armgap.reading": "armgap.files.reading",
    "armgap.report.html": "armgap.report.forms.html",
    "armgap.report.markdown": "armgap.report.forms.markdown",
    "armgap.report.notebook": "armgap.report.forms.notebook",
    "armgap.report.replay": "armgap.report.forms.replay",
    "armgap.report.shown": "armgap.report.forms.shown",
    "armgap.report.terminal": "armgap.report.forms.terminal",
    "armgap.reproduction.command": "armgap.cli.reproduce",
    "armgap.rigid_body": "armgap.arm.rigid_body",
    "armgap.serial_arm_file": "armgap.arm.serial.arm_file",
    "armgap.serial_chain": "armgap.arm.serial.chain",
    "armgap.serial_links": "armgap.arm.serial.links",
    "armgap.serial_settings": "armgap.diagnosis.serial_settings",
    "armgap.serial_toml": "armgap.arm.serial.toml",
    "armgap.serial_trust": "armgap.arm.serial.trust",
    "armgap.trial.actuator": "armgap.trial.simulation.actuator",
    "armgap.trial.armfile": "armgap.trial.cases.armfile",
    "armgap.trial.arms": "armgap.trial.simulation.arms",
    "armgap.trial.case": "armgap.trial.cases.case",
    "armgap.trial.commands": "armgap.cli.trial_commands",
    "armgap.trial.demo": "armgap.trial.cases.demo",
    "armgap.trial.engine": "armgap.trial.simulation.engine",
    "armgap.trial.excitation": "armgap.trial.simulation.excitation",
    "armgap.trial.key": "armgap.trial.cases.key",
    "armgap.trial.layout": "armgap.trial.cases.layout",
    "armgap.trial.making": "armgap.trial.cases.making",
    "armgap.trial.model": "armgap.trial.simulation.model",
    "armgap.trial.plant": "armgap.trial.simulation.plant",
    "armgap.trial.sealed": "armgap.trial.cases.sealed",
    "armgap.trial.simulated_arm": "armgap.trial.simulation.simulated_arm",
    "armgap.trial.visibility": "armgap.trial.cases.visibility",
    "armgap.trial.windows": "armgap.trial.cases.windows",
}


def _now(name: str) -> str | None:
    """Return the new name of a module that moved itself or with its package; None for other names."""
    for old, new in MOVED.items():
        if name == old or name.startswith(f"{old}."):
            return new + name.removeprefix(old)
    return None


def _warn(old: str, new: str, stacklevel: int) -> None:
    warnings.warn(f"{old} is now {new}; the old name goes with 0.3.0", DeprecationWarning, stacklevel=stacklevel + 1)


class _MovedModules(MetaPathFinder, Loader):
    """Import hook that finds moved modules by their old names."""

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
    """Install the import hook that finds moved modules by their old names."""
    if not any(isinstance(finder, _MovedModules) for finder in sys.meta_path):
        sys.meta_path.insert(0, _MovedModules())


def old_names(module: str, *, stacklevel: int = 2) -> Callable[[str], Any]:
    """Return a ``__getattr__`` for a module, which finds objects of the module by their old names and warns.

    Parameters
    ----------
    module : str
        Name of the module.
    stacklevel : int, default 2
        Stack frame that the warning names: 2 is the caller of ``__getattr__`` where the returned function itself is the ``__getattr__``.

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
