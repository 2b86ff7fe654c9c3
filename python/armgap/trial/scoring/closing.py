"""Share of the gap that a method's model closes, against the best possible model: true effects with true sizes.

Three models predict the holdout windows from their measured starts: the arm file as it is, the method's answer,
and the true model by the key, as far as armgap can simulate it. The error of the true model is the noise floor. Left out are effects with a
latent state at the start of a window: delays and lags of commands before the window, the deflection of springs,
bristles and play. That armgap's true model predicts MuJoCo's logs to within noise is a test of the effects' equations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from armgap.arm.arm import Arm
from armgap.simulation import effects
from armgap.trial.answers import Answer
from armgap.trial.cases.key import Key
from armgap.trial.cases.sealed import SealedCase
from armgap.trial.cases.windows import Array, Mechanism, NativeEffect, Window, cut, misses
from armgap.trial.methods import HORIZON

__all__ = ["HISTORY", "Closing", "closing", "model_error"]

#: Names of effects with a latent state, which no log holds at the start of a window.
HISTORY = frozenset({"actuator_lag", "actuator_delay", "presliding", "joint_elasticity", "backlash"})
#: Names of effects that act in one log of a case only.
EVENTS = frozenset({"external_pulse"})
#: Fixed-point iterations that invert the reading of an eccentric encoder.
_FIXED_POINT_ITERATIONS = 20


@dataclass(frozen=True)
class Closing:
    """RMS prediction errors per joint [rad or m] on holdout windows: of the arm file (`before`), the answer (`after`), the true model (`best`)."""

    case: str
    before: tuple[float, ...]
    after: tuple[float, ...]
    best: tuple[float, ...]

    @property
    def closed(self) -> float:
        """Share of the gap above the true model's error that the answer closes, over all joints."""
        open_before = sum(max(b - t, 0.0) for b, t in zip(self.before, self.best, strict=True))
        open_after = sum(max(a - t, 0.0) for a, t in zip(self.after, self.best, strict=True))
        return 1.0 - open_after / open_before if open_before > 0 else 0.0

    @property
    def ratio(self) -> float:
        """Ratio of the RMS error of the answer to that of the true model, all joints together."""
        return math.hypot(*self.after) / math.hypot(*self.best)


def closing(folder: Path, answer: Answer, key: Key) -> Closing | None:
    """Compare an answer's model with arm file and true model; None if one of them cannot be simulated window by window."""
    hidden = [(h.effect, h.joint, h.parameters) for h in key.effects if h.log is None]
    named = [(c.effect, c.joint, {k: x.value for k, x in c.sizes.items()}) for c in answer.causes]
    named = [n for n in named if n[0] not in EVENTS]
    if not answer.theta or not _simulable([*hidden, *named]):
        return None
    case = SealedCase.read(folder)
    windows = [w for log in case.holdout for w in cut(log.t - log.t[0], log.q, log.tau, HORIZON)]
    try:
        rms = [
            model_error(case.arm, np.array(theta), windows, placed)
            for theta, placed in ((case.arm.theta, []), (answer.theta, named), (key.theta, hidden))
        ]
    except ValueError:
        return None
    return Closing(folder.name, *(tuple(float(x) for x in r) for r in rms))


def model_error(arm: Arm, theta: Array, windows: Sequence[Window], placed: Sequence[NativeEffect]) -> Array:
    """Return the RMS prediction error per joint [rad or m] on windows whose initial states are corrected for the model's encoder errors."""
    lengths = () if arm.link_length is None else tuple(arm.link_length.tolist())
    error = misses(Mechanism(arm.kind, arm.gravity, lengths), theta, [_read(w, placed) for w in windows], placed)
    rms: Array = np.sqrt(np.mean(error**2, axis=(0, 1)))
    return rms


def _simulable(placed: Sequence[NativeEffect]) -> bool:
    known = {e["name"] for e in effects()}
    return all(name in known and name not in HISTORY for name, _, _ in placed)


def _read(w: Window, placed: Sequence[NativeEffect]) -> Window:
    """Return a window whose initial state is corrected for encoder offset and eccentricity."""
    q, dq = w.q0.copy(), w.dq0.copy()
    for name, joint, p in placed:
        j = (joint or 1) - 1
        if name == "encoder_offset":
            q[j] -= p["offset"]
        elif name == "encoder_eccentricity":
            q[j] = _inverse(float(w.q0[j]), p["a"], p["b"])
            dq[j] /= 1.0 + p["a"] * math.cos(q[j]) - p["b"] * math.sin(q[j])
    return Window(w.t, w.tau, q, dq, w.q)


def _inverse(shown: float, a: float, b: float) -> float:
    """Return ``q`` from ``q + a sin q + b cos q = shown`` by iteration; a and b are small."""
    q = shown
    for _ in range(_FIXED_POINT_ITERATIONS):
        q = shown - a * math.sin(q) - b * math.cos(q)
    return q
