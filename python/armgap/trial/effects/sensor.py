"""Hidden effects of the position sensor."""

from __future__ import annotations

import math

from armgap.trial.effects.base import ROTARY, Draw, Parameters, effect
from armgap.trial.simulation.simulated_arm import SimulatedArm


@effect("encoder_offset", lambda d: {"offset": d.sign() * d.between(0.01, 0.15)}, kinds=ROTARY)
def encoder_offset(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Add an offset to the encoder of a joint: measured ``q + offset``."""
    sim.encoders[joint].offset += p["offset"]


def _draw_eccentricity(d: Draw) -> Parameters:
    size, angle = d.between(0.003, 0.05), d.uniform(-math.pi, math.pi)
    return {"a": size * math.cos(angle), "b": size * math.sin(angle)}


@effect("encoder_eccentricity", _draw_eccentricity, kinds=ROTARY)
def encoder_eccentricity(sim: SimulatedArm, joint: int, p: Parameters) -> None:
    """Make the encoder of a joint eccentric: measured ``q + a sin q + b cos q``."""
    sim.encoders[joint].a += p["a"]
    sim.encoders[joint].b += p["b"]
