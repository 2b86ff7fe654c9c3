"""The seed's direct-drive arm: estimate its nine parameters, then find the asymmetric friction that Table I gives joint 1."""

from __future__ import annotations

import numpy as np

from armgap import Arm, Log, diagnose, identify, seed_torque, simulate
from armgap.simulation import Effect

# Reyes and Kelly (1997), Table I, friction of joint 1 at the mean of its two directions: inertial, viscous, Coulomb
theta = np.array([2.352, 0.0838, 0.1019, 38.466, 1.827, 2.288, 0.175, 7.6095, 1.734])
trust = np.array([0.05] * 5 + [0.3] * 4)
arm = Arm(
    "Reyes-Kelly direct-drive arm",
    "two-link",
    9.81,
    0.0025,
    theta,
    sigma=trust * theta,
    counts_per_rev=np.array([1_024_000.0, 655_360.0]),
    link_length=np.array([0.45, 0.30]),
)
asymmetry = Effect("coulomb_asymmetry", 1, {"delta": -0.4405})


def run(name: str, seconds: float, late: float = 0.0) -> Log:
    """The paper's torques, from some time on."""
    t = np.arange(round(seconds / arm.sample_period)) * arm.sample_period
    return simulate(arm, t, seed_torque(t + late), effects=[asymmetry], name=name)


training, held = run("training", 6.0), run("holdout", 4.0, late=30.0)

print("filtered dynamic model, exact filters:")
estimate = identify(training, arm, scheme="filtered-dynamic")
for name, found, true in zip(arm.parameter_names, estimate.theta, theta, strict=True):
    print(f"  {name:9} {found:8.4f}, Table I {true:8.4f}")

diagnosis = diagnose(training, arm, holdout=held)
print(diagnosis.summary())
