"""Estimates of the base parameters from the logs of a run, with the standard deviations that armgap gives them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tests.serial_trial.arms import SerialRobot
from tests.serial_trial.case import arm_of
from tests.serial_trial.motion import Run

import armgap
from armgap.arm.serial.trust import FRICTION_SHARE, Scales, link_sigma
from armgap.estimation.base_columns import BaseParameters, base_parameters

from .case import LOGS, PERIOD_S, make_case

Array = NDArray[np.float64]
Record = dict[str, Any]

#: Trust of the arm file in the links' values; standard deviations of rotor inertias are their own size, of friction half of it, as in arm files.
TRUST = "guess"
#: Scheme of the recursive least squares that is compared with the diagnosis.
SCHEME = "filtered-dynamic"


def loose_arm(robot: SerialRobot) -> armgap.Arm:
    """Return the arm as an arm file with the default standard deviations of :data:`TRUST` describes it."""
    arm = arm_of(robot, PERIOD_S, "published")
    assert arm.chain is not None
    inertial = arm.theta[: 10 * robot.n].reshape(robot.n, 10)
    links = link_sigma(inertial[:, 0], Scales(arm.chain, inertial).length, TRUST)
    friction = FRICTION_SHARE * np.concatenate([robot.viscous, robot.coulomb])
    return replace(arm, sigma=np.concatenate([np.ravel(links), robot.rotor, friction]))


def in_base_parameters(arm: armgap.Arm, base: BaseParameters) -> armgap.Arm:
    """Return the arm with base parameters in the place of its parameters.

    A diagnosis gives standard deviations of single parameters but no covariance, which the standard deviations of their sums would need. If the
    dependent parameters of an arm are not estimated, each independent parameter equals its base parameter minus a constant, with the same
    standard deviation. Its prior standard deviation is that of the whole sum.
    """
    columns, dependent = list(base.columns), list(base.dependent)
    sigma = np.zeros_like(arm.sigma)
    sigma[columns] = np.sqrt(arm.sigma[columns] ** 2 + base.combination**2 @ arm.sigma[dependent] ** 2)
    return replace(arm, sigma=sigma)


def diagnosed(runs: list[Run], arm: armgap.Arm) -> tuple[Array, Array, list[str]]:
    """Return re-estimated parameters and their standard deviations, shape (13 n,) each, and the names of the input checks that fired."""
    logs = [armgap.Log.from_arrays(r.t, r.q, r.tau, name=name, arm=arm) for name, r in zip(LOGS, runs, strict=True)]
    found = armgap.diagnose(logs[:-1], arm, holdout=logs[-1:], max_causes=0)
    values = [found.parameters["refit"][name] for name in arm.parameter_names]
    theta, sigma = np.array([(v.value, v.sigma) for v in values]).T
    return theta, sigma, [check.check for check in found.checks]


def ask(seed: int, number: int, share: float) -> Record:
    """Make a run and estimate its parameters from the logs with and without the disturbance.

    Returns
    -------
    dict
        ``names``, ``truth``, ``nominal`` and ``prior_sigma`` of the base parameters; for ``"quiet"`` and ``"disturbed"``: ``estimate`` and
        ``sigma`` of the diagnosis, ``checks``, and ``identified`` and ``identified_sigma`` of the recursive least squares on the first log; and
        ``single``, the base parameters by a diagnosis of the disturbed logs that estimates every single parameter.
    """
    case = make_case(seed, number, share)
    arm = loose_arm(case.nominal)
    base = base_parameters(arm)
    pinned = in_base_parameters(arm, base)
    columns = list(base.columns)
    record: Record = {
        "seed": seed, "number": number, "share": share, "times": case.times.tolist(), "names": base.names,
        "truth": base.of(case.truth.theta).tolist(), "nominal": base.of(arm.theta).tolist(), "prior_sigma": pinned.sigma[columns].tolist(),
    }  # fmt: skip
    for condition, runs in (("quiet", case.quiet), ("disturbed", case.disturbed)):
        theta, sigma, checks = diagnosed(runs, pinned)
        first = armgap.Log.from_arrays(runs[0].t, runs[0].q, runs[0].tau, name=LOGS[0], arm=arm)
        found = armgap.identify(first, arm, scheme=SCHEME)
        assert found.base is not None
        assert found.base.names == base.names
        record[condition] = {
            "estimate": base.of(theta).tolist(), "sigma": sigma[columns].tolist(), "checks": checks,
            "identified": found.theta.tolist(), "identified_sigma": found.sigma.tolist(),
        }  # fmt: skip
    single, _, _ = diagnosed(case.disturbed, arm)
    record["single"] = base.of(single).tolist()
    return record
