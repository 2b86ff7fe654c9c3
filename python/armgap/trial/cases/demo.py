"""Demo case: one arm, one hidden effect, two logs, all drawn from one seed.

``python -m armgap.trial --seed 7 -o folder`` makes the demo case of seed 7.
"""

from __future__ import annotations

import numpy as np

from armgap.trial.cases.case import Case, NoMotionError, make_case

#: Seed of the demo case in the package.
DEMO_SEED = 1997
#: Effects that the demo case may hide.
DEMO_EFFECTS = (
    "actuator_delay",
    "actuator_lag",
    "base_tilt",
    "coulomb_asymmetry",
    "payload",
    "quadratic_drag",
    "rotor_inertia",
    "stribeck",
    "torque_gain",
    "torque_offset",
)
#: Effects of `DEMO_EFFECTS` that act on the whole arm, not on one joint.
WHOLE_ARM = ("base_tilt", "payload")
SAMPLE_PERIOD = 0.0025  # sample period of the demo case's logs, s, as in Reyes and Kelly (1997)
#: Largest number of seeds tried until one gives the demo case an acceptable motion.
RETRIES = 10


def make_demo_case(seed: int = DEMO_SEED) -> Case:
    """Make the demo case of a seed: arm, effect, joint, size and motions are all drawn from it.

    Parameters
    ----------
    seed : int, default 1997
        Seed of all draws.

    Raises
    ------
    NoMotionError
        No acceptable motion was found, which is rare; another seed helps.
    """
    rng = np.random.default_rng([seed, 0])
    effect = str(rng.choice(DEMO_EFFECTS))
    joint = None if effect in WHOLE_ARM else int(rng.integers(1, 3))
    size, model = float(rng.uniform(0.3, 0.9)), str(rng.choice(["direct-drive", "geared"], p=[0.7, 0.3]))
    for attempt in range(1, RETRIES + 1):
        try:
            return make_case([seed, attempt], [(effect, joint)], model=model, size=size, sample_period=SAMPLE_PERIOD)
        except NoMotionError:
            continue
    raise NoMotionError(f"no motion for demo seed {seed}; take another")
