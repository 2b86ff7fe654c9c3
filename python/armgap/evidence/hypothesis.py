"""A fitted model of an arm as input of the compiled simulator: parameters, effects, friction smoothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap._renamed import old_names
from armgap.arm.arm import Arm

__all__ = ["EffectInstance", "Hypothesis"]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__)

Array = NDArray[np.float64]

#: Tolerance of the simulator: largest change of a position when it halves its steps, rad or m.
TOLERANCE = 3e-6
#: Effects that change the inertia matrix.
ON_INERTIA = ("rotor_inertia", "rotor_coupling", "payload")
#: Number of points of the lookup table from measured to true positions of an encoder.
TABLE = 4001
#: Number that tells a form of a law, by its name in results: pushes are bells or not, load-dependent friction takes the actuator's torque, and
#: friction that varies with position does so twice per turn.
_FORMS = {
    "rectangle": {"bell": 0.0},
    "bell": {"bell": 1.0},
    "torque": {"of_torque": 1.0},
    "twice_per_turn": {"twice": 1.0},
}


class EffectInstance(NamedTuple):
    """An effect with its joint (from 1; None for the whole arm) and values; `log` is the only log that it acts in, None for all."""

    effect: str
    joint: int | None
    parameters: dict[str, float]
    log: str | None = None

    def on(self, joint: int | None) -> tuple[str, int | None, dict[str, float]]:
        """Return name, joint and values of the effect as the compiled simulator reads them, on a given joint."""
        return self.effect, joint, self.parameters


def at_motor(sides: dict[str, str] | None) -> dict[str, float]:
    """Return `sides` of a cause as 0 or 1 each: encoder at the motor, friction at the motor, and rotor carried by the joints before it."""
    if sides is None:
        return {}
    found = {f"{what}_at_motor": float(sides[what] == "motor") for what in ("encoder", "friction")}
    return {**found, "rotor_rides": float(sides["rotor"] == "rides")}


def form(shape: str | None) -> dict[str, float]:
    """Return the `shape` of a cause's law as a number, by the name of its other form; nothing for effects with one form."""
    return {} if shape is None else _FORMS[shape]


@dataclass(frozen=True)
class Hypothesis:
    """A model of an arm: base parameters, effects and smoothed friction.

    Attributes
    ----------
    arm : Arm
        Arm that gives kind, gravity and link lengths.
    theta : tuple of float
        Parameters of the arm, in the order of its file [SI].
    effects : tuple of EffectInstance
        Effects with their values.
    smoothing : tuple of float
        Width of the smoothed sign of friction of each joint [rad/s]; 0 is dry friction.
    """

    arm: Arm
    theta: tuple[float, ...]
    effects: tuple[EffectInstance, ...] = ()
    #: Width of the rounded sign of friction of every joint, rad/s; none for dry friction.
    smoothing: tuple[float, ...] = ()

    @classmethod
    def of(cls, data: dict[str, Any], arm: Arm) -> Hypothesis:
        """Return the model with causes from a diagnosis' JSON object."""
        found = data["parameters"]["with_causes"]
        effects = tuple(
            EffectInstance(
                c["effect"],
                c["joint"],
                {name: p["value"] for name, p in c["parameters"].items()}
                | at_motor(c.get("sides"))
                | form(c.get("shape")),
                c.get("log"),
            )
            for c in data.get("causes") or []
        )
        options = data.get("options") or {}
        common = [options.get("friction_smoothing") or 0.0] * arm.n_joints
        smoothing = tuple(float(width) for width in options.get("friction_widths") or common)
        return cls(arm, tuple(float(found[name]["value"]) for name in arm.parameter_names), effects, smoothing)

    def only(self, effects: Sequence[EffectInstance]) -> Hypothesis:
        """Return the model with other effects in place of its own."""
        return replace(self, effects=tuple(effects))

    def run(self, t: Array, tau: Array, q0: Array, dq0: Array) -> tuple[Array, Array]:
        """Return positions [rad or m] and velocities under held torques, shape (n_samples, n_joints) each.

        Raises
        ------
        ValueError
            If the motion diverges or cannot be computed within the tolerance.
        """
        arm = self.arm
        lengths = None if arm.link_length is None else arm.link_length.tolist()
        t, tau, q0, dq0 = (np.ascontiguousarray(x, dtype=np.float64) for x in (t, tau, q0, dq0))
        effects, theta = [e.on(e.joint) for e in self.effects], list(self.theta)
        return _native.simulate(
            arm.kind, arm.gravity, lengths, theta, t, tau, q0, dq0, effects, TOLERANCE, self.smoothing
        )

    def inertia(self, q: Array) -> Array:
        """Return inertia matrices at poses `q`, shape (n_poses, n_joints), as an array of shape (n_poses, n_joints, n_joints).

        Raises
        ------
        ValueError
            If there are more effects than the simulator carries.
        """
        arm, inertial = self.arm, [e.on(e.joint) for e in self.effects if e.effect in ON_INERTIA]
        lengths = None if arm.link_length is None else arm.link_length.tolist()
        poses = np.ascontiguousarray(q, dtype=np.float64)
        return _native.inertia(arm.kind, arm.gravity, lengths, list(self.theta), poses, inertial)


def delivered(t: Array, tau: Array, effects: Sequence[EffectInstance]) -> Array:
    """Return the mean torque at the joints in each sample interval, with effects on the command; shape of `tau`.

    In a simulation each joint's command drives a unit mass with these effects only; the acceleration of the mass is the torque.
    """
    found = np.array(tau, dtype=np.float64)
    for joint in {e.joint for e in effects if e.joint is not None}:
        mine = [e.on(1) for e in effects if e.joint == joint]
        column = np.ascontiguousarray(tau[:, [joint - 1]])
        start = np.zeros(1)
        _, speed = _native.simulate("axis", 0.0, None, [1.0, 0.0, 0.0, 0.0], t, column, start, start, mine, 1e-3)
        found[:-1, joint - 1] = np.diff(speed[:, 0]) / np.diff(t)
    return found


def true_positions(q: Array, effects: Sequence[EffectInstance]) -> Array:
    """Return true positions for measured positions `q` with effects on the encoders; shape of `q`.

    A free unit inertia is simulated over the range at constant speed; its encoder readings are the lookup table.
    """
    found = np.array(q, dtype=np.float64)
    for joint in {e.joint for e in effects if e.joint is not None}:
        mine = [e.on(1) for e in effects if e.joint == joint]
        low, high = found[:, joint - 1].min() - 1.0, found[:, joint - 1].max() + 1.0
        t = np.linspace(0.0, 1.0, TABLE)
        shown, _ = _native.simulate(
            "pendulum", 0.0, None, [1.0, 0.0, 0.0, 0.0], t, np.zeros((TABLE, 1)),
            np.array([low]), np.array([high - low]), mine, 1e-9,
        )  # fmt: skip
        found[:, joint - 1] = np.interp(q[:, joint - 1], shown[:, 0], low + (high - low) * t)
    return found
