"""Values that an effect could have on an arm in motion: typical sizes, and shapes where a size alone does not fix the effect."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm

__all__ = ["PLANNED", "Scales", "Shape", "levels", "shapes"]

Array = NDArray[np.float64]

#: Typical size of an added torque, as a part of the joint's RMS torque.
PART = 0.05
#: Typical elastic joint: natural frequency of the motor on its spring [1/s], motor's part of the joint's inertia, damping ratio.
SHAFT_RATE, MOTOR_SHARE, SHAFT_DAMPING = 100.0, 0.1, 0.2
#: Number of values that are tried over the possible range of an effect that is a threshold, such as a saturation level.
_THRESHOLD_VALUES = 5
#: Stiffness of a contact, in typical torques per typical position, and its damping, in typical torques per typical speed.
CONTACT_STIFFNESS, CONTACT_DAMPING = 30.0, 0.5


@dataclass(frozen=True)
class Scales:
    """Typical torques, speeds and positions of an arm in a motion, one entry per joint.

    Attributes
    ----------
    torque, speed, position : ndarray, shape (n_joints,)
        RMS torque, RMS speed, and standard deviation of the position [SI].
    low, high : ndarray, shape (n_joints,)
        Range of positions that the arm may take [rad or m].
    seen_low, seen_high : ndarray, shape (n_joints,)
        Range of positions that the diagnosed logs covered [rad or m].
    seen_torque, most_torque : ndarray, shape (n_joints,)
        Largest torque in the diagnosed logs, and the largest that is possible [N m or N].
    inertia : ndarray, shape (n_joints,)
        Diagonal of the inertia matrix at home [kg m^2 or kg].
    period : float
        Sample period [s].
    length : float
        Length of the last link, 0.3 where unknown [m].
    gravity : float
        Acceleration of gravity [m/s^2].
    """

    torque: Array
    speed: Array
    position: Array
    low: Array
    high: Array
    seen_low: Array
    seen_high: Array
    seen_torque: Array
    most_torque: Array
    inertia: Array
    period: float
    length: float
    gravity: float

    @classmethod
    def of(cls, arm: Arm, motion: tuple[Array, Array], tau: Array, inertia: Array, **ranges: Array) -> Scales:
        """Return the typical values in a motion, given by positions and velocities, and torques `tau`, each of shape (n_samples, n_joints)."""
        q, dq = motion
        torque = np.sqrt(np.mean(tau**2, axis=0))
        length = 0.3 if arm.link_length is None else float(arm.link_length[-1]) or 0.3
        return cls(
            np.maximum(torque, 1e-6 * max(float(torque.max()), 1.0)),
            np.maximum(np.sqrt(np.mean(dq**2, axis=0)), 1e-6),
            np.maximum(np.std(q, axis=0), 1e-6),
            inertia=np.diag(inertia).copy(),
            period=arm.sample_period,
            length=length,
            gravity=max(arm.gravity, 1.0),
            **ranges,
        )


@dataclass(frozen=True)
class Shape:
    """Shape of an effect: all of its parameters except the one that is its size.

    Attributes
    ----------
    main : str
        Parameter that is the size.
    typical : float
        Size that matters on most arms, in SI units.
    others : dict of str to float
        Values of the other parameters, which are fixed [SI].
    products : dict of str to float
        Values of other parameters times the size, which are fixed [SI].
    neutral : float
        Value of the parameter at which there is no effect [SI].
    inverse : bool
        Whether the parameter is one over the size: the size of a stiffness is its compliance.
    """

    main: str
    typical: float
    others: dict[str, float] = field(default_factory=dict)
    products: dict[str, float] = field(default_factory=dict)
    neutral: float = 0.0
    inverse: bool = False

    def at(self, size: float) -> dict[str, float]:
        """Return the parameters of the effect for a given size [SI]."""
        value = 1.0 / size if self.inverse else self.neutral + size
        return {self.main: value, **self.others, **{name: product / size for name, product in self.products.items()}}

    def beside(self, estimate: dict[str, tuple[float, float]]) -> Shape:
        """Return the shape with what a diagnosis' estimate of the effect, values and standard deviations, tells of it at any size.

        Small motions tell the torque of a spring near where they are, stiffness times rest position, and not the stiffness.
        """
        if (self.main, *self.others) != ("k", "q0"):
            return self
        return replace(self, others={}, products={"q0": estimate["k"][0] * estimate["q0"][0]})


def _one(
    main: str, typical: Callable[[Scales, int], float], neutral: float = 0.0
) -> Callable[[Scales, int], list[Shape]]:
    return lambda s, j: [Shape(main, typical(s, j), neutral=neutral)]


def _torque(s: Scales, j: int) -> float:
    return PART * float(s.torque[j])


def _stribeck(s: Scales, j: int) -> list[Shape]:
    return [Shape("amplitude", _torque(s, j), {"velocity": part * float(s.speed[j])}) for part in (0.05, 0.3)]


def _presliding(s: Scales, j: int) -> list[Shape]:
    return [
        Shape("amplitude", _torque(s, j), {"stiffness": times * float(s.torque[j] / s.position[j])})
        for times in (30.0, 5.0)
    ]


def _warmup(s: Scales, j: int) -> list[Shape]:
    return [Shape("amplitude", PART, {"time_constant": time}) for time in (3.0, 10.0)]


def _by_position(s: Scales, j: int) -> list[Shape]:
    return [Shape("a", _torque(s, j), {"b": 0.0}), Shape("b", _torque(s, j), {"a": 0.0})]


def _elasticity(s: Scales, j: int) -> list[Shape]:
    rotor = MOTOR_SHARE * float(s.inertia[j])
    others = {"damping": 2 * SHAFT_DAMPING * rotor * SHAFT_RATE, "rotor_inertia": rotor}
    return [Shape("stiffness", 1.0 / (rotor * SHAFT_RATE**2), others, inverse=True)]


def _ripple(s: Scales, j: int) -> list[Shape]:
    return [Shape("amplitude", _torque(s, j), {"n": n, "phase": 0.8}) for n in (1.0, 2.0, 8.0)]


def _spring(s: Scales, j: int) -> list[Shape]:
    middle = 0.5 * float(s.low[j] + s.high[j])
    return [Shape("k", _torque(s, j) / float(s.position[j]), {"q0": middle})]


def _hardening(s: Scales, j: int) -> list[Shape]:
    middle = 0.5 * float(s.low[j] + s.high[j])
    return [Shape("cubic", _torque(s, j) / float(s.position[j]) ** 3, {"k": 0.0, "q0": middle})]


def _payload(s: Scales, _: int) -> list[Shape]:
    return [Shape("mass", PART * float(s.torque[-1]) / (s.gravity * s.length), {"distance": s.length})]


def _eccentricity(_: Scales, __: int) -> list[Shape]:
    return [Shape("a", 0.005, {"b": 0.0}), Shape("b", 0.005, {"a": 0.0})]


def _backlash(s: Scales, j: int) -> list[Shape]:
    typical = 0.01 * float(s.position[j])
    return [Shape("gap", typical, {"rotor_share": share, "riding": 0.0}) for share in (0.03, MOTOR_SHARE)]


_SHAPES: dict[str, Callable[[Scales, int], list[Shape]]] = {
    "coulomb_asymmetry": _one("delta", _torque),
    "torque_offset": _one("offset", _torque),
    "stribeck": _stribeck,
    "quadratic_drag": _one("c", lambda s, j: _torque(s, j) / float(s.speed[j]) ** 2),
    "cubic_drag": _one("c3", lambda s, j: _torque(s, j) / float(s.speed[j]) ** 3),
    "load_dependent_friction": _one("mu", lambda s, j: PART),
    "position_dependent_friction": _by_position,
    "friction_warmup": _warmup,
    "presliding": _presliding,
    "viscous_asymmetry": _one("delta", lambda s, j: _torque(s, j) / float(s.speed[j])),
    "cross_friction": _one("level", _torque),
    "gear_efficiency": _one("loss", lambda s, j: PART),
    "joint_elasticity": _elasticity,
    "backlash": _backlash,
    "torque_gain": _one("gain", lambda s, j: PART, neutral=1.0),
    "actuator_lag": _one("time_constant", lambda s, j: s.period),
    "actuator_delay": _one("delay", lambda s, j: s.period),
    "torque_ripple": _ripple,
    "torque_dead_zone": _one("level", _torque),
    "payload": _payload,
    "base_tilt": _one("angle", lambda s, j: 0.02),
    "joint_spring": _spring,
    "hardening_spring": _hardening,
    "rotor_inertia": _one("inertia", lambda s, j: PART * float(s.inertia[j])),
    "rotor_coupling": _one("inertia", lambda s, j: PART * float(s.inertia[-1])),
    "encoder_offset": _one("offset", lambda s, j: 0.02),
    "encoder_eccentricity": _eccentricity,
}
_LEVELS = ("torque_saturation", "contact")

PLANNED: tuple[str, ...] = (*_SHAPES, *_LEVELS)
"""Names of the effects for which a motion can be planned; an external disturbance is not among them."""


def shapes(effect: str, joint: int | None, scales: Scales) -> list[Shape]:
    """Return the shapes of an effect that are tried; none for an effect that is a threshold."""
    return _SHAPES[effect](scales, (joint or 1) - 1) if effect in _SHAPES else []


def levels(effect: str, joint: int | None, scales: Scales) -> list[dict[str, float]]:
    """Return values of an effect that is a threshold, over the range beyond that of the diagnosed logs."""
    j = (joint or 1) - 1
    if effect == "torque_saturation":
        most = float(scales.most_torque[j])
        least = min(max(float(scales.seen_torque[j]), 0.1 * most), 0.9 * most)
        return [{"level": float(x)} for x in np.geomspace(least, most, _THRESHOLD_VALUES + 2)[1:-1]]
    stiffness = CONTACT_STIFFNESS * float(scales.torque[j] / scales.position[j])
    damping = CONTACT_DAMPING * float(scales.torque[j] / scales.speed[j])
    parts = (np.arange(_THRESHOLD_VALUES) + 0.5) / _THRESHOLD_VALUES
    found = []
    for side, seen, end in ((1.0, scales.seen_high[j], scales.high[j]), (-1.0, scales.seen_low[j], scales.low[j])):
        for position in map(float, seen + parts * (end - seen) if side * (end - seen) > 0 else ()):
            # The stiffness of a stop towards zero is negative.
            signed = stiffness if (side > 0) == (position >= 0) else -stiffness
            found.append({"position": position, "stiffness": signed, "damping": damping})
    return found
