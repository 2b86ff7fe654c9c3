"""Serial arms for the trial: placements of joints, rigid links, friction and limits; and the arms as models of MuJoCo.

Joint j turns about, or slides along, an axis through the origin of its frame, which is placed in the frame of the previous link.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Integration step of MuJoCo [s].
STEP = 5e-4
#: Speed [m/s] of a linear joint at which its viscous friction is in the same range relative to its Coulomb friction as at 1 rad/s on a rotary one.
_SLIDING_SPEED = 0.2
#: Lever arm [m] by which drawn rotor inertias are divided on linear joints, so that they are comparable with those of rotary joints.
_SPINDLE = 0.35


@dataclass(frozen=True)
class Link:
    """Rigid body: one link of an arm.

    Attributes
    ----------
    mass : float
        Mass [kg].
    com : ndarray, shape (3,)
        Centre of mass in the link's frame [m].
    spread : ndarray, shape (3, 3)
        Second moments of the mass about the centre of mass, ``integral of x x' dm`` [kg m^2]; positive semi-definite for every possible body.
    """

    mass: float
    com: Array
    spread: Array

    @property
    def inertia(self) -> Array:
        """Inertia about the centre of mass [kg m^2], shape (3, 3)."""
        return np.asarray(np.trace(self.spread) * np.eye(3) - self.spread)

    @property
    def ten(self) -> Array:
        """Ten inertial parameters about the link's origin: ``m, m cx, m cy, m cz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz``, shape (10,)."""
        second = self.spread + self.mass * np.outer(self.com, self.com)
        i = np.trace(second) * np.eye(3) - second
        return np.array([self.mass, *(self.mass * self.com), i[0, 0], i[0, 1], i[1, 1], i[0, 2], i[1, 2], i[2, 2]])

    def scaled(self, factor: float) -> Link:
        """Return a link of the same shape and size with `factor` times the mass."""
        return Link(factor * self.mass, self.com, factor * self.spread)

    def joined(self, other: Link) -> Link:
        """Return this link with another body fixed to it (parallel axis theorem)."""
        mass = self.mass + other.mass
        apart = other.com - self.com
        com = self.com + apart * other.mass / mass
        spread = self.spread + other.spread + np.outer(apart, apart) * self.mass * other.mass / mass
        return Link(mass, com, spread)


@dataclass(frozen=True)
class SerialRobot:
    """A serial arm of n joints; the same type holds the nominal model and the simulated truth.

    Attributes
    ----------
    name : str
        Name of the family that the arm was drawn from.
    kinds : tuple of {"revolute", "prismatic"}
        Kind of each joint.
    rotation : ndarray, shape (n, 3, 3)
        Axes of each joint's frame in the frame of the previous link, as columns.
    translation, axis : ndarray, shape (n, 3)
        Origin of each joint's frame in the frame of the previous link [m], and the joint's axis in its own frame.
    links : tuple of Link
        The links that the joints move.
    rotor, viscous, coulomb : ndarray, shape (n,)
        Rotor inertias reflected to the joint [kg m^2 or kg], viscous friction [N m s/rad or N s/m] and Coulomb friction [N m or N].
    gravity : ndarray, shape (3,)
        Acceleration of gravity in the frame of the base [m/s^2].
    lower, upper, speed, effort : ndarray, shape (n,)
        Range of positions [rad or m], largest speed [rad/s or m/s] and largest torque [N m or N] of each joint.
    counts : ndarray, shape (n,)
        Encoder counts per turn (rotary joint) or per metre (linear joint).
    """

    name: str
    kinds: tuple[str, ...]
    rotation: Array
    translation: Array
    axis: Array
    links: tuple[Link, ...]
    rotor: Array
    viscous: Array
    coulomb: Array
    gravity: Array
    lower: Array
    upper: Array
    speed: Array
    effort: Array
    counts: Array

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.kinds)

    @property
    def rotary(self) -> NDArray[np.bool_]:
        """Whether each joint is rotary, shape (n,)."""
        return np.array([kind == "revolute" for kind in self.kinds])

    @property
    def step(self) -> Array:
        """Encoder step of each joint [rad or m], shape (n,)."""
        return np.where(self.rotary, 2 * np.pi, 1.0) / self.counts

    @property
    def theta(self) -> Array:
        """Parameters: ten inertial parameters per link, then rotor inertias, viscous and Coulomb friction per joint, shape (13 n,)."""
        return np.concatenate([*(link.ten for link in self.links), self.rotor, self.viscous, self.coulomb])

    @property
    def lengths(self) -> Array:
        """Size of each link [m], shape (n,): largest of distances to next joint and centre of mass, radius of gyration and 5 % of the arm's reach."""
        ahead = np.append(np.linalg.norm(self.translation[1:], axis=1), 0.0)
        com = np.array([np.linalg.norm(link.com) for link in self.links])
        gyration = np.array([np.sqrt(np.trace(link.spread) / link.mass) for link in self.links])
        return np.asarray(np.maximum.reduce([ahead, com, gyration, np.full(self.n, 0.05 * (ahead.sum() + com[-1]))]))

    @property
    def upside_down(self) -> bool:
        """Whether gravity has a positive z component in the base's frame, as it has for an arm that hangs from a ceiling."""
        return bool(self.gravity[2] > 0)

    def with_link(self, k: int, link: Link) -> SerialRobot:
        """Return the arm with `link` in the place of link `k`, counted from 0."""
        return replace(self, links=(*self.links[:k], link, *self.links[k + 1 :]))

    def mjcf(self, *, friction: bool = True) -> str:
        """Return the arm as MJCF text for MuJoCo; dry friction is not regularised, viscous friction is the joints' damping.

        Parameters
        ----------
        friction : bool, default True
            Whether joints have friction.
        """
        opened = []
        for j, link in enumerate(self.links):
            i = link.inertia
            moments = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
            dry = f' damping="{self.viscous[j]:.17g}" frictionloss="{self.coulomb[j]:.17g}"' if friction else ""
            opened.append(
                f'<body pos="{_numbers(self.translation[j])}" quat="{_numbers(_quaternion(self.rotation[j]))}">'
                f'<joint type="{"hinge" if self.kinds[j] == "revolute" else "slide"}" axis="{_numbers(self.axis[j])}" '
                f'armature="{self.rotor[j]:.17g}" solreffriction="0.001 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"{dry}/>'
                f'<inertial pos="{_numbers(link.com)}" mass="{link.mass:.17g}" fullinertia="{_numbers(moments)}"/>'
            )
        return (
            '<mujoco><compiler angle="radian" balanceinertia="false" boundmass="0" boundinertia="0" inertiafromgeom="false"/>'
            f'<option timestep="{STEP}" gravity="{_numbers(self.gravity)}" integrator="RK4" tolerance="1e-12" '
            'iterations="100"><flag contact="disable"/></option>'
            f"<worldbody>{''.join(opened)}{'</body>' * self.n}</worldbody></mujoco>"
        )

    def model(self, *, friction: bool = True) -> Any:
        """Return the arm as a compiled `mujoco.MjModel`; see `mjcf`."""
        return mujoco.MjModel.from_xml_string(self.mjcf(friction=friction))


def turn(axis: Sequence[float] | Array, angle: float) -> Array:
    """Return the rotation matrix about an axis by an angle [rad], shape (3, 3) (Rodrigues)."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def rod(mass: float, end: Array, radius: float, at: float, aside: Array) -> Link:
    """Return a cylinder from the origin to `end` [m], with its centre of mass at the fraction `at` of its length, moved by `aside` [m]."""
    length = float(np.linalg.norm(end))
    along = end / length
    across = np.eye(3) - np.outer(along, along)
    spread = mass * (length**2 / 12 * np.outer(along, along) + radius**2 / 4 * across)
    return Link(mass, at * end + aside, spread)


@dataclass(frozen=True)
class _Family:
    """Common values of the arms of one family: Denavit-Hartenberg rows or axes, masses, ranges, drives."""

    rows: tuple[tuple[float, float, float, float], ...]
    """Placement of each joint in the previous frame at position zero: `d` along z, `a` along x, then turned by `alpha` about x and `beta` about y."""
    masses: tuple[float, ...]
    effort: tuple[float, ...]
    middle: tuple[float, ...]
    """Middle of each joint's range [rad]."""
    half: float
    """Half of each joint's range [rad]."""
    radius: float
    tool: float
    speed: float
    counts: int
    kinds: str = ""
    """Letter ``R`` (rotary) or ``P`` (linear) for each joint; all joints are rotary if it is empty."""


_Q = np.pi / 2
#: Families from rounded drawings of the makers: UR10 (Universal Robots), Panda (Franka; masses of Gaz et al. 2019), SO-101 (Hugging Face).
FAMILIES = {
    "UR10-like": _Family(
        ((0.127, 0.0, 0.0, 0.0), (0.0, 0.0, _Q, 0.0), (0.0, -0.612, 0.0, 0.0), (0.0, -0.572, 0.0, 0.0),
         (0.164, 0.0, _Q, 0.0), (0.116, 0.0, -_Q, 0.0)),
        (7.8, 12.9, 4.3, 2.0, 2.0, 0.6), (330.0, 330.0, 150.0, 56.0, 56.0, 56.0), (0.0, -1.2, 1.2, 0.0, 0.0, 0.0), 1.3, 0.06,
        0.12, 1.6, 2**17,
    ),
    "Panda-like": _Family(
        ((0.333, 0.0, 0.0, 0.0), (0.0, 0.0, -_Q, 0.0), (-0.316, 0.0, _Q, 0.0), (0.0, 0.083, _Q, 0.0), (0.384, -0.083, -_Q, 0.0),
         (0.0, 0.0, _Q, 0.0), (0.0, 0.088, _Q, 0.0)),
        (4.0, 3.0, 3.2, 3.0, 2.0, 1.6, 1.2), (87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0), (0.0, 0.0, 0.0, -1.7, 0.0, 1.8, 0.0), 1.2,
        0.055, 0.15, 1.6, 2**18,
    ),
    "SO-101-like": _Family(
        ((0.062, 0.0, 0.0, 0.0), (0.054, 0.03, _Q, 0.0), (0.0, 0.113, 0.0, 0.0), (0.0, 0.135, 0.0, 0.0), (0.0, 0.061, 0.0, _Q)),
        (0.15, 0.1, 0.11, 0.08, 0.12), (3.0, 3.0, 3.0, 3.0, 3.0), (0.0, 0.9, -0.9, 0.0, 0.0), 1.0, 0.02, 0.1, 2.0, 2**14,
    ),
    "R-P-R": _Family(
        ((0.4, 0.0, 0.0, 0.0), (0.0, 0.15, 0.0, _Q), (0.3, 0.0, -_Q, 0.0)),
        (9.0, 6.0, 3.0), (150.0, 300.0, 40.0), (0.0, 0.0, 0.3), 1.3, 0.06, 0.3, 1.6, 2**17, "RPR",
    ),
}  # fmt: skip
#: Half of the range of a linear joint [m], and its largest speed [m/s].
_TRAVEL, _SLIDE = 0.22, 0.35


def draw_robot(rng: np.random.Generator, family: str | None = None, n: int | None = None) -> SerialRobot:
    """Draw an arm of one of the `FAMILIES`, with its first `n` joints and links; lengths and masses differ by up to a quarter.

    A third of the arms have a base with a known tilt; some hang from the ceiling; some have joint axes in slightly random directions.
    """
    family = family or str(rng.choice(list(FAMILIES), p=[0.35, 0.3, 0.2, 0.15]))
    of = FAMILIES[family]
    most = len(of.rows)
    n = n or int(rng.integers(3, most + 1))
    kinds = tuple("prismatic" if kind == "P" else "revolute" for kind in (of.kinds or "R" * most)[:n])
    rotary = np.array([kind == "revolute" for kind in kinds])
    size = float(rng.uniform(0.8, 1.2))
    askew = 0.25 if rng.uniform() < 0.3 else 0.0
    rotation, translation = np.empty((n, 3, 3)), np.empty((n, 3))
    for j, (d, a, alpha, beta) in enumerate(of.rows[:n]):
        placed = turn((1, 0, 0), alpha) @ turn((0, 1, 0), beta)
        rotation[j] = placed @ turn(rng.normal(size=3), askew * float(rng.uniform(-1, 1)))
        translation[j] = size * float(rng.uniform(0.9, 1.1)) * np.array([a, 0.0, d])
    links = []
    for j, mass in enumerate(of.masses[:n]):
        end = translation[j + 1] if j + 1 < n else np.array([0.0, 0.0, size * of.tool])
        if np.linalg.norm(end) < of.radius:
            end = end + of.radius * np.array([0.0, 1.0, 1.0])
        aside = 0.3 * of.radius * rng.normal(size=3)
        heavy = size**2 * mass * float(rng.uniform(0.8, 1.25))
        links.append(rod(heavy, end, of.radius, float(rng.uniform(0.35, 0.6)), aside))
    effort = np.array(of.effort[:n])
    gravity = np.array([0.0, 0.0, -9.81])
    where = rng.uniform()
    if where < 0.15:
        gravity = -gravity
    elif where < 0.45:
        tilted = turn((*rng.normal(size=2), 0.0), float(rng.uniform(0.1, 0.8)))
        gravity = tilted @ gravity
    half, speed = np.where(rotary, of.half, _TRAVEL), np.where(rotary, of.speed, _SLIDE)
    middle = np.array(of.middle[:n])
    return SerialRobot(
        family, kinds, rotation, translation, np.tile([0.0, 0.0, 1.0], (n, 1)), tuple(links),
        effort * rng.uniform(0.004, 0.009, n) / np.where(rotary, 1.0, _SPINDLE),
        effort * rng.uniform(0.015, 0.04, n) / np.where(rotary, 1.0, _SLIDING_SPEED),
        effort * rng.uniform(0.015, 0.035, n), gravity, middle - half, middle + half, speed, effort,
        np.where(rotary, float(of.counts), 1e6),
    )  # fmt: skip


def perturbed(
    robot: SerialRobot, rng: np.random.Generator, inertial: float, rotor: float, friction: float
) -> SerialRobot:
    """Return an arm whose values differ at random by up to these shares of their size; every link remains a physically possible body."""
    links = []
    for link, length in zip(robot.links, robot.lengths, strict=True):
        grown = np.diag(1 + 0.3 * inertial * rng.uniform(-1, 1, 3))
        heavier = 1 + 0.3 * inertial * float(rng.uniform(-1, 1))
        com = link.com + 0.15 * inertial * length * rng.uniform(-1, 1, 3)
        links.append(Link(heavier * link.mass, com, heavier * grown @ link.spread @ grown))
    off = [1 + share * rng.uniform(-1, 1, robot.n) for share in (rotor, friction, friction)]
    return replace(
        robot,
        links=tuple(links),
        rotor=off[0] * robot.rotor,
        viscous=off[1] * robot.viscous,
        coulomb=off[2] * robot.coulomb,
    )


def _numbers(values: Any) -> str:
    return " ".join(f"{float(value):.17g}" for value in values)


def _quaternion(rotation: Array) -> Array:
    q = np.empty(4)
    mujoco.mju_mat2Quat(q, np.ascontiguousarray(rotation).ravel())
    return q
