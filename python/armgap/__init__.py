"""armgap: find out why a real robot arm does not do what the simulation said."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from armgap._native import __version__
from armgap._renamed import find_moved_modules, old_names

if TYPE_CHECKING:
    from armgap.arm import Arm
    from armgap.arm.model import read_model
    from armgap.check import CheckName, Severity
    from armgap.diagnosis import Diagnosis, diagnose
    from armgap.diagnosis.custom_effect import CustomEffect
    from armgap.errors import ArmgapError
    from armgap.estimation.base_columns import BaseParameters, base_parameters
    from armgap.estimation.estimator import Estimator
    from armgap.estimation.fitting import ArmFit, fit
    from armgap.estimation.identification import Identification, identify
    from armgap.export import Corrected, correct
    from armgap.inspection import Inspection, inspect
    from armgap.literals import Filters, Scheme, Status, Verdict
    from armgap.log import Finding, Log
    from armgap.planning import Plan, plan
    from armgap.reproduction import Reproduction, reproduce
    from armgap.simulation import effects, seed_torque, simulate

__all__ = [
    "Arm",
    "ArmFit",
    "ArmgapError",
    "BaseParameters",
    "CheckName",
    "Corrected",
    "CustomEffect",
    "Diagnosis",
    "Estimator",
    "Filters",
    "Finding",
    "Identification",
    "Inspection",
    "Log",
    "Plan",
    "Reproduction",
    "Scheme",
    "Severity",
    "Status",
    "Verdict",
    "__version__",
    "base_parameters",
    "correct",
    "diagnose",
    "effects",
    "fit",
    "identify",
    "inspect",
    "plan",
    "read_model",
    "reproduce",
    "seed_torque",
    "simulate",
]

_HOMES = {
    "Arm": "armgap.arm",
    "ArmgapError": "armgap.errors",
    "BaseParameters": "armgap.estimation.base_columns",
    "base_parameters": "armgap.estimation.base_columns",
    "CheckName": "armgap.check",
    "Severity": "armgap.check",
    "Filters": "armgap.literals",
    "Scheme": "armgap.literals",
    "Status": "armgap.literals",
    "Verdict": "armgap.literals",
    "Corrected": "armgap.export",
    "correct": "armgap.export",
    "Diagnosis": "armgap.diagnosis",
    "diagnose": "armgap.diagnosis",
    "Estimator": "armgap.estimation.estimator",
    "Finding": "armgap.log",
    "ArmFit": "armgap.estimation.fitting",
    "fit": "armgap.estimation.fitting",
    "Log": "armgap.log",
    "CustomEffect": "armgap.diagnosis.custom_effect",
    "Identification": "armgap.estimation.identification",
    "identify": "armgap.estimation.identification",
    "Reproduction": "armgap.reproduction",
    "Inspection": "armgap.inspection",
    "inspect": "armgap.inspection",
    "read_model": "armgap.arm.model",
    "Plan": "armgap.planning",
    "plan": "armgap.planning",
    "reproduce": "armgap.reproduction",
    "effects": "armgap.simulation",
    "seed_torque": "armgap.simulation",
    "simulate": "armgap.simulation",
}

find_moved_modules()


def __getattr__(name: str) -> Any:
    """Import a public name of the package on first use, so that importing the package stays fast."""
    if name not in _HOMES:
        return old_names(__name__, stacklevel=3)(name)
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names of the package."""
    return __all__
