"""Cases of the second simulator: arm, motions, hidden effects, and the files of a case."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from .dynamics import STEP, simulate, table
from .motions import draw_reference, moves, multisine

Array = np.ndarray
TURN = 2.0 * math.pi
#: Values of both links or joints: mass [kg], length, centre of mass [m], inertia [kg m^2]; viscous [N m s/rad] and Coulomb friction [N m]; largest
#: torque [N m]; and encoder counts per turn.
DESIGNS = {
    "large": ((14.0, 5.0), (0.42, 0.33), (0.17, 0.12), (0.45, 0.09), (1.6, 0.25), (4.5, 1.1), (150.0, 30.0), 262144),
    "small": ((0.7, 0.6), (0.22, 0.28), (0.16, 0.21), (0.010, 0.008), (0.02, 0.012), (0.12, 0.09), (9.0, 6.0), 65536),
}
PERIODS = (0.001, 0.002, 0.0025, 0.004)
#: Encoder counts per turn and sample periods [s] of the family "moves".
COARSE = (4096, 16384, 65536)
SLOW = (0.002, 0.004, 0.01)
#: Relative standard deviations in the arm file: of inertial values, and of friction.
TRUST = (0.05, 0.20)
JOINT_EFFECTS = (
    "torque_offset", "torque_gain", "actuator_lag", "actuator_delay", "torque_saturation", "torque_dead_zone", "torque_ripple",
    "coulomb_asymmetry", "viscous_asymmetry", "stribeck", "quadratic_drag", "load_dependent_friction", "position_dependent_friction",
    "friction_warmup", "joint_spring", "rotor_inertia", "gear_efficiency", "encoder_offset", "encoder_eccentricity", "contact",
)  # fmt: skip
HIDDEN_STATES = ("joint_elasticity", "backlash")
ARM_EFFECTS = ("base_tilt", "payload")
OUTSIDE = ("cross_position", "drift", "product", "random_torque")
#: Effects that are added at a small size to the hidden one in the family "clutter", and act alone in "clutter-only".
SMALL = (
    "torque_offset", "torque_gain", "torque_ripple", "coulomb_asymmetry", "viscous_asymmetry", "stribeck", "quadratic_drag",
    "load_dependent_friction", "position_dependent_friction", "friction_warmup", "joint_spring", "rotor_inertia", "gear_efficiency",
)  # fmt: skip
#: Groups of effects that no motion, or hardly any, can distinguish; two of one group are not put on the same joint.
ALIKE = (
    {"torque_offset", "coulomb_asymmetry", "encoder_offset", "base_tilt"},
    {"torque_gain", "gear_efficiency"},
    {"viscous_asymmetry", "coulomb_asymmetry"},
    {"joint_spring", "position_dependent_friction", "encoder_offset"},
    {"rotor_inertia", "payload", "joint_elasticity", "backlash"},
)
FAMILIES = (
    "single", "pair", "clutter", "clutter-only", "clutter-push", "hidden-state", "hidden-push", "null", "push", "rounding", "presliding",
    "parameters", "outside", "disturbed", "moves",
)  # fmt: skip
#: Standard deviations of the random torque in the family "disturbed", relative to the joint's RMS torque; smallest and largest correlation time [s].
STRENGTHS = (0.02, 0.05, 0.10)
CORRELATION_TIMES = (0.02, 0.5)
#: Smallest and largest width [rad/s] over which the sign of dry friction is smoothed: equal on both joints, and (WIDE) per joint in "rounding".
WIDTHS = (1e-3, 8e-3)
WIDE = (1e-3, 5e-2)
#: Smallest and largest standard deviation [rad] of a joint's encoder zero between recordings, in the families "zeros" and "zeros-null".
ZEROS = (2e-3, 4e-2)
#: Pushes in the families that end in "push": largest number in a log; smallest and largest standard deviation in time [s] of their Gaussian
#: torque, and its peak in Coulomb levels of the joint; least time between two pushes, and from a push to the ends of its log [s].
PUSHES = 3
PUSH_WIDTHS = (0.03, 0.13)
PUSH_PEAKS = (1.5, 4.0)
PUSH_DISTANCE = 0.8


@dataclass
class Machine:
    """Simulated two-link arm with its drives, encoders, friction and hidden effects."""

    design: str
    arm: Array
    joints: list[dict[str, float]]
    limit: Array
    step: Array
    period: float
    tilt: float = 0.0
    payload: tuple[float, float] = (0.0, 1.0)
    sides: list[float] = field(default_factory=lambda: [0.0, 0.0])
    offset: list[float] = field(default_factory=lambda: [0.0, 0.0])
    eccentricity: list[tuple[float, float]] = field(default_factory=lambda: [(0.0, 0.0), (0.0, 0.0)])
    random_torque: list[tuple[float, float]] = field(default_factory=lambda: [(0.0, 0.1), (0.0, 0.1)])
    noise: Array = field(default_factory=lambda: np.zeros(2))
    rotor: list[float] = field(default_factory=lambda: [0.0, 0.0])

    @property
    def theta(self) -> Array:
        """Base parameters of Reyes and Kelly (1997), section 5, then viscous and Coulomb friction; a rotor's inertia is added to its link's."""
        m1, m2, l1, c1, c2, i1, i2, g = self.arm
        third = m2 * c2**2 + i2 + self.rotor[1]
        first = m1 * c1**2 + m2 * l1**2 + i1 + third + self.rotor[0]
        friction = [self.joints[j][name] for name in ("viscous", "coulomb") for j in range(2)]
        return np.array([first, l1 * m2 * c2, third, g * (c1 * m1 + m2 * l1), g * m2 * c2, *friction])

    @property
    def inertia(self) -> Array:
        """Diagonal of the inertia matrix of the stretched arm [kg m^2]."""
        return np.array([self.theta[0] + 2.0 * self.theta[1], self.theta[2]])


def _log_uniform(rng: np.random.Generator, ends: tuple[float, float]) -> float:
    return float(np.exp(rng.uniform(math.log(ends[0]), math.log(ends[1]))))


def draw_machine(rng: np.random.Generator) -> Machine:
    """Draw an arm with random deviations from one of the designs."""
    design = str(rng.choice(list(DESIGNS)))
    mass, length, com, inertia, viscous, coulomb, limit, counts = DESIGNS[design]

    def spread(values: tuple[float, float], width: float = 0.2) -> list[float]:
        return [float(v * rng.uniform(1 - width, 1 + width)) for v in values]

    (m1, m2), (l1, _), (c1, c2), (i1, i2) = spread(mass), spread(length), spread(com), spread(inertia)
    fv, fc = spread(viscous, 0.4), spread(coulomb, 0.4)
    width = _log_uniform(rng, WIDTHS)
    joints = [{"viscous": v, "coulomb": c, "width": width} for v, c in zip(fv, fc, strict=True)]
    step = np.full(2, TURN / counts)
    arm = np.array([m1, m2, l1, c1, c2, i1, i2, 9.81])
    return Machine(design, arm, joints, np.array(limit), step, float(rng.choice(PERIODS)))


@dataclass(frozen=True)
class Run:
    """One simulated log: measured positions and commanded torques, with true positions and velocities."""

    t: Array
    q: Array
    tau: Array
    true_q: Array
    true_dq: Array


def run(machine: Machine, reference: Array, seed: int, zero: Array, pushes: Array | None = None) -> Run:
    """Simulate one log; `seed` decides its noise and random torque, `zero` is the encoder zero per joint [rad]."""
    rng = np.random.default_rng(seed)
    n = len(reference)
    disturbance = np.zeros((n, 4))
    for j, (sd, time) in enumerate(machine.random_torque):
        decay = math.exp(-machine.period / time)
        kicks = rng.standard_normal(n) * sd * math.sqrt(1 - decay**2)
        level = sd * rng.standard_normal()
        for k in range(n):
            level = decay * level + kicks[k]
            disturbance[k, j] = level
        disturbance[:, 2 + j] = machine.noise[j] * rng.standard_normal(n)
    encoder = np.array(
        [[s, z + o, *e, d] for s, z, o, e, d in zip(
            machine.sides, zero, machine.offset, machine.eccentricity, machine.step, strict=True)]
    )  # fmt: skip
    steps = max(1, round(machine.period / STEP))
    q, tau, true_q, true_dq = simulate(
        machine.arm, machine.tilt, np.array(machine.payload), table(machine.joints), encoder, reference, machine.period,
        steps, disturbance, np.zeros((0, 4)) if pushes is None else pushes,
    )  # fmt: skip
    return Run(machine.period * np.arange(n), q, tau, true_q, true_dq)


@dataclass(frozen=True)
class Use:
    """Statistics of a joint's motion by which sizes of effects are chosen: RMS and largest torque, RMS acceleration, speed, range of positions."""

    torque: float
    peak: float
    acceleration: float
    speed: float
    low: float
    high: float
    slew: float


def use_of(runs: list[Run], j: int) -> Use:
    """Return the statistics of the motion of joint `j`, from 0, over all logs."""
    tau = np.concatenate([r.tau[:, j] for r in runs])
    dq = [r.true_dq[:, j] for r in runs]
    ddq = np.concatenate([np.gradient(d, r.t[1]) for d, r in zip(dq, runs, strict=True)])
    q = np.concatenate([r.true_q[:, j] for r in runs])
    return Use(
        float(np.sqrt(np.mean(tau**2))), min(float(np.max(np.abs(r.tau[:, j]))) for r in runs),
        float(np.sqrt(np.mean(ddq**2))), float(np.sqrt(np.mean(np.concatenate(dq) ** 2))),
        float(np.quantile(q, 0.02)), float(np.quantile(q, 0.98)),
        float(np.sqrt(np.mean(np.concatenate([np.gradient(r.tau[:, j], r.t[1]) for r in runs]) ** 2))),
    )  # fmt: skip


def hide(machine: Machine, name: str, j: int, share: float, use: Use, rng: np.random.Generator) -> dict[str, float]:
    """Put an effect of about `share` of the joint's RMS torque into a machine; return the values of its parameters."""
    p, torque = machine.joints[j], share * use.torque
    sign = float(rng.choice([-1.0, 1.0]))
    load = abs(machine.theta[3 + j]) * 0.5
    values: dict[str, float] = {}
    match name:
        case "torque_offset":
            values = {"offset": sign * torque}
        case "torque_gain":
            values = {"gain": 1.0 + sign * share}
        case "actuator_lag" | "actuator_delay":
            late = min(torque / use.slew, 0.03)
            values = {
                "lag" if name == "actuator_lag" else "late": p.get("lag" if name == "actuator_lag" else "late", 0.0)
                + late
            }
        case "torque_saturation":
            values = {"saturation": use.peak * (1.0 - 1.2 * share)}
        case "torque_dead_zone":
            values = {"dead_zone": torque}
        case "torque_ripple":
            n = round(rng.uniform(2.0, 7.0) * TURN / (use.high - use.low))
            values = {
                "ripple": 1.4 * torque,
                "ripple_n": float(n),
                "ripple_phase": float(rng.uniform(-math.pi, math.pi)),
            }
        case "coulomb_asymmetry":
            values = {"asymmetry": sign * torque}
        case "viscous_asymmetry":
            values = {"viscous_asymmetry": sign * torque / use.speed}
        case "stribeck":
            values = {"stribeck": 2.5 * torque, "stribeck_velocity": use.speed * float(rng.uniform(0.05, 0.3))}
        case "presliding":
            values = {"bristle": 1.5 * torque, "bristle_path": (use.high - use.low) * _log_uniform(rng, (1e-3, 1e-2))}
        case "quadratic_drag":
            values = {"quadratic": 0.7 * torque / use.speed**2}
        case "load_dependent_friction":
            values = {"load": torque / load}
        case "position_dependent_friction":
            phase = rng.uniform(0, TURN)
            values = {"cos_friction": torque * math.cos(phase), "sin_friction": torque * math.sin(phase)}
        case "friction_warmup":
            values = {"warm": torque / p["coulomb"], "warm_time": float(rng.uniform(2.0, 6.0))}
        case "joint_spring":
            values = {"spring": 2.5 * torque / (use.high - use.low), "spring_q0": float(rng.uniform(use.low, use.high))}
        case "rotor_inertia":
            values = {"armature": torque / use.acceleration}
        case "gear_efficiency":
            values = {"efficiency_loss": 1.4 * share}
        case "contact":
            at = use.high - share * (use.high - use.low) if sign > 0 else use.low + share * (use.high - use.low)
            if at * sign < 0.05:
                at = sign * 0.05
            k = 20.0 * use.torque / (use.high - use.low)
            values = {"stop": at, "stop_stiffness": k, "stop_damping": 0.2 * math.sqrt(k * machine.inertia[j])}
        case "encoder_offset":
            machine.offset[j] += sign * torque / (2.0 * load)
            return {"offset": machine.offset[j]}
        case "encoder_eccentricity":
            phase = rng.uniform(0, TURN)
            size = torque / (2.0 * load)
            machine.eccentricity[j] = (size * math.cos(phase), size * math.sin(phase))
            return {"cos": machine.eccentricity[j][0], "sin": machine.eccentricity[j][1]}
        case "base_tilt":
            machine.tilt = sign * torque / (2.0 * load)
            return {"angle": machine.tilt}
        case "payload":
            distance = float(rng.uniform(0.7, 1.2) * machine.arm[4] * 1.5)
            mass = share * 2.0 * machine.arm[1] * machine.arm[4] / distance
            machine.payload = (mass, distance)
            return {"mass": mass, "distance": distance}
        case "cross_position":
            values = {"cross_position": 2.0 * torque}
        case "drift":
            values = {"drift": sign * torque / 5.0}
        case "product":
            values = {"product": sign * torque / (use.speed * 0.5 * (use.high - use.low))}
        case "random_torque":
            machine.random_torque[j] = (torque, _log_uniform(rng, CORRELATION_TIMES))
            return {"sd": torque, "time": machine.random_torque[j][1]}
        case _:
            raise ValueError(name)
    p.update(values)
    return values


def hide_transmission(
    machine: Machine, name: str, j: int, size: float, use: Use, rng: np.random.Generator
) -> dict[str, float]:
    """Put joint elasticity or backlash between motor and link; whether encoder and friction are on the motor side is drawn."""
    p = machine.joints[j]
    rotor = (
        machine.inertia[j] * float(np.exp(rng.uniform(math.log(0.05), math.log(0.25))))
        if j
        else 0.15 * machine.inertia[0]
    )
    link = machine.inertia[j]
    machine.rotor[j] = rotor
    side = float(rng.uniform() < 0.6)
    machine.sides[j] = side
    p["friction_at_motor"] = float(rng.uniform() < 0.6) if rng.uniform() < 0.3 else side
    p["rotor"] = rotor
    if name == "joint_elasticity":
        hertz = 25.0 * (6.0 / 25.0) ** size
        p["shaft"] = link * rotor / (link + rotor) * (TURN * hertz) ** 2
        p["shaft_damping"] = 2 * 0.05 * math.sqrt(p["shaft"] * link * rotor / (link + rotor))
    else:
        p["play"] = 0.002 * (0.03 / 0.002) ** size
        p["shaft"] = rotor * 1500.0**2
        p["shaft_damping"] = 2 * 0.3 * rotor * 1500.0
    return {k: p[k] for k in ("rotor", "shaft", "play", "friction_at_motor") if k in p} | {"encoder_at_motor": side}


def draw_pushes(rng: np.random.Generator, machine: Machine, duration: float) -> Array:
    """Draw the pushes of one log, rows ``[joint, time, width, impulse]`` as `simulate` takes them."""
    rows: list[list[float]] = []
    for _ in range(int(rng.integers(0, PUSHES + 1))):
        j, time = int(rng.integers(2)), float(rng.uniform(PUSH_DISTANCE, duration - PUSH_DISTANCE))
        width = _log_uniform(rng, PUSH_WIDTHS)
        peak = float(rng.choice([-1.0, 1.0])) * _log_uniform(rng, PUSH_PEAKS) * machine.joints[j]["coulomb"]
        if all(abs(time - row[1]) > PUSH_DISTANCE for row in rows):
            rows.append([float(j), time, width, peak * width * math.sqrt(TURN)])
    return np.array(rows).reshape(-1, 4)


def requests(families: tuple[str, ...]) -> list[tuple[str, int | None]]:
    """Return pairs of each of the given effects and a joint (1 or 2; None for an effect of the whole arm)."""
    return [(name, j) for name in families for j in ((1, 2) if name not in ARM_EFFECTS else (None,))]


def _beside(rng: np.random.Generator, main: str | None) -> list[tuple[str, int | None]]:
    taken = {name for group in ALIKE if main in group for name in group} | {main}
    offered = [w for w in requests(SMALL) if w[0] not in taken]
    chosen: list[tuple[str, int | None]] = []
    count = int(rng.integers(3, 6))
    for i in rng.permutation(len(offered)):
        name, j = offered[int(i)]
        near = {n for group in ALIKE if name in group for n in group} | {name}
        if len(chosen) < count and not any(n in near and k == j for n, k in chosen):
            chosen.append((name, j))
    return chosen


def make(seed: tuple[int, int], family: str, folder: Path, duration: float = 10.0) -> dict[str, Any]:
    """Make the files of one case in a folder; return its key."""
    for attempt in range(20):
        key = _make(np.random.default_rng([*seed, attempt]), family, folder, duration)
        if key is not None:
            key["seed"] = list(seed)
            (folder / "key.json").write_text(json.dumps(key, indent=1))
            return key
    raise RuntimeError(f"no motion for {seed}")


def _make(rng: np.random.Generator, family: str, folder: Path, duration: float) -> dict[str, Any] | None:
    machine = draw_machine(rng)
    if family == "rounding":
        for p in machine.joints:
            p["width"], p["algebraic"] = _log_uniform(rng, WIDE), float(rng.uniform() < 0.5)
    if family == "moves":
        machine.step, machine.period = np.full(2, TURN / float(rng.choice(COARSE))), float(rng.choice(SLOW))
    cluttered = family.startswith("clutter")
    with_zeros = family.startswith("zeros")
    training = 3 if with_zeros else 2 if cluttered else 1
    names = [*(f"train-{i + 1}" for i in range(training)), "holdout-1"]
    path = moves if family == "moves" else multisine
    references = [draw_reference(rng, machine, duration, path) for _ in names]
    seeds = [int(s) for s in rng.integers(0, 2**31, len(names))]
    nothing = np.zeros(2)
    plain = [run(machine, r, s, nothing) for r, s in zip(references, seeds, strict=True)]
    if not all(_sane(r) for r in plain):
        return None
    uses = [use_of(plain, j) for j in range(2)]
    nominal_theta, zeros = machine.theta, [nothing for _ in names]
    small: list[dict[str, Any]] = []
    mains = _draw_mains(rng, family)
    if cluttered:
        for name, joint in _beside(rng, mains[0][0] if mains else None):
            j = (joint or 1) - 1
            share = float(np.exp(rng.uniform(math.log(0.006), math.log(0.03))))
            values = hide(machine, name, j, share, uses[j], rng)
            small.append({"effect": name, "joint": joint, "parameters": values, "share": share})
        zeros = [rng.normal(0.0, 0.002, 2) for _ in names]
        machine.random_torque = [
            (float(rng.uniform(0.002, 0.01)) * u.torque, float(rng.uniform(0.05, 0.5))) for u in uses
        ]
        if not any(name in ("actuator_lag", "actuator_delay") for name, _ in mains):
            loop = float(rng.uniform(0.002, 0.005))
            for p in machine.joints:
                p["lag"] = loop
        for p in machine.joints:
            p["late"] = float(rng.uniform(0.0, 1.0)) * machine.period
    strength = float(rng.choice(STRENGTHS)) if family == "disturbed" else None
    if strength:
        machine.random_torque = [(strength * u.torque, _log_uniform(rng, CORRELATION_TIMES)) for u in uses]
    if with_zeros:
        spread = [_log_uniform(rng, ZEROS) for _ in range(2)]
        zeros = list(rng.normal(0.0, spread, (len(names), 2)))
    without = [run(machine, r, s, z) for r, s, z in zip(references, seeds, zeros, strict=True)]
    effects: list[dict[str, Any]] = []
    for name, joint in mains:
        j = (joint or 1) - 1
        if name in HIDDEN_STATES:
            values = hide_transmission(machine, name, j, float(rng.uniform()), uses[j], rng)
            nominal_theta = machine.theta
        else:
            share = float(np.exp(rng.uniform(math.log(0.04), math.log(0.3))))
            values = hide(machine, name, j, share, uses[j], rng)
        effects.append({"effect": name, "joint": joint, "parameters": values})
    pushes = [draw_pushes(rng, machine, duration) if family.endswith("push") else np.zeros((0, 4)) for _ in names]
    runs = [run(machine, *of) for of in zip(references, seeds, zeros, pushes, strict=True)]
    if not all(_sane(r) for r in [*runs, *without]):
        return None
    exact = family in ("null", "rounding") or (family not in ("parameters", "disturbed") and rng.uniform() < 0.5)
    trust = np.repeat(TRUST, [5, 4])
    stated = nominal_theta * (1.0 + (0.0 if exact else 1.0) * trust * np.clip(rng.standard_normal(9), -2.5, 2.5))
    folder.mkdir(parents=True, exist_ok=True)
    listed = [
        {"log": name, "joint": int(j) + 1, "time": time, "width": width, "impulse": impulse}
        for name, of in zip(names, pushes, strict=True)
        for j, time, width, impulse in of.tolist()
    ]
    (folder / "arm.toml").write_text(_arm_file(machine, stated, trust * np.abs(stated)))
    _write(folder, names, runs)
    key = {
        "family": family, "design": machine.design, "effects": effects, "clutter": small, "exact": exact,
        "pushes": listed, "zeros": np.round(zeros, 6).tolist(), "theta": nominal_theta.tolist(), "strength": strength,
        "rounding": [{k: p[k] for k in ("width", "algebraic") if k in p} for p in machine.joints],
    }  # fmt: skip
    if cluttered and mains:
        (folder / "without").mkdir(exist_ok=True)
        _write(folder / "without", names, without)
    return key


def _draw_mains(rng: np.random.Generator, family: str) -> list[tuple[str, int | None]]:
    """Draw the hidden effects of a case, with joints: two that motion can distinguish in the family "pair", one or none otherwise."""
    known = requests(JOINT_EFFECTS) + requests(ARM_EFFECTS)
    offered = {
        "single": known,
        "pair": known,
        "clutter": known,
        "zeros": known,
        "moves": known + requests(HIDDEN_STATES),
        "hidden-state": requests(HIDDEN_STATES),
        "hidden-push": requests(HIDDEN_STATES),
        "presliding": requests(("presliding",)),
        "outside": requests(OUTSIDE),
    }.get(family, [])
    if not offered:
        return []
    first = offered[int(rng.integers(len(offered)))]
    if family != "pair":
        return [first]
    alike = {name for group in ALIKE if first[0] in group for name in group} | {first[0]}
    others = [request for request in offered if request[0] not in alike]
    return [first, others[int(rng.integers(len(others)))]]


def _sane(r: Run) -> bool:
    return (
        bool(np.all(np.isfinite(r.true_q)))
        and bool(np.max(np.abs(r.true_q)) < 4.0)
        and bool(np.max(np.abs(r.true_dq)) < 25.0)
    )


def _write(folder: Path, names: list[str], runs: list[Run]) -> None:
    for name, r in zip(names, runs, strict=True):
        columns = {"t": r.t} | {f"{kind}{j + 1}": x[:, j] for kind, x in (("q", r.q), ("tau", r.tau)) for j in range(2)}
        pl.DataFrame(columns).write_parquet(folder / f"{name}.parquet")


def _arm_file(machine: Machine, theta: Array, sigma: Array) -> str:
    def listed(values: Array) -> str:
        return "[" + ", ".join(repr(float(v)) for v in values) + "]"

    lines = [
        'name = "second simulator"', 'kind = "two-link"', "gravity = 9.81", f"sample_period = {machine.period!r}",
        "[inertial]", f"theta = {listed(theta[:5])}", f"sigma = {listed(sigma[:5])}",
        "[friction]", f"viscous = {listed(theta[5:7])}", f"coulomb = {listed(theta[7:])}",
        f"sigma_viscous = {listed(sigma[5:7])}", f"sigma_coulomb = {listed(sigma[7:])}",
        "[encoder]", f"counts_per_rev = {[round(TURN / s) for s in machine.step]}",
        "[actuator]", f"torque_limit = {listed(machine.limit)}",
        "[geometry]", f"link_length = [{float(machine.arm[2])!r}, {float(1.5 * machine.arm[4])!r}]", "",
    ]  # fmt: skip
    return "\n".join(lines)
