"""Effects that cases hide. The registry holds one entry per effect, filled by the modules of this folder."""

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
