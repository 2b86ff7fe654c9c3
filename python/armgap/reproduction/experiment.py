"""Experiment of Reyes and Kelly (1997): the arm of Table I, the run, and all identifications of the report."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm.arm import Arm
from armgap.estimation.identification import Identification, identify
from armgap.files.json_result import JsonResult
from armgap.literals import SCHEMES, Filters, Scheme, VelocityMethod
from armgap.log.log import Log
from armgap.simulation import Effect, seed_torque, simulate

__all__ = ["LADDER", "PAPER_ESTIMATES", "PAPER_MEASURED", "Reproduction", "reproduce", "seed_arm", "seed_run"]

#: Gravity of the experiment of Reyes and Kelly (1997) [m/s^2].
GRAVITY = 9.81
#: Sample period of the experiment of Reyes and Kelly (1997), s.
SAMPLE_PERIOD_S = 0.0025
#: Duration of the experiment of Reyes and Kelly (1997), s.
DURATION_S = 10.0
#: Cut-off of the filters of Reyes and Kelly (1997) [rad/s].
CUTOFF_RAD_S = 50.0
#: Coulomb friction of joint 1, forward and backward, by Table I of Reyes and Kelly (1997) [N m].
COULOMB_FORWARD, COULOMB_BACKWARD = 7.17, 8.049
#: Encoders and torque limits of the arm of Reyes and Kelly (1997), section 5 [counts per revolution, N m].
COUNTS_PER_REV = (1024000.0, 655360.0)
TORQUE_LIMIT = (200.0, 15.0)

PAPER_MEASURED = (2.351, 0.084, 0.102, 38.465, 1.825, 2.288, 0.175, 7.60, 1.734)
"""Table II of Reyes and Kelly (1997), column "Measured" [SI], nine base parameters."""

PAPER_ESTIMATES: dict[str, tuple[float | None, ...]] = {
    "supplied-energy": (2.14, 0.088, 0.087, 39.04, None, None, None, None, None),
    "filtered-power": (1.99, 0.084, 0.084, 36.20, 2.01, 2.35, 0.192, 4.95, 1.01),
    "filtered-dynamic": (1.98, 0.087, 0.084, 38.48, 1.99, 2.11, 0.120, 6.20, 1.18),
}
"""Estimates of Table II of Reyes and Kelly (1997) by scheme [SI]; the paper gives no values where the supplied energy did not converge."""

# Standard deviation of low-frequency torque noise, which integrals amplify: amplifiers wander by about one percent of the motors' limits.
WANDER_NM = (2.0, 0.15)
WANDER_HZ = 1.0
WANDER_SEEDS = tuple(range(10))
# Time from which estimates are judged [s]; before it they depend on the choice of P(0).
SETTLED_S = 3.0

LadderStep = tuple[str, Filters, VelocityMethod, bool]
LADDER: tuple[LadderStep, ...] = (
    ("as in the paper", "paper", "backward", False),
    ("consistent filters", "exact", "backward", False),
    ("and central velocities", "exact", "central", False),
    ("and asymmetric friction in the model", "exact", "central", True),
)
"""Steps that correct errors of Reyes and Kelly (1997) one after another: label, filters, velocity, asymmetry in the model."""


@dataclass(frozen=True)
class Reproduction(JsonResult):
    """Result of `reproduce`: the experiment of Reyes and Kelly (1997) on a simulated arm.

    Attributes
    ----------
    arm : Arm
        Arm of Table I with the mean of its two Coulomb levels.
    log : Log
        Log of the simulated run.
    steps : dict
        ``steps[scheme]`` holds one `Identification` per entry of `LADDER`.
    wandering : dict
        ``wandering[scheme]``: identifications as in the paper, on runs with slowly wandering torques of the amplifiers, one per seed.
    ideal : dict
        ``ideal[(scheme, cutoff)]``: identifications with the paper's filters, on a run without encoder steps and asymmetry and with true velocities.
    responses : dict
        Open-loop runs of models: ``"Table I"`` with one Coulomb level, and two schemes' estimates identified as in the paper.
    """

    _allows_nan: ClassVar[bool] = True

    arm: Arm
    log: Log
    steps: dict[Scheme, tuple[Identification, ...]]
    wandering: dict[Scheme, tuple[Identification, ...]] = field(repr=False)
    ideal: dict[tuple[str, float], Identification] = field(repr=False)
    responses: dict[str, Log] = field(repr=False)

    def deviation(self, scheme: Scheme, step: int) -> NDArray[np.float64]:
        """Return the relative deviations of nine estimates from the true parameters at a step of `LADDER`."""
        estimate = self.steps[scheme][step].theta[: len(self.arm.theta)]
        return np.asarray(estimate / self.arm.theta - 1.0)

    def decomposition(self, scheme: Scheme) -> dict[str, list[float | None]]:
        """Return the causes of one scheme's deviations from "measured" in Table II of Reyes and Kelly (1997), in percent of the measured value."""
        d = [100 * self.deviation(scheme, i) for i in range(len(LADDER))]
        paper = [
            None if e is None else 100 * (e / m - 1)
            for e, m in zip(PAPER_ESTIMATES[scheme], PAPER_MEASURED, strict=True)
        ]
        parts = {
            "filters": d[0] - d[1],
            "velocity": d[1] - d[2],
            "asymmetry": d[2] - d[3],
        }
        explained = d[0] - d[3]
        left = [None if p is None else p - e for p, e in zip(paper, explained, strict=True)]
        return {"Table II": paper, **{k: list(v) for k, v in parts.items()}, "unexplained": left}

    def movement(self, results: Sequence[Identification]) -> NDArray[np.float64]:
        """Return the peak-to-peak movement of each settled estimate, as a share of the true value: median over the results."""
        settled = [r.history[np.searchsorted(r.t, SETTLED_S) :, : len(self.arm.theta)] for r in results]
        return np.asarray(np.median([np.ptp(h, axis=0) for h in settled], axis=0) / np.abs(self.arm.theta))

    def misfit(self, label: str) -> NDArray[np.float64]:
        """Return the RMS difference of an open-loop response from the simulated run [rad], shape (n_joints,)."""
        return np.asarray(np.sqrt(np.mean((self.responses[label].q - self.log.q) ** 2, axis=0)))

    def findings(self) -> list[tuple[str, str]]:
        """Return the findings of the reproduction as pairs of title and sentence with figures."""
        from armgap.reproduction.findings import FINDINGS

        return [finding(self) for finding in FINDINGS]

    def to_dict(self) -> dict[str, Any]:
        """Return estimates, decomposition and findings of the reproduction as a dict ready for JSON."""
        return {
            "schema": "armgap.reproduction/1",
            "truth": dict(zip(self.arm.parameter_names, self.arm.theta.tolist(), strict=True)),
            "steps": {
                scheme: {label: result.to_dict() for (label, *_), result in zip(LADDER, results, strict=True)}
                for scheme, results in self.steps.items()
            },
            "decomposition_percent": {scheme: self.decomposition(scheme) for scheme in SCHEMES},
            "open_loop_rms_rad": {label: self.misfit(label).tolist() for label in self.responses},
            "movement_percent": {s: (100 * self.movement(self.wandering[s])).tolist() for s in SCHEMES},
            "findings": [{"title": title, "text": text} for title, text in self.findings()],
        }


def seed_arm() -> Arm:
    """Return the arm of Table I of Reyes and Kelly (1997), with the mean of joint 1's two Coulomb levels.

    Examples
    --------
    >>> seed_arm().theta.round(3).tolist()
    [2.352, 0.084, 0.102, 38.466, 1.827, 2.288, 0.175, 7.61, 1.734]
    """
    mass, length, com, inertia = [23.902, 3.880], [0.45, 0.45], [0.091, 0.048], [1.266, 0.093]
    inertial = _native.theta_from_links("two-link", GRAVITY, mass, length, com, inertia)
    friction = [2.288, 0.175, (COULOMB_FORWARD + COULOMB_BACKWARD) / 2, 1.734]
    theta = np.concatenate([inertial, friction])
    return Arm(
        name="Reyes and Kelly's direct-drive arm",
        kind="two-link",
        gravity=GRAVITY,
        sample_period=SAMPLE_PERIOD_S,
        theta=theta,
        sigma=0.1 * np.abs(theta),
        counts_per_rev=np.array(COUNTS_PER_REV),
        torque_limit=np.array(TORQUE_LIMIT),
        link_length=np.array(length),
    )


def seed_run(arm: Arm, *, real: bool = True, wander: NDArray[np.float64] | None = None) -> Log:
    """Simulate the run of Reyes and Kelly (1997): torques (31) and (32), 10 s at 2.5 ms, from rest.

    Parameters
    ----------
    arm : Arm
        Arm to simulate.
    real : bool, default True
        Whether friction of joint 1 is asymmetric and positions are encoder counts; if not, the log has true velocities.
    wander : ndarray, shape (n_samples, n_joints), optional
        Torque added to the commanded torque [N m]; the log holds only the commanded torque.
    """
    t = np.arange(round(DURATION_S / SAMPLE_PERIOD_S)) * SAMPLE_PERIOD_S
    delta = (COULOMB_FORWARD - COULOMB_BACKWARD) / 2
    effects = [Effect("coulomb_asymmetry", 1, {"delta": delta})] if real else []
    tau = seed_torque(t)
    acting = tau if wander is None else tau + wander
    log = simulate(arm, t, acting, effects=effects, encoder=real, sensor=not real, name="seed")
    return dataclasses.replace(log, tau=tau)


def reproduce() -> Reproduction:
    """Repeat the experiment of Reyes and Kelly (1997) on a simulated arm.

    Returns
    -------
    Reproduction
    """
    arm = seed_arm()
    log, clean = seed_run(arm), seed_run(arm, real=False)
    noisy = [seed_run(arm, wander=_wander(seed, log.tau.shape)) for seed in WANDER_SEEDS]
    steps = {scheme: tuple(_identify(log, arm, scheme, step) for step in LADDER) for scheme in SCHEMES}
    wandering = {scheme: tuple(_identify(x, arm, scheme, LADDER[0]) for x in noisy) for scheme in SCHEMES}
    ideal = {
        (scheme, cutoff): identify(clean, arm, scheme=scheme, filters="paper", velocity="sensor", cutoff=cutoff)
        for scheme in ("filtered-dynamic", "filtered-power")
        for cutoff in (CUTOFF_RAD_S, 2 * np.pi * CUTOFF_RAD_S)
    }
    models = {"Table I": arm.theta, **{s: steps[s][0].theta for s in ("filtered-dynamic", "filtered-power")}}
    responses = {label: _response(arm, theta, log) for label, theta in models.items()}
    return Reproduction(arm, log, steps, wandering, ideal, responses)


def _identify(log: Log, arm: Arm, scheme: Scheme, step: LadderStep) -> Identification:
    _, filters, velocity, asymmetry = step
    return identify(
        log, arm, scheme=scheme, filters=filters, velocity=velocity, asymmetry=asymmetry, cutoff=CUTOFF_RAD_S
    )


def _response(arm: Arm, theta: NDArray[np.float64], log: Log) -> Log:
    model = dataclasses.replace(arm, theta=np.array(theta, dtype=np.float64))
    return simulate(model, log.t, log.tau, encoder=False)


def _wander(seed: int, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return first-order noise with bandwidth `WANDER_HZ` and standard deviations `WANDER_NM` [N m]."""
    decay = np.exp(-2 * np.pi * WANDER_HZ * SAMPLE_PERIOD_S)
    noise = np.random.default_rng(seed).standard_normal(shape)
    for k in range(1, len(noise)):
        noise[k] = decay * noise[k - 1] + np.sqrt(1 - decay**2) * noise[k]
    return np.asarray(noise * np.array(WANDER_NM))
