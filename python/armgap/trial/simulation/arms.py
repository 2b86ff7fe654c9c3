"""Arms for blind trials: physical parameters, and random ones around known machines.

The two-link arm follows Reyes and Kelly (1997), section 5: ``q1`` is zero hanging down, ``q2`` is relative to link 1.
Base parameters come from physical ones by the formulas of that section. Friction levels, torque limits and
encoders are those of two real machines, a direct-drive arm (Table I of the paper) and a small geared arm, each varied
at random.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

GRAVITY = 9.81  # acceleration of gravity, m/s^2
#: One turn of a joint, rad.
TURN = 2.0 * math.pi

Numbers = tuple[float, ...]


@dataclass(frozen=True)
class TrialArm:
    """Physical parameters of one arm, one entry per joint, SI.

    Attributes
    ----------
    kind : {"axis", "pendulum", "two-link"}
        Kind of arm, as in the arm file.
    mass, length, com, inertia : tuple of float
        Mass [kg], length [m], centre of mass from the joint [m], inertia about the centre of mass [kg m^2] of each link.
    viscous, coulomb : tuple of float
        Nominal friction coefficients [N m s/rad, N m; N s/m, N on an axis].
    torque_limit : tuple of float
        Torque limit [N m; N on an axis].
    step : tuple of float
        Encoder step, rad (m on an axis).
    sample_period : float
        Sample period [s].
    slope, gravity : float
        Inclination of a linear axis, rad (0 is horizontal; other kinds ignore it), and acceleration of gravity [m/s^2].
    """

    kind: str
    mass: Numbers
    length: Numbers
    com: Numbers
    inertia: Numbers
    viscous: Numbers
    coulomb: Numbers
    torque_limit: Numbers
    step: Numbers
    sample_period: float = 0.0025
    slope: float = 0.0
    gravity: float = GRAVITY

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.mass)

    @property
    def inertial(self) -> Numbers:
        """Base inertial parameters of the arm [SI], in the order of the arm file."""
        if self.kind == "axis":
            return (self.mass[0], self.mass[0] * self.gravity * math.sin(self.slope))
        if self.kind == "pendulum":
            m, c = self.mass[0], self.com[0]
            return (self.inertia[0] + m * c * c, m * self.gravity * c)
        return self._two_link()

    @property
    def theta(self) -> Numbers:
        """All parameters of the arm [SI]: inertial, viscous, Coulomb."""
        return self.inertial + self.viscous + self.coulomb

    @property
    def joint_inertia(self) -> Numbers:
        """Diagonal of the arm's inertia matrix at ``q = 0`` [kg m^2 or kg]."""
        if self.kind != "two-link":
            return (self.inertial[0],)
        t = self.inertial
        return (t[0] + 2 * t[1], t[2])

    def _two_link(self) -> Numbers:
        (m1, m2), l1, (c1, c2), (i1, i2) = self.mass, self.length[0], self.com, self.inertia
        theta3 = m2 * c2 * c2 + i2
        return (
            m1 * c1 * c1 + m2 * l1 * l1 + i1 + theta3,
            l1 * m2 * c2,
            theta3,
            self.gravity * (c1 * m1 + m2 * l1),
            self.gravity * m2 * c2,
        )


#: Direct-drive arm of Table I of Reyes and Kelly (1997), Coulomb friction of joint 1 at its mean, encoders of section 5.
DIRECT_DRIVE = TrialArm(
    kind="two-link",
    mass=(23.902, 3.880),
    length=(0.45, 0.30),
    com=(0.091, 0.048),
    inertia=(1.266, 0.093),
    viscous=(2.288, 0.175),
    coulomb=(7.60, 1.734),
    torque_limit=(200.0, 15.0),
    step=(TURN / 1_024_000, TURN / 655_360),
)

#: Parameters of a small arm with quasi-direct drives behind 6:1 gears.
GEARED = TrialArm(
    kind="two-link",
    mass=(0.55, 0.63),
    length=(0.20, 0.30),
    com=(0.19, 0.254),
    inertia=(0.013, 0.011),
    viscous=(0.030, 0.020),
    coulomb=(0.25, 0.19),
    torque_limit=(10.0, 10.0),
    step=(TURN / 98_304, TURN / 98_304),
)

#: Parameters of a pendulum: one direct-drive joint under gravity.
PENDULUM = TrialArm(
    kind="pendulum",
    mass=(4.0,),
    length=(0.5,),
    com=(0.22,),
    inertia=(0.09,),
    viscous=(0.20,),
    coulomb=(0.9,),
    torque_limit=(40.0,),
    step=(TURN / 655_360,),
)

#: Parameters of a horizontal ball-screw table with a linear scale of 1 um.
AXIS = TrialArm(
    kind="axis",
    mass=(12.0,),
    length=(1.0,),
    com=(0.0,),
    inertia=(0.0,),
    viscous=(25.0,),
    coulomb=(18.0,),
    torque_limit=(400.0,),
    step=(1e-6,),
)

#: Arms around whose parameters random arms are drawn, by name of the model.
MODELS = {"direct-drive": DIRECT_DRIVE, "geared": GEARED, "pendulum": PENDULUM, "axis": AXIS}
#: Sample periods that cases are drawn from, s.
SAMPLE_PERIODS = (0.001, 0.002, 0.0025, 0.004, 0.005)


def random_arm(rng: np.random.Generator, model: str = "direct-drive", sample_period: float | None = None) -> TrialArm:
    """Return one of :data:`MODELS` with randomly varied parameters.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of randomness.
    model : str, default "direct-drive"
        Key of :data:`MODELS`.
    sample_period : float, optional
        Sample period [s]; drawn from 1 to 5 ms by default.
    """
    base = MODELS[model]
    size, weight = rng.uniform(0.8, 1.25), rng.uniform(0.7, 1.4)
    period = sample_period or float(rng.choice(SAMPLE_PERIODS))
    arm = replace(
        base,
        mass=_spread(rng, base.mass, weight, 0.15),
        length=_spread(rng, base.length, size, 0.08),
        com=_spread(rng, base.com, size, 0.08),
        inertia=_spread(rng, base.inertia, weight * size * size, 0.15),
        viscous=_spread(rng, base.viscous, weight * size * size, 0.35),
        coulomb=_spread(rng, base.coulomb, weight * size, 0.35),
        torque_limit=tuple(_round2(x * weight * size) for x in base.torque_limit),
        sample_period=period,
    )
    return arm if arm.kind != "axis" else replace(arm, slope=float(rng.choice([0.0, 0.5])))


def _spread(rng: np.random.Generator, values: Numbers, scale: float, width: float) -> Numbers:
    factors = scale * rng.uniform(1 - width, 1 + width, len(values))
    return tuple(float(x) for x in np.array(values) * factors)


def _round2(value: float) -> float:
    return float(f"{value:.2g}")
