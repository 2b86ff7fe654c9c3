"""Evidence that a played motion gave: log-likelihood ratio of the true arm to the arm without the effect, with all of its values fitted.

The residual of the true arm is known here: the encoder's noise. The arm without the effect is fitted by scipy to windows that begin in the states
that the encoders would show without noise, with the arm file's standard deviations as prior; constants and slopes, like those of an error of the
first state, are left out.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

import armgap
from armgap import _native
from armgap.trial.simulation.arms import TrialArm
from armgap.trial.simulation.simulated_arm import Trace

from .cases import Case

Array = NDArray[np.float64]

#: Largest degree of the Legendre polynomials onto which the residuals of a window are projected.
DEGREES = 12
#: Largest number of function evaluations of the fit.
STEPS = 12


def shown(case: Case, trace: Trace) -> tuple[Array, Array]:
    """Return positions and velocities as the encoders show them without noise, shape (n_samples, n_joints) each."""
    q, dq = trace.q_true.copy(), trace.dq_true.copy()
    if case.effect in ("encoder_offset", "encoder_eccentricity"):
        j, p = (case.joint or 1) - 1, case.parameters
        a, b = p.get("a", 0.0), p.get("b", 0.0)
        dq[:, j] *= 1.0 + a * np.cos(q[:, j]) - b * np.sin(q[:, j])
        q[:, j] += p.get("offset", 0.0) + a * np.sin(q[:, j]) + b * np.cos(q[:, j])
    return q, dq


def obtained(case: Case, arm_file: Path, arm: TrialArm, trace: Trace, horizon: float) -> float:
    """Return the log-likelihood ratio of the true arm to the best fitting arm without the effect, over windows of length `horizon` [s]."""
    stated = armgap.Arm.read(arm_file)
    s = max(round(horizon / arm.sample_period), DEGREES + 2)
    windows = (len(trace.t) - 1) // s
    orthogonal, _ = np.linalg.qr(np.polynomial.legendre.legvander(np.linspace(-1, 1, s + 1), DEGREES))
    weight = np.array(arm.step) / np.sqrt(12.0)

    def factors(positions: Array) -> Array:
        return np.asarray(np.einsum("wsj,sk->wkj", positions, orthogonal[:, 2:]) / weight).ravel()

    def of(column: Array) -> Array:
        return np.stack([column[w * s : w * s + s + 1] for w in range(windows)])

    measured = factors(of(trace.q))
    q, dq = shown(case, trace)
    lengths = None if stated.link_length is None else stated.link_length.tolist()

    def left(u: Array) -> Array:
        theta = stated.theta + stated.sigma * u
        theta = np.where(stated.theta > 0, np.maximum(theta, 1e-3 * stated.theta), theta)
        predicted = np.empty((windows, s + 1, arm.n_joints))
        for w in range(windows):
            rows = slice(w * s, w * s + s + 1)
            predicted[w], _ = _native.simulate(
                stated.kind, stated.gravity, lengths, theta.tolist(), trace.t[rows], trace.tau[rows], q[w * s],
                dq[w * s], [], 0.1 * float(weight.min()),
            )  # fmt: skip
        return np.concatenate([measured - factors(predicted), u])

    found = least_squares(left, np.zeros(len(stated.theta)), diff_step=0.02, max_nfev=STEPS)
    noise = float(np.sum(factors(of(trace.q - q)) ** 2))
    return float(found.cost - 0.5 * noise)
