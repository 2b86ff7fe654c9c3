"""Add measured torques to logs of blind cases, and ask for the stage of the drive chain at which the gap arises.

Each case hides one effect, in the drive (between command and torque) or in the mechanics. The measured torque is that of the generator's
actuator at the log's times, with white noise of 1 % of its RMS. An answer is right if the stage with the largest share is the effect's stage.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from tests.input_defects.case import toml
from tests.input_defects.making import Kept, make, read, trial_plans
from tests.input_defects.true_floor import arm_of

THREADS = ("RAYON_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS")
DRIVE = (
    "actuator_delay", "actuator_lag", "torque_gain", "torque_saturation", "torque_dead_zone", "motor_hysteresis", "slew_limit",
)  # fmt: skip
#: Effects in the mechanics: behind the drive, and not in a sensor.
MECHANICS = (
    "stribeck", "quadratic_drag", "cubic_drag", "coulomb_asymmetry", "viscous_asymmetry", "load_dependent_friction", "position_dependent_friction",
    "friction_warmup", "joint_spring", "hardening_spring", "rotor_inertia", "rotor_coupling", "contact", "payload", "base_tilt", "torque_offset",
    "cross_friction", "presliding",
)  # fmt: skip
NOISE, HORIZON = 0.01, 0.25


def main() -> None:
    """Print the answer and its correctness for every case that hides one effect at a known stage."""
    parser = argparse.ArgumentParser(prog="python -m tests.drive_stage", description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument(
        "--cases", type=int, required=True, metavar="N", help="size of the trial that cases are drawn from"
    )
    parser.add_argument(
        "--each", type=int, default=30, metavar="K", help="cases asked of either stage, the first of the trial"
    )
    parser.add_argument("--cache", type=Path, required=True, metavar="DIR", help="where cases are kept")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    os.environ.update(dict.fromkeys(THREADS, "1"))
    wanted = list(_wanted(options))
    right = {"drive": 0, "mechanics": 0}
    asked = dict(right)
    with ProcessPoolExecutor(options.jobs) as pool:
        for stage, name, found in pool.map(_asked, *zip(*wanted, strict=True)):
            asked[stage] += 1
            right[stage] += found.startswith(stage)
            print(name, stage, "->", found, flush=True)
    for stage, count in asked.items():
        print(f"{stage}: {right[stage]} of {count}")


def _wanted(options: argparse.Namespace) -> Iterator[tuple[str, Path]]:
    """Yield stage and folder of the first visible cases with one effect in the drive or in the mechanics; make those that are missing."""
    left = {"drive": options.each, "mechanics": options.each}
    for name, plan in trial_plans(options.seed, options.cases, 10.0).items():
        hidden = [wish[0] if isinstance(wish, tuple) else wish for wish in plan.effects]
        stage = next(
            (s for s, effects in (("drive", DRIVE), ("mechanics", MECHANICS)) if hidden and hidden[0] in effects), None
        )
        if len(hidden) != 1 or stage is None or not left[stage]:
            continue
        if make(plan, options.cache / name) and read(options.cache / name).key.details.get("visible", True):
            left[stage] -= 1
            yield stage, options.cache / name
    if any(left.values()):
        print(f"too few cases: {left} are missing", file=sys.stderr)


def delivered(case: Kept, log: str, rng: np.random.Generator) -> np.ndarray:
    """Return the torque that reaches the joints at the log's times [N m or N], (n_samples, n_joints), with noise of a share `NOISE` of its RMS."""
    from armgap.trial.cases.case import simulated_arm_of
    from armgap.trial.simulation.plant import Plant

    rig = simulated_arm_of(arm_of(case), case.key.effects, log)
    plant = Plant(rig.config)
    torque = np.zeros_like(case.inputs.logs[log].tau)
    now = list(case.inputs.logs[log].tau[0])
    for k, command in enumerate(case.inputs.logs[log].tau.tolist()):
        torque[k] = now
        for _ in range(plant.steps_per_sample):
            now = [a(u, plant.dt) for a, u in zip(rig.actuators, command, strict=True)]
    size = np.sqrt(np.mean(torque**2, axis=0))
    return np.asarray(torque + NOISE * size * rng.standard_normal(torque.shape))


def _asked(stage: str, folder: Path) -> tuple[str, str, str]:
    """Return the hidden effect's stage, name and effect of the case, and the three stages with the largest shares of the gap, largest first."""
    from armgap import Arm, Log
    from armgap.diagnosis.drive_chain import drive_chain

    case = read(folder)
    rng = np.random.default_rng(int(folder.name.split("-")[3]))
    text = folder / "unsealed.toml"
    text.write_text(toml(case.inputs.arm), encoding="utf-8")
    arm = Arm.read(text)
    groups = [
        [Log.from_arrays(t.t, t.q, t.tau, name=name, tau_meas=delivered(case, name, rng)) for name, t in logs.items()]
        for logs in (case.inputs.training, case.inputs.holdout)
    ]
    chain = drive_chain(arm, *groups, horizon=HORIZON, floor=list(case.truth.step))
    shares: dict[str, float] = {}
    for entry in chain:
        shares[entry["stage"]] = shares.get(entry["stage"], 0.0) + entry["share"]
    ordered = sorted(shares, key=lambda s: -shares[s])
    hidden = ", ".join(f"{effect}:{joint}" for effect, joint in case.hidden)
    return stage, f"{folder.name} ({hidden})", ", ".join(f"{s} {shares[s]:.2f}" for s in itertools.islice(ordered, 3))


if __name__ == "__main__":
    main()
