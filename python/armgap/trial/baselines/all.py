"""List of all baselines of a trial."""

from __future__ import annotations

from armgap.trial.baselines.constant import CONSTANT
from armgap.trial.baselines.correlation import CORRELATION
from armgap.trial.baselines.frols import FROLS
from armgap.trial.baselines.stepwise import STEPWISE
from armgap.trial.baselines.sysid import SYSID
from armgap.trial.methods import Method

__all__ = ["BASELINES"]

BASELINES: tuple[Method, ...] = (SYSID, STEPWISE, CORRELATION, FROLS, CONSTANT)
