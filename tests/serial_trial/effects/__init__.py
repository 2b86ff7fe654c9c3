"""Hidden effects of the cases: one class per effect, with its law and the draw of its size. Each class or module names its textbook."""

from __future__ import annotations

from .arm import BaseTilt, NominalLink, Payload, RotorInertia
from .drive import ActuatorDelay, ActuatorLag, TorqueDeadZone, TorqueGain, TorqueSaturation
from .effect import TURN, Effect, Moment, Null, Use
from .encoder import EncoderEccentricity, EncoderOffset
from .friction import (
    CoulombAsymmetry,
    FrictionWarmup,
    LoadDependentFriction,
    PositionDependentFriction,
    QuadraticDrag,
    Stribeck,
    StribeckEverywhere,
    ViscousAsymmetry,
)
from .outside import CableSpring, LoadedCogging, TorqueDrift
from .several import CoupledTransmission, DelayEverywhere, LoadFrictionEverywhere
from .torque import Contact, JointSpring, TorqueOffset, TorqueRipple
from .transmission import Backlash, JointElasticity

__all__ = ["EFFECTS", "TURN", "Effect", "Moment", "Null", "Use"]

EFFECTS: dict[str, type[Effect]] = {
    effect.name: effect
    for effect in (
        Payload, BaseTilt, NominalLink, RotorInertia, Stribeck, StribeckEverywhere, CoulombAsymmetry, ViscousAsymmetry, QuadraticDrag,
        LoadDependentFriction, PositionDependentFriction, FrictionWarmup, TorqueOffset, TorqueRipple, JointSpring, Contact,
        ActuatorLag, ActuatorDelay, TorqueSaturation, TorqueDeadZone, TorqueGain, EncoderOffset, EncoderEccentricity, JointElasticity, Backlash,
        TorqueDrift, CableSpring, LoadedCogging,
        DelayEverywhere, LoadFrictionEverywhere, CoupledTransmission,
    )
}  # fmt: skip
"""Classes of all effects by name, without `Null`."""
