"""armgap: find out why a real robot arm does not do what the simulation said."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from armgap._native import __version__

if TYPE_CHECKING:
    from armgap.arm import Arm
    from armgap.base_columns import BaseParameters, base_parameters
    from armgap.check import CheckName, Severity
    from armgap.custom_effect import CustomEffect
    from armgap.diagnosis import Diagnosis, diagnose
    from armgap.errors import ArmgapError
    from armgap.estimator import Estimator
    from armgap.export import Corrected, correct
    from armgap.fitting import ArmFit, fit
    from armgap.identification import Identification, identify
    from armgap.inspection import Inspection, inspect
    from armgap.literals import Filters, Scheme, Status, Verdict
    from armgap.log import Finding, Log
    from armgap.model import read_model
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
    "BaseParameters": "armgap.base_columns",
    "base_parameters": "armgap.base_columns",
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
    "Estimator": "armgap.estimator",
    "Finding": "armgap.log",
    "ArmFit": "armgap.fitting",
    "fit": "armgap.fitting",
    "Log": "armgap.log",
    "CustomEffect": "armgap.custom_effect",
    "Identification": "armgap.identification",
    "identify": "armgap.identification",
    "Reproduction": "armgap.reproduction",
    "Inspection": "armgap.inspection",
    "inspect": "armgap.inspection",
    "read_model": "armgap.model",
    "Plan": "armgap.planning",
    "plan": "armgap.planning",
    "reproduce": "armgap.reproduction",
    "effects": "armgap.simulation",
    "seed_torque": "armgap.simulation",
    "simulate": "armgap.simulation",
}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used, so that importing the package stays fast."""
    if name not in _HOMES:
        return import_module("armgap._renamed").old_names(__name__, stacklevel=3)(name)
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names."""
    return __all__
