"""Hide Stribeck friction in a simulated pendulum, then find it from two logs."""

from __future__ import annotations

import numpy as np

from armgap import Arm, Log, diagnose, simulate
from armgap.simulation import Effect

# inertia [kg m^2], m g l [N m], viscous [N m s/rad], Coulomb [N m]; trusted to 10 and 50 %
theta = np.array([0.05, 0.6, 0.02, 0.1])
arm = Arm("pendulum", "pendulum", 9.81, 0.004, theta, sigma=np.array([0.1, 0.1, 0.5, 0.5]) * theta)
hidden = Effect("stribeck", 1, {"amplitude": 0.15, "velocity": 0.3})


def swing(seed: int) -> Log:
    """Eight seconds under five random sines, read with 0.2 mrad of noise."""
    t = np.arange(2000) * arm.sample_period
    draw = np.random.default_rng(seed).uniform(size=(3, 5))
    speed, phase = 0.5 + 8.5 * draw[1], 6 * draw[2]
    tau = (0.1 + 0.3 * draw[0]) * np.sin(np.outer(t, speed) + phase)
    return simulate(arm, t, tau.sum(axis=1), effects=[hidden], noise=2e-4, seed=seed, name=f"swing {seed}")


result = diagnose([swing(1), swing(2)], arm, holdout=swing(3))

print(result.verdict)
for place in result.where:
    print(f"where: joint {place.joint}, {place.regime} ({place.detail}): {place.share:.0%} of the gap")
for cause in result.causes:
    sizes = ", ".join(f"{name} {v.value:.3g} ± {v.sigma:.1g} {v.unit}" for name, v in cause.parameters.items())
    print(f"which: {cause.effect} of joint {cause.joint}: {sizes}")
print(f"how far: {1e3 * result.gap.before[0]:.2f} -> {1e3 * result.gap.after[0]:.2f} mrad on the held-out log")
