"""Nearest physically consistent links for given joint torques.

Motion determines combinations of the links' inertial parameters only (base parameters, Khalil 2002). A single estimated link may be
physically impossible although all torques are right. Of all links with equal torques, those are chosen whose pseudo-inertias are positive
definite (Wensing, Kim and Slotine 2018) and that are nearest to the nominal links, in units of the nominal values' standard deviations (Sousa
and Cortesao 2014). This is a convex problem::

    minimise  |Y (x - found)|^2 / 2 + |(x - nominal)/sigma|^2 / 2 - mu sum log det P_k(x)

with torques `Y x` in units of a share of each joint's own, so small that torques stay if that is possible, and a barrier `mu` that goes to zero
(Boyd and Vandenberghe 2004, section 11.3). Where no consistent links have these torques, the solution has the least torque error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armgap.arm.rigid_body import inconsistency, pseudo_inertia

__all__ = ["BODY_TOLERANCE", "Bodies", "nearest_bodies"]

Array = NDArray[np.float64]

#: Torque differences below this share of a joint's own torque count as none: errors of an estimate are at least ten times larger.
BODY_TOLERANCE = 1e-3
#: Torque error, as a share of the joint's torque, that costs as much as one standard deviation of a parameter: where the torques can be
#: kept, and where they cannot. In the second case a smaller share gives implausible links (rods of many times the mass) and hardly better torques.
_SHARES = (1e-5, 1e-3)
#: Weights of the log-det barrier: from one that outweighs the torques to one that is small compared with a tenth of a standard deviation.
_BARRIERS = 10.0 ** np.arange(10.0, -3.0, -2.0)
#: Largest number of Newton steps for one weight of the barrier.
_MOST_STEPS = 60
#: Newton decrement, in units of the barrier's weight, at which the minimum for this weight is reached.
_REACHED = 1e-6
#: Line search: smallest decrease of the cost, as a part of the predicted one, and smallest part of a Newton step that is tried.
_SLOPE = 0.1
_LEAST_PART = 1e-10
#: Pseudo-inertia for each of the ten inertial parameters at the value 1 and the others at 0, shape (10, 4, 4).
_UNIT_PSEUDO_INERTIAS = np.array([pseudo_inertia(unit) for unit in np.eye(10)])


@dataclass(frozen=True)
class Bodies:
    """Physically consistent links, and the change of joint torques from those of the estimated links.

    Attributes
    ----------
    inertial : ndarray, shape (n_joints, 10)
        Ten inertial parameters of each link [SI].
    rotor : ndarray, shape (n_joints,)
        Rotor inertias reflected to the joints, none of them negative [kg m^2 or kg].
    changed : tuple of int
        Links, from 0, that were physically impossible as estimated; empty if no link was changed.
    torque_error : ndarray, shape (n_joints,)
        RMS change of each joint's torque, as a share of the joint's RMS torque.
    """

    inertial: Array
    rotor: Array
    changed: tuple[int, ...]
    torque_error: Array

    @property
    def same_torques(self) -> bool:
        """Whether the consistent links need the torques of the estimated parameters, to within `BODY_TOLERANCE`."""
        return bool(np.all(self.torque_error < BODY_TOLERANCE))


def nearest_bodies(
    found: Array, nominal: Array, sigma: Array, regressor: Array, beside: Array, *, exact: bool = True
) -> Bodies:
    """Return the nearest physically consistent links with the torques of the estimated links.

    Parameters
    ----------
    found, nominal, sigma : ndarray, shape (11 n,)
        Ten inertial parameters per link, then the rotors' inertias: estimated, nominal, and standard deviations of the nominal values.
    regressor : ndarray, shape (n_states, n_joints, 11 n)
        Torques per unit of each parameter in the states to compare.
    beside : ndarray, shape (n_joints, 10)
        Inertial parameters of parts of each link that stay as they are; the rest of the link has to be consistent.
    exact : bool, default True
        Whether torques are kept to `BODY_TOLERANCE` where that is possible; else they are weighed against the distance from the nominal values.
    """
    n = len(beside)
    links, rotors = found[: 10 * n].reshape(n, 10), found[10 * n :]
    # A link without mass may pass the test of consistency, but a simulator cannot integrate its motion.
    wrong = tuple(k for k in range(n) if inconsistency(links[k] - beside[k]) or links[k][0] <= beside[k][0])
    if not wrong and np.all(rotors >= 0):
        return Bodies(links, rotors, (), np.zeros(n))
    size = np.sqrt(np.mean((regressor @ found) ** 2, axis=0))
    torque = regressor / np.where(size > 0, size, 1.0)[:, None]
    sigma = np.where(sigma > 0, sigma, BODY_TOLERANCE * np.maximum(np.abs(nominal), np.median(sigma[sigma > 0])))
    for share in _SHARES if exact else _SHARES[1:]:
        x = _minimised(found, nominal, sigma, torque.reshape(-1, 11 * n) / (share * np.sqrt(len(torque))), beside)
        error = np.sqrt(np.mean((torque @ (x - found)) ** 2, axis=0))
        if np.all(error < BODY_TOLERANCE):
            break
    return Bodies(x[: 10 * n].reshape(n, 10), x[10 * n :], wrong, error)


def _minimised(found: Array, nominal: Array, sigma: Array, rows: Array, beside: Array) -> Array:
    """Return the consistent links' parameters that minimise ``|rows (x - found)|^2 + |(x - nominal)/sigma|^2``, by Newton's method with barriers."""
    n = len(beside)
    # Rotor inertias of zero stay zero: the joint has no rotor.
    free = np.concatenate([np.ones(10 * n, dtype=bool), found[10 * n :] > 0])
    barrier = _Barrier(n, beside, np.flatnonzero(free[10 * n :]))
    x = _start(nominal, sigma, barrier)
    x[~free] = 0.0
    scaled = rows * sigma
    quadratic = scaled.T @ scaled

    def cost(at: Array, mu: float) -> float:
        a, b = (at - found) / sigma, (at - nominal) / sigma
        return float(0.5 * (a @ quadratic @ a + b @ b)) + mu * barrier.value(at)

    for mu in _BARRIERS:
        for _ in range(_MOST_STEPS):
            slope, curvature = barrier.derivatives(x)
            gradient = quadratic @ ((x - found) / sigma) + (x - nominal) / sigma + mu * sigma * slope
            hessian = quadratic + np.eye(11 * n) + mu * curvature * np.outer(sigma, sigma)
            step = np.zeros(11 * n)
            step[free] = -sigma[free] * np.linalg.solve(hessian[np.ix_(free, free)], gradient[free])
            decrement = -float(gradient @ (step / sigma))
            if decrement < _REACHED * mu:
                break
            here, part = cost(x, mu), 1.0
            while part > _LEAST_PART and not cost(x + part * step, mu) <= here - _SLOPE * part * decrement:
                part *= 0.5
            if part <= _LEAST_PART:
                break  # within rounding no part of the step decreases the cost
            x = x + part * step
    return x


class _Barrier:
    """Barrier function ``-sum log det P_k - sum log rotor_j`` of links without the parts that stay as they are, and of rotors."""

    def __init__(self, n: int, beside: Array, rotors: NDArray[np.intp]) -> None:
        self.n = n
        self.beside = beside
        self.rotors = 10 * n + rotors

    def pseudo_inertias(self, x: Array) -> Array:
        """Return the pseudo-inertias of the links, shape (n, 4, 4)."""
        return np.tensordot(x[: 10 * self.n].reshape(self.n, 10) - self.beside, _UNIT_PSEUDO_INERTIAS, axes=1)

    def value(self, x: Array) -> float:
        """Return the value of the barrier; infinite where a link is physically impossible."""
        if np.any(x[self.rotors] <= 0):
            return float("inf")
        try:
            roots = np.linalg.cholesky(self.pseudo_inertias(x))
        except np.linalg.LinAlgError:
            return float("inf")
        diagonals = np.diagonal(roots, axis1=1, axis2=2)
        return -2.0 * float(np.log(diagonals).sum()) - float(np.log(x[self.rotors]).sum())

    def derivatives(self, x: Array) -> tuple[Array, Array]:
        """Return gradient, shape (11 n,), and Hessian, shape (11 n, 11 n), of the barrier function."""
        gradient, hessian = np.zeros(len(x)), np.zeros((len(x), len(x)))
        for k, inverse in enumerate(np.linalg.inv(self.pseudo_inertias(x))):
            by = inverse @ _UNIT_PSEUDO_INERTIAS
            rows = slice(10 * k, 10 * k + 10)
            gradient[rows] = -np.trace(by, axis1=1, axis2=2)
            hessian[rows, rows] = np.einsum("aij,bji->ab", by, by)
        gradient[self.rotors] = -1.0 / x[self.rotors]
        hessian[self.rotors, self.rotors] = x[self.rotors] ** -2
        return gradient, hessian


def _start(nominal: Array, sigma: Array, barrier: _Barrier) -> Array:
    """Return the nominal values with a ball added at each link's origin, so heavy that the link is physically consistent."""
    n, x = barrier.n, nominal.copy()
    x[barrier.rotors] = np.maximum(x[barrier.rotors], sigma[barrier.rotors])
    for k in range(n):
        mass, moment = sigma[10 * k], sigma[10 * k + 4]
        ball = np.array([mass, 0, 0, 0, moment, 0, moment, 0, 0, moment])
        share = 0.0
        while not np.isfinite(_Barrier(1, barrier.beside[k : k + 1], np.empty(0, dtype=np.intp)).value(_one(x, k))):
            share = max(2.0 * share, BODY_TOLERANCE)
            x[10 * k : 10 * k + 10] = nominal[10 * k : 10 * k + 10] + share * ball
    return x


def _one(x: Array, k: int) -> Array:
    return x[10 * k : 10 * k + 10]
