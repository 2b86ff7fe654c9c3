"""Hidden effects of trial cases, registered one entry per effect by the modules of this folder."""

from armgap.trial.effects import drive, friction, sensor, structure
from armgap.trial.effects.base import REGISTRY, Draw, JointUsage, NoTravelError, Parameters, TrialEffect, usage

__all__ = [
    "REGISTRY",
    "Draw",
    "JointUsage",
    "NoTravelError",
    "Parameters",
    "TrialEffect",
    "drive",
    "friction",
    "sensor",
    "structure",
    "usage",
]
