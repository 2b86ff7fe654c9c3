"""Names that changed in 0.2.0: the old ones warn and still work; they go with 0.3.0."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from importlib import import_module
from typing import Any

__all__ = ["RENAMED", "old_names"]

#: Old public name to new public name, each with its module.
RENAMED = {
    "armgap.OwnEffect": "armgap.CustomEffect",
    "armgap.own.OwnEffect": "armgap.custom_effect.CustomEffect",
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
        if old not in RENAMED:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        new = RENAMED[old]
        warnings.warn(f"{old} is now {new}; the old name goes with 0.3.0", DeprecationWarning, stacklevel=stacklevel)
        home, _, changed = new.rpartition(".")
        return getattr(import_module(home), changed)

    return find
