"""Reference solution of the two-link arm with dry friction, integrated by scipy without code of any other engine.

Equations of motion as in Reyes and Kelly (1997), section 5. Each joint slides one way, slides the other way, or sticks;
between changes the equations are smooth and DOP853 integrates them to 1e-10; changes are located as events.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
STANDING = 2e-5  # rad/s; below the speed of any joint that moves at a sample


def nothing(t: float, q: Array, dq: Array) -> Array:
    return np.zeros(2)


@dataclass
class DryArm:
    """Two-link arm: nine parameters `theta`, added torques ``extra(t, q, dq)`` and Coulomb levels ``level(t, q, dq)``, rotor inertias, tilt."""

    theta: Sequence[float]
    extra: Callable[[float, Array, Array], Array] = nothing
    level: Callable[[float, Array, Array], Array] = nothing
    armature: tuple[float, float] = (0.0, 0.0)
    tilt: float = 0.0

    def window(self, t: Array, tau: Array, q0: Array, dq0: Array) -> Array:
        """Return the positions at times `t` from an initial state, with the torques `tau` held between samples, shape (n_samples, 2)."""
        y = np.r_[q0, np.where(np.abs(dq0) < STANDING, 0.0, dq0)]
        mode, rows = np.sign(y[2:]), [y[:2]]
        for k in range(len(t) - 1):
            y, mode = self._sample(t[k], t[k + 1], y, mode, tau[k])
            rows.append(y[:2])
        return np.array(rows)

    def _sample(self, now: float, end: float, y: Array, mode: Array, tau: Array) -> tuple[Array, Array]:
        mode = self._settle(now, y, mode, tau)
        while now < end - 1e-13:
            events = [self._event(j, mode.copy(), tau) for j in range(2)]
            part = solve_ivp(
                self._rates, (now, end), y, method="DOP853", rtol=1e-10, atol=1e-12, events=events, args=(mode, tau)
            )
            now, y = part.t[-1], part.y[:, -1].copy()
            for j in range(2):
                if len(part.t_events[j]) and mode[j]:
                    y[2 + j] = mode[j] = 0.0
            mode = self._settle(now, y, mode, tau)
        return y, mode

    def _rates(self, t: float, y: Array, mode: Array, tau: Array) -> Array:
        return np.r_[y[2:], self._accelerate(t, y, mode, tau)[0]]

    def _accelerate(self, t: float, y: Array, mode: Array, tau: Array) -> tuple[Array, Array]:
        """Return the accelerations, and the friction torques that hold sticking joints at rest."""
        q, dq, th = y[:2], y[2:], self.theta
        cos, sin = np.cos(q[1]), np.sin(q[1])
        off = th[2] + th[1] * cos
        M = np.array([[th[0] + 2 * th[1] * cos, off], [off, th[2]]]) + np.diag(self.armature)
        coriolis = th[1] * sin * np.array([-2 * dq[0] * dq[1] - dq[1] ** 2, dq[0] ** 2])
        angle = np.cumsum(q) + self.tilt
        gravity = np.array([th[3] * np.sin(angle[0]) + th[4] * np.sin(angle[1]), th[4] * np.sin(angle[1])])
        force = tau + self.extra(t, q, dq) - coriolis - gravity - np.array(th[5:7]) * dq
        force = force - self._levels(t, y) * mode
        free, ddq = np.flatnonzero(mode), np.zeros(2)
        if free.size:
            ddq[free] = np.linalg.solve(M[np.ix_(free, free)], force[free])
        return ddq, force - M @ ddq

    def _levels(self, t: float, y: Array) -> Array:
        return np.maximum(np.array(self.theta[7:9]) + self.level(t, y[:2], y[2:]), 0.0)

    def _settle(self, t: float, y: Array, mode: Array, tau: Array) -> Array:
        """Return the modes after joints at rest have begun to slide or to stick, repeated until no mode changes."""
        mode = mode.copy()
        for _ in range(6):
            ddq, hold = self._accelerate(t, y, mode, tau)
            lets_go = (mode == 0) & (np.abs(hold) > self._levels(t, y))
            holds = (mode != 0) & (y[2:] == 0) & (ddq * mode < 0)
            if not (lets_go | holds).any():
                break
            mode = np.where(lets_go, np.sign(hold), np.where(holds, 0.0, mode))
        return mode

    def _event(self, joint: int, mode: Array, tau: Array) -> Callable[..., float]:
        def stops(_t: float, y: Array, *_: object) -> float:
            return float(y[2 + joint])

        def breaks_away(t: float, y: Array, *_: object) -> float:
            return float(abs(self._accelerate(t, y, mode, tau)[1][joint]) - self._levels(t, y)[joint])

        event = stops if mode[joint] else breaks_away
        event.terminal = True  # type: ignore[attr-defined]
        event.direction = -mode[joint] if mode[joint] else 1.0  # type: ignore[attr-defined]
        return event
