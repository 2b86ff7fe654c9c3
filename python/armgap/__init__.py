"""armgap: find out why a real robot arm does not do what the simulation said."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from armgap._native import __version__

if TYPE_CHECKING:
    from armgap.arm import Arm
    from armgap.diagnose import Diagnosis, diagnose
    from armgap.errors import ArmgapError
    from armgap.identify import Identification, identify
    from armgap.log import Finding, Log
    from armgap.reproduce import Reproduction, reproduce
    from armgap.simulate import effects, seed_torque, simulate

__all__ = [
    "Arm",
    "ArmgapError",
    "Diagnosis",
    "Finding",
    "Identification",
    "Log",
    "Reproduction",
    "__version__",
    "diagnose",
    "effects",
    "identify",
    "reproduce",
    "seed_torque",
    "simulate",
]

_HOMES = {
    "Arm": "armgap.arm",
    "ArmgapError": "armgap.errors",
    "Diagnosis": "armgap.diagnose",
    "diagnose": "armgap.diagnose",
    "Finding": "armgap.log",
    "Log": "armgap.log",
    "Identification": "armgap.identify",
    "identify": "armgap.identify",
    "Reproduction": "armgap.reproduce",
    "reproduce": "armgap.reproduce",
    "effects": "armgap.simulate",
    "seed_torque": "armgap.simulate",
    "simulate": "armgap.simulate",
}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used, so that importing the package stays fast."""
    if name not in _HOMES:
        raise AttributeError(f"module 'armgap' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names."""
    return __all__
