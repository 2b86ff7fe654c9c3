"""A geared arm whose model leaves the rotors out: find the rotor inertia, look at the evidence, and check the repaired model."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from armgap import Arm, Log, diagnose, simulate
from armgap.diagnosis.comparison import compare
from armgap.simulation import Effect

arm = Arm.read(Path(__file__).parent / "dfki-double-pendulum.toml")
rotor = Effect("rotor_inertia", 2, {"inertia": 0.004})  # 36 times the motor's own, behind 6:1 gears
SECONDS, NOISE = 6.0, 1e-4


def shake(seed: int, effects: tuple[Effect, ...] = (rotor,)) -> Log:
    """Six sines per joint, read through encoders."""
    t = np.arange(0.0, SECONDS, arm.sample_period)
    draw = np.random.default_rng(seed).uniform(size=(3, 6, 2))
    waves = np.sin(t[:, None, None] * (2.0 + 28.0 * draw[1]) + 6.3 * draw[2])
    tau = ((0.2 + 0.5 * draw[0]) * waves).sum(axis=1) * [1.0, 0.6]
    return simulate(arm, t, tau, effects=effects, noise=NOISE, seed=seed, name=f"shake {seed}")


worn = diagnose(shake(1), arm, holdout=shake(2))
print(worn.summary())
for law in worn.to_dict()["laws"]:
    print(
        f"evidence: over {law['variable']}, the law explains {law['explained']:.0%} of the residual torque of the model without it"
    )
print(worn.to_polars().filter(status="not excited").select("effect", "joint"))

print("\nthe same arm without rotors, diagnosed the same way:")
repaired = diagnose(shake(1, ()), arm, holdout=shake(2, ()))
change = compare(worn, repaired)
print(f"the gap is {change.outcome}: {change.gap[0].factor:.2g} times what it was")
for cause in change.causes:
    print(f"{cause.effect} of joint {cause.joint}: {cause.status} ({cause.why})")
