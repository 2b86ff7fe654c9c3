"""An arm file with the corrected values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from armgap.export import header

if TYPE_CHECKING:
    from armgap.arm import Arm
    from armgap.diagnosis import Value
    from armgap.export.corrected import Corrected

__all__ = ["render", "to_arm"]

#: Trust in an exported value, relative, at best. An estimate's sigma holds for the logs it came from; tomorrow's arm is
#: warmer, and values trusted to their last digit would make every other log look like a payload.
LEAST_SIGMA = 0.01


def to_arm(model: Corrected) -> Arm:
    """Return the arm with the corrected base parameters; a rotor inertia of the first joint is part of theta1."""
    theta = model.theta.copy()
    theta[0] += model.joints[0].armature
    scale = np.where(theta != 0, np.abs(theta), np.max(np.abs(theta)))
    sigma = np.maximum(model.sigma, LEAST_SIGMA * scale)
    return replace(model.arm, name=f"{model.arm.name}, corrected", theta=theta, sigma=sigma, sealed=None)


def render(model: Corrected) -> str:
    """Return an arm file; causes that it has no field for stand in its head as options of ``armgap simulate``."""
    head = [f"# {line}" for line in header.lines(model, "toml")]
    head.append(f"# sigma: the estimate's, but at least {LEAST_SIGMA:.0%} of the value")
    options = [_option(c.effect, c.joint, c.parameters) for c in model.causes if model.field_of(c, "toml") is None]
    head += [f"# armgap simulate {' '.join(options)}"] if options else []
    return "\n".join(head) + "\n" + to_arm(model).to_toml()


def _option(effect: str, joint: int | None, parameters: Mapping[str, Value]) -> str:
    pairs = ",".join(f"{name}={value.value!r}" for name, value in parameters.items())
    return f"--effect {effect}:{'' if joint is None else joint}:{pairs}"
