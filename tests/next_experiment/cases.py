"""Arms with a hidden effect, a small first motion, and motions played in MuJoCo under a PD controller."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import armgap
from armgap.arm import MotionLimits
from armgap.evidence.hypothesis import EffectInstance, Hypothesis
from armgap.planning.criterion import HypothesisPair, PredictedMotion, Rest, Setting
from armgap.planning.dynamics import inverse_dynamics
from armgap.planning.limits import MARGIN, TORQUE_MARGIN
from armgap.planning.open_questions.questions import known_model
from armgap.trial.cases.armfile import arm_toml, draw_nominal
from armgap.trial.cases.case import simulated_arm_of
from armgap.trial.cases.key import HiddenEffect
from armgap.trial.effects.drive import BACKLASH_ROTOR
from armgap.trial.simulation.arms import AXIS, DIRECT_DRIVE, GEARED, PENDULUM, TURN, TrialArm
from armgap.trial.simulation.simulated_arm import CommandSource, Trace, run

Array = NDArray[np.float64]

#: Bandwidth of the PD controllers, rad/s.
BANDWIDTH = 14.0
#: Duration of the small first motion, s; share of the range of positions that it covers; its frequencies, Hz.
POOR_S, POOR_PART, POOR_HZ = 4.0, 0.08, (0.3, 0.5)
#: Number of harmonics of the standard multisine, and its base frequency, Hz.
HARMONICS, BASE_HZ = 5, 0.2
REST = 0.2

LIMITS = {
    "direct-drive": ((-1.5, -2.0), (1.5, 2.0), (3.0, 5.0), (20.0, 60.0)),
    "geared": ((-1.8, -2.0), (1.8, 2.0), (6.0, 6.0), (40.0, 60.0)),
    "pendulum": ((-2.0,), (2.0,), (6.0,), (60.0,)),
    "axis": ((-0.45,), (0.45,), (0.8,), (8.0,)),
}
#: Share of the rotor in the inertia of joint 2 of the geared arm in the simulator.
ROTOR_SHARE = BACKLASH_ROTOR * GEARED.inertia[1] / GEARED.joint_inertia[1]
#: Encoder steps, rad and m: coarse, because with fine ones the small first motion would already determine the effects.
STEP, LINEAR_STEP = TURN / 20_000, 2e-5
ARMS = {
    "direct-drive": replace(DIRECT_DRIVE, step=(STEP, STEP)),
    "geared": replace(GEARED, step=(STEP, STEP)),
    "pendulum": replace(PENDULUM, step=(STEP,)),
    "axis": replace(AXIS, step=(LINEAR_STEP,)),
}


@dataclass(frozen=True)
class Case:
    """Arm, hidden effect with its joint and parameters, and the true arm if it was drawn at random."""

    arm: str
    effect: str
    joint: int | None
    parameters: dict[str, float]
    machine: TrialArm | None = None

    @property
    def name(self) -> str:
        where = "" if self.joint is None else f":{self.joint}"
        return f"{self.arm} {self.effect}{where}"

    @property
    def asked(self) -> str:
        return self.effect if self.joint is None else f"{self.effect}:{self.joint}"


CASES = (
    Case("direct-drive", "stribeck", 2, {"amplitude": 0.06, "velocity": 0.05}),
    Case("direct-drive", "quadratic_drag", 1, {"c": 0.1}),
    Case("direct-drive", "joint_spring", 2, {"k": 0.1, "q0": 0.4}),
    Case("direct-drive", "torque_saturation", 2, {"level": 6.0}),
    Case("geared", "backlash", 2, {"gap": 0.02, "rotor_share": ROTOR_SHARE, "riding": 0.0}),
    Case("geared", "torque_ripple", 2, {"amplitude": 0.012, "n": 7.0, "phase": 0.5}),
    Case("geared", "load_dependent_friction", 1, {"mu": 0.008}),
    Case("pendulum", "presliding", 1, {"amplitude": 0.06, "stiffness": 400.0}),
    Case("pendulum", "encoder_eccentricity", 1, {"a": 0.001, "b": -0.001}),
    Case("axis", "viscous_asymmetry", 1, {"delta": 0.8}),
)


@dataclass(frozen=True)
class Reference:
    """Reference of a motion: positions, velocities and feed-forward torques at the samples, shape (n_samples, n_joints) each."""

    q: Array
    dq: Array
    tau: Array

    def source(self, arm: TrialArm) -> CommandSource:
        """Return a PD controller on measured positions that follows the reference, with its feed-forward torque."""
        inertia = np.array(arm.joint_inertia)
        kp, kd = inertia * BANDWIDTH**2, 1.4 * inertia * BANDWIDTH
        limit = np.array(arm.torque_limit)
        last: list[Array] = []

        def command(t: float, q: list[float]) -> list[float]:
            k = min(round(t / arm.sample_period), len(self.q) - 1)
            measured = np.array(q)
            speed = (measured - last.pop()) / arm.sample_period if last else np.zeros(len(q))
            last.append(measured)
            tau = self.tau[k] + kp * (self.q[k] - measured) + kd * (self.dq[k] - speed)
            return [float(x) for x in np.clip(tau, -limit, limit)]

        return command


@dataclass(frozen=True)
class Sampled:
    """Reference as a motion that the computation of evidence takes: values between the samples are interpolated."""

    t: Array
    reference: Reference

    @property
    def duration(self) -> float:
        return float(self.t[-1])

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Return positions, velocities and accelerations at the times `t` [s], shape (n_times, n_joints) each."""
        r = self.reference
        every = (r.q, r.dq, np.gradient(r.dq, self.t, axis=0))
        found = [np.column_stack([np.interp(t, self.t, x[:, j]) for j in range(x.shape[1])]) for x in every]
        return found[0], found[1], found[2]


def library_values(case: Case) -> dict[str, float]:
    """Return the hidden effect's values as the library has them: with the rotor's share, which the simulator fixes, for backlash."""
    if case.effect != "backlash":
        return case.parameters
    arm, j = case.machine or ARMS[case.arm], (case.joint or 1) - 1
    share = BACKLASH_ROTOR * arm.inertia[j] / arm.joint_inertia[j]
    return {"rotor_share": share, "riding": 0.0, **case.parameters}


def expected(
    case: Case, before: armgap.Diagnosis, arm_file: Path, reference: Reference, threshold: float
) -> tuple[float, float]:
    """Return the expected log-likelihood ratio of the hidden effect, at its true size, to its absence, and the probability of a decision."""
    arm = armgap.Arm.read(arm_file)
    model, _ = known_model(before.to_dict(), arm)
    t = arm.sample_period * np.arange(len(reference.q))
    without = tuple(e for e in model.effects if (e.effect, e.joint) != (case.effect, case.joint))
    hidden = EffectInstance(case.effect, case.joint, library_values(case))
    setting = Setting.of(before.to_dict(), model)
    # The true arm leaves noise alone.
    noise = Rest.of(np.zeros(arm.n_joints), setting.sigma)
    played = PredictedMotion(setting, Sampled(t, reference))  # type: ignore[arg-type]
    outcome = played.outcome(HypothesisPair(((1.0, (*without, hidden)),), without, rest=noise))
    return outcome.expected, outcome.settled(threshold)


def limits_toml(model: str) -> str:
    """Return the motion limits of an arm model as a table of an arm file."""
    keys = ("position_min", "position_max", "speed", "acceleration")
    return "\n[limits]\n" + "".join(f"{k} = {list(v)}\n" for k, v in zip(keys, LIMITS[model], strict=True))


def write_arm(case: Case, seed: int, folder: Path) -> tuple[TrialArm, Path]:
    """Return the true arm, and the path of an arm file with values that differ from it by random draws from their standard deviations."""
    arm = case.machine or ARMS[case.arm]
    nominal = draw_nominal(np.random.default_rng([seed, 7]), arm, exact=False)
    text = arm_toml(arm, nominal, case.name, "0" * 64) + limits_toml(case.arm)
    path = folder / "arm.toml"
    path.write_text(text, encoding="utf-8")
    return arm, path


def play(case: Case, arm: TrialArm, reference: Reference, *, hidden: bool = True) -> Trace:
    """Simulate the arm under the controller that follows a reference, with the hidden effect or without it."""
    effects = [HiddenEffect(case.effect, case.joint, case.parameters, None, "library")] if hidden else []
    duration = (len(reference.q) - 1) * arm.sample_period
    return run(simulated_arm_of(arm, effects, "log"), reference.source(arm), duration)


def poor(arm: TrialArm, model: str) -> Reference:
    """Return the small, slow and short first motion: two sines per joint."""
    low, high = (np.array(x) for x in LIMITS[model][:2])
    t = arm.sample_period * np.arange(round(POOR_S / arm.sample_period) + 1)
    size = 0.5 * POOR_PART * (high - low)
    q = sum(
        np.outer(np.ones_like(t), 0.5 * size) * np.sin(2 * math.pi * f * t[:, None] + np.arange(len(size)))
        for f in POOR_HZ
    )
    fade = np.minimum(np.minimum(t, t[-1] - t) / 0.5, 1.0)[:, None]
    q = np.asarray(q) * fade * fade * (3 - 2 * fade)
    return Reference(q, np.gradient(q, t, axis=0), np.zeros_like(q))


def multisine(arm_file: Path, model: str, duration: float, seed: int) -> Reference:
    """Return a random multisine of :data:`HARMONICS` harmonics, as large as the arm file's limits allow."""
    arm = armgap.Arm.read(arm_file)
    assert arm.limits is not None
    limits: MotionLimits = arm.limits
    rng = np.random.default_rng([seed, 11])
    h, n = arm.sample_period, arm.n_joints
    t = h * np.arange(round(duration / h) + 1)
    k = np.arange(1, HARMONICS + 1)
    phase, share = rng.uniform(0, 2 * math.pi, (n, HARMONICS)), rng.uniform(0.4, 1.0, (n, HARMONICS)) / np.sqrt(k)
    wave = np.einsum("jk,tjk->tj", share, np.sin(2 * math.pi * BASE_HZ * k * t[:, None, None] + phase))
    x = np.clip(np.minimum(t - REST, t[-1] - REST - t) / 1.0, 0.0, 1.0)[:, None]
    wave = wave * x**3 * (10 - 15 * x + 6 * x * x)
    rate, bend = (np.gradient(wave, h, axis=0), np.gradient(np.gradient(wave, h, axis=0), h, axis=0))
    room = np.minimum(limits.position_max, -limits.position_min)
    ratio = [
        np.max(np.abs(w), axis=0) / (MARGIN * m)
        for w, m in ((wave, room), (rate, limits.speed), (bend, limits.acceleration))
    ]
    scale = 1.0 / np.max(ratio, axis=0)
    model_of = Hypothesis(arm, tuple(arm.theta))
    while True:
        tau = inverse_dynamics(model_of, wave * scale, rate * scale, bend * scale)
        if arm.torque_limit is None or np.all(np.abs(tau) <= TORQUE_MARGIN * arm.torque_limit):
            return Reference(wave * scale, rate * scale, tau)
        scale = 0.95 * scale


def log_of(trace: Trace, name: str) -> armgap.Log:
    """Return the log of a played motion: measured positions and torques without velocities."""
    return armgap.Log(name, trace.t, trace.q, trace.tau, None)
