"""Definition of hidden effects: draw of their parameters, and their application to a simulated arm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from armgap.trial.simulation.arms import TrialArm
from armgap.trial.simulation.simulated_arm import Array, SimulatedArm, Trace

#: Values of an effect's parameters by name [SI].
Parameters = dict[str, float]
#: Smallest acceptable travel of a joint that all logs of a case have in common, as a share of its smallest range of positions in any log.
COMMON = 0.2


class NoTravelError(ValueError):
    """Error: a joint's ranges of position in the logs of a case hardly overlap."""


@dataclass(frozen=True)
class JointUsage:
    """Torques, speeds and positions of one joint in a case's motions, which scale the sizes of effects.

    Attributes
    ----------
    torque, peak : float
        RMS command over all logs, and largest command that every log reaches, N m.
    slew : float
        98th percentile of the command's rate of change, N m/s.
    speed : float
        95th percentile of the speed, rad/s.
    low, high : float
        Lowest and highest position reached in every log, rad.
    span : float
        Smallest range of positions in any log, rad.
    duration : float
        Length of the shortest log [s].
    """

    torque: float
    peak: float
    slew: float
    speed: float
    low: float
    high: float
    span: float
    duration: float

    @property
    def travel(self) -> float:
        """Travel ``high - low`` of the joint that all logs have in common [rad or m].

        Raises
        ------
        NoTravelError
            If the travel is negligible: the logs' positions do not overlap, and sizes relative to it would be unbounded.
        """
        if self.high - self.low < COMMON * self.span:
            raise NoTravelError
        return self.high - self.low


def usage(traces: list[Trace], joint: int) -> JointUsage:
    """Return torques, speeds and positions of a joint (from 0) over all logs of a case."""
    tau = np.concatenate([x.tau[:, joint] for x in traces])
    dq = np.concatenate([x.dq_true[:, joint] for x in traces])
    return JointUsage(
        torque=float(np.sqrt(np.mean(tau**2))),
        peak=min(float(np.max(np.abs(x.tau[:, joint]))) for x in traces),
        slew=float(np.quantile(np.concatenate([_rate(x, joint) for x in traces]), 0.98)),
        speed=float(np.quantile(np.abs(dq), 0.95)),
        low=max(float(np.min(x.q_true[:, joint])) for x in traces),
        high=min(float(np.max(x.q_true[:, joint])) for x in traces),
        span=min(float(np.ptp(x.q_true[:, joint])) for x in traces),
        duration=min(float(x.t[-1]) for x in traces),
    )


def _rate(trace: Trace, joint: int) -> Array:
    rate: Array = np.abs(np.diff(trace.tau[:, joint])) / (trace.t[1] - trace.t[0])
    return rate


@dataclass(frozen=True)
class Draw:
    """Random generator and scales for the draw of one effect's parameters; ``size`` runs from 0 (barely visible) to 1 (large)."""

    rng: np.random.Generator
    size: float
    arm: TrialArm
    joint: int
    use: JointUsage

    def between(self, low: float, high: float) -> float:
        """Return the geometric interpolation between two values by ``size``."""
        return float(low * (high / low) ** self.size)

    def uniform(self, low: float, high: float) -> float:
        """Return a uniform random draw between two values."""
        return float(self.rng.uniform(low, high))

    def log_uniform(self, low: float, high: float) -> float:
        """Return a log-uniform random draw between two values."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def sign(self) -> float:
        """Return a random sign, +1 or -1."""
        return float(self.rng.choice([-1.0, 1.0]))

    def high_side(self) -> float:
        """Return +1 if the joint reaches further up than down from zero, else -1; a random sign where both are possible."""
        up, down = self.use.high, -self.use.low
        if min(up, down) > 0.5 * max(up, down):
            return self.sign()
        return 1.0 if up > down else -1.0

    @property
    def coulomb(self) -> float:
        """Nominal Coulomb friction of the joint [N m or N]."""
        return self.arm.coulomb[self.joint]

    @property
    def inertia(self) -> float:
        """Diagonal entry of the inertia matrix at ``q = 0`` for the joint [kg m^2 or kg]."""
        return self.arm.joint_inertia[self.joint]


@dataclass(frozen=True)
class TrialEffect:
    """Registry entry of one hidden effect.

    Attributes
    ----------
    name : str
        Standard name of the effect.
    per_joint : bool
        Whether the effect acts on one joint, not on the whole arm.
    family : {"library", "further", "outside"}
        ``library``: one of the 24 standard effects; ``further``: a known effect beyond them; ``outside``: an effect in no library.
    kinds : tuple of str
        Kinds of arm on which the effect is possible.
    draw : callable
        Function that returns parameters for a :class:`Draw`.
    apply : callable
        Function that adds the effect to a joint (from 0) of a simulated arm, for one log.
    """

    name: str
    per_joint: bool
    family: str
    kinds: tuple[str, ...]
    draw: Callable[[Draw], Parameters]
    apply: Callable[[SimulatedArm, int, Parameters], None]


#: Kinds of arm on which an effect is possible: those with rotary joints, all, and the arm with two links.
ROTARY = ("pendulum", "two-link")
ANY = ("axis", "pendulum", "two-link")
TWO_LINK = ("two-link",)
#: Hidden effects by name.
REGISTRY: dict[str, TrialEffect] = {}

#: Function that adds an effect to a joint (from 0) of a simulated arm, with the effect's parameters.
Apply = Callable[[SimulatedArm, int, Parameters], None]


def effect(
    name: str,
    draw: Callable[[Draw], Parameters],
    *,
    per_joint: bool = True,
    family: str = "library",
    kinds: tuple[str, ...] = ANY,
) -> Callable[[Apply], Apply]:
    """Return a decorator that registers a function as the one that adds effect ``name`` to a simulated arm."""

    def register(apply: Apply) -> Apply:
        REGISTRY[name] = TrialEffect(name, per_joint, family, kinds, draw, apply)
        return apply

    return register
