"""Hidden effects of the cases: one class per effect, with its law and the draw of its size. Each class or module names its textbook."""

from __future__ import annotations

from .arm import BaseTilt, NominalLink, Payload, RotorInertia
from .clutter import Clutter
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
from .outside import (
    BentDriveCurve,
    CableSpring,
    DampedCable,
    DriveHysteresis,
    FadingTorque,
    FrictionJump,
    FrictionOverTurns,
    LoadedCogging,
    NeighbourRipple,
    ProductTorque,
    SlewLimit,
    SpeedRipple,
    TorqueDrift,
)
from .several import CoupledTransmission, DelayEverywhere, LoadFrictionEverywhere
from .torque import Contact, JointSpring, TorqueOffset, TorqueRipple
from .transmission import Backlash, JointElasticity

__all__ = ["BESIDE", "EFFECTS", "OUTSIDE", "TURN", "Clutter", "Effect", "Moment", "Null", "Use"]

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

OUTSIDE: tuple[type[Effect], ...] = (
    TorqueDrift, LoadedCogging, NeighbourRipple, FrictionJump, FrictionOverTurns, FadingTorque, DriveHysteresis, SlewLimit, SpeedRipple,
    BentDriveCurve, DampedCable, ProductTorque,
)  # fmt: skip
"""Classes of the effects that armgap's library does not have."""
BESIDE: tuple[type[Effect], ...] = (
    Stribeck, CoulombAsymmetry, ViscousAsymmetry, QuadraticDrag, LoadDependentFriction, PositionDependentFriction, FrictionWarmup,
    TorqueOffset, TorqueRipple, JointSpring, ActuatorLag, ActuatorDelay, TorqueDeadZone, TorqueGain, EncoderEccentricity, *OUTSIDE,
)  # fmt: skip
"""Classes of the effects that clutter is drawn from."""
