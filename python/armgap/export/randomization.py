"""Ranges for domain randomisation: exported parameters, their standard deviations, and random models, schema ``armgap.randomization/1``.

Standard deviations are those of the diagnosis. Of the inertial parameters of a serial arm's links only combinations are known well: independent
draws would give impossible links, with torques that the logs exclude. The correlations are those of a least-squares estimate along the
diagnosed motion with the arm file's standard deviations as prior,

    C = (k Y' Y + diag(1/sigma^2))^-1

(Ljung 1999, section 7.4), with `k`, the information in a sample's torque, such that the standard deviations agree best with the diagnosis'. The
covariance is then scaled to the diagnosis' standard deviations exactly. Each random model is moved to the nearest physically consistent links.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap._native import __version__
from armgap.arm.rigid_body import about_com
from armgap.diagnosis.result import Cause
from armgap.export.chain.bodies import nearest_bodies
from armgap.export.chain.serial import CorrectedSerial
from armgap.export.corrected import Corrected

__all__ = ["SCHEMA", "covariance", "randomization"]

Array = NDArray[np.float64]

SCHEMA = "armgap.randomization/1"
#: Half width of the ranges for domain randomisation, in standard deviations: 95 % of a normal distribution.
_RANGE_HALF_WIDTH = 2.0
#: Lower end of a range, as a share of the value, for a parameter that must not be negative, or must be positive for a body.
_LOWER_END_SHARE = 0.1
#: Values tried for `k`, the information in one sample of the torques.
_INFORMATION = 10.0 ** np.arange(0.0, 12.0, 0.25)
#: Step of finite differences by inertial parameters, in their standard deviations.
_INERTIAL_STEP_SIGMAS = 1e-6
_ABOUT_COM = ("mass", "com_x", "com_y", "com_z", "ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_COM_UNITS = ("kg", "m", "m", "m", *["kg m^2"] * 6)
_POSITIVE = ("mass", "ixx", "iyy", "izz")


def randomization(model: Corrected, *, draws: int = 20, seed: int = 1) -> str:
    """Return ranges of all exported parameters, and random models, as JSON text.

    Parameters
    ----------
    model : Corrected
        Exported model.
    draws : int, default 20
        Number of random models of a serial arm; none for a planar arm, whose parameters are known one by one.
    seed : int, default 1
        Seed of the random generator.
    """
    found: dict[str, Any] = {
        "schema": SCHEMA,
        "version": __version__,
        "arm": model.arm.name,
        "stage": model.stage,
        "reach": _RANGE_HALF_WIDTH,
    }
    if isinstance(model, CorrectedSerial):
        spread = covariance(model)
        found["quantities"] = [*_of_links(model, spread), *_of_joints(model), *_of_causes(model)]
        found["draws"] = [_draw(model, spread, np.random.default_rng([seed, i])) for i in range(draws)]
    else:
        values = zip(model.arm.parameter_names, model.theta, model.sigma, model.arm.parameter_units, strict=True)
        found["quantities"] = [_entry({"parameter": n}, float(v), float(s), u) for n, v, s, u in values]
        found["quantities"] += _of_causes(model)
        found["draws"] = []
    return json.dumps(found, indent=2, allow_nan=False) + "\n"


def covariance(model: CorrectedSerial) -> Array:
    """Return the covariance of the inertial parameters, shape (11 n, 11 n), with the standard deviations of the diagnosis."""
    n = model.arm.n_joints
    prior, reported = (x[: 11 * n] for x in (model.arm.sigma, model.sigma))
    size = np.sqrt(np.mean((model.regressor @ model.theta[: 11 * n]) ** 2, axis=0))
    rows = (model.regressor / np.where(size > 0, size, 1.0)[:, None]).reshape(-1, 11 * n)
    free = np.flatnonzero((prior > 0) & (reported > 0))
    information = (rows.T @ rows)[np.ix_(free, free)] / len(model.regressor)
    scale = prior[free]
    best, least = np.eye(len(free)), np.inf
    for k in _INFORMATION:
        inverse = np.linalg.inv(k * information * np.outer(scale, scale) + np.eye(len(free)))
        apart = float(np.sum(np.log(np.sqrt(np.diag(inverse)) * scale / reported[free]) ** 2))
        if apart < least:
            best, least = inverse, apart
    deviation = np.sqrt(np.diag(best))
    spread = np.zeros((11 * n, 11 * n))
    spread[np.ix_(free, free)] = best / np.outer(deviation, deviation) * np.outer(reported[free], reported[free])
    return spread


def _entry(where: dict[str, Any], nominal: float, sd: float, unit: str, *, positive: bool = False) -> dict[str, Any]:
    low, high = nominal - _RANGE_HALF_WIDTH * sd, nominal + _RANGE_HALF_WIDTH * sd
    return {
        **where,
        "nominal": nominal,
        "sd": sd,
        "low": max(low, _LOWER_END_SHARE * nominal) if positive else low,
        "high": high,
        "unit": unit,
    }


def _about_com(ten: Array) -> Array:
    mass, com, inertia = about_com(ten)
    return np.array([mass, *com, *inertia[np.triu_indices(3)]])


def _of_links(model: CorrectedSerial, spread: Array) -> Iterable[dict[str, Any]]:
    for k, (name, ten) in enumerate(zip(model.chain.link_names, model.bodies.inertial, strict=True)):
        rows = slice(10 * k, 10 * k + 10)
        size = np.sqrt(np.diag(spread[rows, rows]))
        steps = _INERTIAL_STEP_SIGMAS * np.where(size > 0, size, 1.0)
        slopes = np.array(
            [_about_com(ten + h * e) - _about_com(ten - h * e) for h, e in zip(steps, np.eye(10), strict=True)]
        )
        jacobian = slopes.T / (2.0 * steps)
        sd = np.sqrt(np.maximum(np.diag(jacobian @ spread[rows, rows] @ jacobian.T), 0.0))
        for quantity, value, s, unit in zip(_ABOUT_COM, _about_com(ten), sd, _COM_UNITS, strict=True):
            where = {"link": name, "quantity": quantity}
            yield _entry(where, float(value), float(s), unit, positive=quantity in _POSITIVE)


def _of_joints(model: CorrectedSerial) -> Iterable[dict[str, Any]]:
    n = model.arm.n_joints
    units = model.arm.parameter_units[10 * n :]
    for i, (quantity, field) in enumerate(
        (("armature", "armature"), ("damping", "viscous"), ("frictionloss", "coulomb"))
    ):
        for j, name in enumerate(model.chain.joint_names):
            sd = float(model.sigma[10 * n + i * n + j])
            value = float(getattr(model.joints[j], field))
            yield _entry({"joint": name, "quantity": quantity}, value, sd, units[i * n + j], positive=True)


def _of_causes(model: Corrected) -> list[dict[str, Any]]:
    """Return the parameters of all causes with ranges, also of causes whose values are already included in links or rotors."""
    return [
        _entry({"effect": cause.effect, **_place(cause), "quantity": name}, v.value, v.sigma, v.unit)
        for cause in model.causes
        for name, v in cause.parameters.items()
    ]


def _place(cause: Cause) -> dict[str, Any]:
    """Return JSON entries for the joint or joints of a cause."""
    on_row = {"joints": list(cause.joints or ()), "row": list(cause.row)} if cause.row else {}
    return {"joint": cause.joint, **on_row}


def _draw(model: CorrectedSerial, spread: Array, rng: np.random.Generator) -> dict[str, Any]:
    """Return one random model as a JSON object: physically consistent links, and joints with rotor inertia and friction."""
    n = model.arm.n_joints
    center = np.concatenate([model.bodies.inertial.ravel(), model.bodies.rotor])
    values, vectors = np.linalg.eigh(spread)
    drawn = center + vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(len(values)))
    drawn[10 * n :] = np.where(
        center[10 * n :] > 0, np.maximum(drawn[10 * n :], _LOWER_END_SHARE * center[10 * n :]), 0.0
    )
    sigma = np.sqrt(np.diag(spread))
    bodies = nearest_bodies(drawn, drawn, sigma, model.regressor, np.zeros((n, 10)), exact=False)
    friction = model.theta[11 * n :] + model.sigma[11 * n :] * rng.standard_normal(2 * n)
    viscous, coulomb = np.maximum(friction, 0.0).reshape(2, n)
    links = [
        {"name": name, **dict(zip(_ABOUT_COM, _about_com(ten).tolist(), strict=True))}
        for name, ten in zip(model.chain.link_names, bodies.inertial, strict=True)
    ]
    more = np.array([joint.armature for joint in model.joints]) - model.bodies.rotor
    joints = [
        {"name": name, "armature": float(r), "damping": float(v), "frictionloss": float(c)}
        for name, r, v, c in zip(model.chain.joint_names, bodies.rotor + more, viscous, coulomb, strict=True)
    ]
    return {"links": links, "joints": joints}
