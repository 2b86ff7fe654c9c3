"""Physical consistency of the estimated links of a serial arm."""

from __future__ import annotations

from typing import Any

import numpy as np

from armgap.arm.arm import Arm
from armgap.arm.rigid_body import inconsistency
from armgap.evidence.plausibility import Plausibility

__all__ = ["consistency"]

#: Number of inertial parameters of a link: mass, first moments, inertia about the joint's frame.
_NUMBERS = 10


def consistency(data: dict[str, Any], arm: Arm) -> list[Plausibility]:
    """Return for each link of a serial arm's model with causes whether it is physically possible.

    Motion determines only combinations of the links' inertial parameters; the rest comes from the nominal values. So a single link may
    get an impossible mass or inertia although the arm's torques are right.

    Parameters
    ----------
    data : dict
        Diagnosis as a JSON object.
    arm : Arm
        Nominal model, of kind ``"serial"``.

    Returns
    -------
    list of Plausibility
        One per link.
    """
    if arm.chain is None:
        return []
    found = data["parameters"]["with_causes"]
    values = np.array([found[name]["value"] for name in arm.parameter_names[: _NUMBERS * arm.n_joints]])
    entries: list[Plausibility] = []
    for link, ten in zip(arm.chain.link_names, values.reshape(-1, _NUMBERS), strict=True):
        problem = inconsistency(ten)
        figure = problem or f"mass {ten[0]:.3g} kg"
        entries.append(
            {"check": f"{link} has a mass and inertia that a body can have", "holds": not problem, "figure": figure}
        )
    return entries
