"""Baseline by `mujoco.sysid`, MuJoCo's identification tool: parameters that differ from neutral values name the effects.

The parameters with which MuJoCo can express an effect of the library are freed at once, together with the arm's own, and fitted
by `mujoco.sysid.optimize` to predictions over short windows. Left out are those that no fit separates from the arm's own or from
those of another effect: torque gain, armature of joint 1, payload, and base tilt (from the zero of encoder 1). The report gives
an interval for every parameter and warns of those at a bound. An effect is named if the interval of its parameter excludes the
neutral value and the parameter is at no bound; effects most half widths away from their neutral value come first, four at most.

References
----------
MuJoCo 4.0, module ``mujoco.sysid``: ``optimize``, ``calculate_intervals``, and the report section ``AutomatedInsights``.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from armgap.arm.arm import Arm
from armgap.trial.answers import Answer, NamedCause, Size
from armgap.trial.baselines.mujoco_model import build_spec, set_coulomb, set_inertial
from armgap.trial.baselines.regression import Array
from armgap.trial.cases.sealed import SealedCase
from armgap.trial.cases.windows import Window, cut
from armgap.trial.methods import HORIZON, Method
from armgap.trial.simulation.engine import TrialEngineMissingError

__all__ = ["SYSID"]

#: Settings of the baseline: number of windows fitted, largest numbers of iterations and of causes, bounds of the arm's parameters in sigmas.
_FITTED_WINDOWS, ITERATIONS, MAX_CAUSES, _BOUND_SIGMAS = 10, 10, 4, 4.0
#: Names of the effects that parameters of MuJoCo express, and of their equivalents.
EXPRESSED = frozenset(
    {
        "torque_offset",
        "coulomb_asymmetry",
        "actuator_lag",
        "actuator_delay",
        "torque_saturation",
        "joint_spring",
        "quadratic_drag",
        "rotor_inertia",
        "encoder_offset",
        "base_tilt",
    }
)
#: Step of finite differences, as a share of the parameters' scales: large enough to exceed the error of MuJoCo's constraint solver.
FINITE_DIFFERENCE_STEP = 1e-4
#: Function that writes the value of a parameter into a MuJoCo specification.
Set = Callable[[Any, float], None]


@dataclass(frozen=True)
class EffectParameter:
    """An effect as a parameter of a MuJoCo model [SI]: value without the effect, initial value, bounds, and function that sets it."""

    effect: str
    joint: int | None
    parameter: str
    neutral: float
    start: float
    low: float
    high: float
    set: Set

    @property
    def name(self) -> str:
        """Unique name of the parameter: the effect and its joint, as ``effect:joint``."""
        return f"{self.effect}:{self.joint or ''}"


def answer(case: SealedCase) -> Answer:
    """Return an answer that names the effects whose parameters, all estimated at once in MuJoCo, differ from their neutral values."""
    sysid = _sysid()
    arm, windows = case.arm, _windows(case)
    effect_parameters = _effect_parameters(arm, windows)
    parameters = _parameters(sysid, arm, effect_parameters)
    residual = sysid.build_residual_fn(
        models_sequences=[_sequences(sysid, arm, windows)],
        modify_residual=_compare(sysid, arm, windows),
        custom_rollout=_delayed(sysid, effect_parameters),
        n_threads=1,
        resample_true=False,
    )
    settings = {"max_iters": ITERATIONS, "eps": FINITE_DIFFERENCE_STEP, "x_scale": _scale(parameters)}
    with contextlib.redirect_stdout(io.StringIO()):
        found, result = sysid.optimize(parameters, residual, optimizer="mujoco", verbose=False, **settings)
    left, _, _ = residual(result.x, found)
    # The Jacobian is scaled, so that no direction of parameters counts as undetermined because of its units.
    scale = _scale(parameters)
    intervals = np.asarray(sysid.calculate_intervals(left, np.asarray(result.jac) * scale)[1]).ravel() * scale
    insights = importlib.import_module("mujoco.sysid.report.sections.insights").AutomatedInsights("", found)
    return _named(effect_parameters, np.asarray(result.x), intervals, _at_bounds(insights))


def _scale(parameters: Any) -> Array:
    """Return a tenth of each parameter's range, which scales all parameters to one size for the optimiser."""
    low, high = parameters.get_bounds()
    scale: Array = 0.1 * (np.asarray(high) - np.asarray(low))
    return scale


def _named(effect_parameters: list[EffectParameter], x: Array, intervals: Array, stuck: list[str]) -> Answer:
    moved = []
    for parameter, value, half in zip(
        effect_parameters,
        x[len(x) - len(effect_parameters) :],
        intervals[len(x) - len(effect_parameters) :],
        strict=True,
    ):
        away = abs(value - parameter.neutral) / half if half > 0 else 0.0
        if away > 1.0 and parameter.name not in stuck:
            size = {parameter.parameter: Size(float(value), float(half) / 1.96)}
            moved.append((away, NamedCause(parameter.effect, parameter.joint, _confidence(away), size)))
    causes = tuple(cause for _, cause in sorted(moved, key=lambda m: -m[0])[:MAX_CAUSES])
    remark = f"at a bound: {', '.join(stuck)}" if stuck else "all parameters within their bounds"
    return Answer("sysid", "effect" if causes else "parameters", causes, remark=remark)


def _confidence(away: float) -> float:
    """Return the confidence of the largest interval that excludes the neutral value, for an estimate `away` half 95 % intervals off."""
    return math.erf(1.96 * away / math.sqrt(2.0))


def _at_bounds(insights: Any) -> list[str]:
    """Return the names of the parameters at a bound, from the warnings in the report of `mujoco.sysid`."""
    warnings = [i["message"] for i in insights.get_context()["insights"] if i["type"] == "warning"]
    return [w.split("<b>")[1].split("</b>")[0] for w in warnings]


def _windows(case: SealedCase) -> list[Window]:
    windows = [w for log in case.training for w in cut(log.t - log.t[0], log.q, log.tau, HORIZON)]
    chosen = np.unique(np.linspace(0, len(windows) - 1, _FITTED_WINDOWS).round().astype(int))
    return [windows[i] for i in chosen]


def _sequences(sysid: Any, arm: Arm, windows: list[Window]) -> Any:
    spec = build_spec(arm)
    model = spec.compile()
    parts = round(arm.sample_period / model.opt.timestep)
    control, sensors, starts = [], [], []
    for w in windows:
        held = np.repeat(w.tau[:-1], parts, axis=0)  # commands are held from sample to sample
        control.append(sysid.TimeSeries(model.opt.timestep * np.arange(len(held) + 1), np.vstack([held, held[-1:]])))
        sensors.append(sysid.TimeSeries.from_names(w.t[1:] - w.t[0], w.q, model))
        starts.append(sysid.create_initial_state(model, w.q0, w.dq0))
    names = [f"window {i}" for i in range(len(windows))]
    return sysid.ModelSequences("arm", spec, names, starts, control, sensors)


def _compare(sysid: Any, arm: Arm, windows: list[Window]) -> Callable[..., Any]:
    """Return a function for predicted minus measured positions, over the standard deviation of the measured displacements in windows."""
    scale = np.std(np.concatenate([w.q - w.q0 for w in windows]), axis=0)

    def compare(params: Any, predicted: Any, measured: Any, model: Any, return_all: bool, *, state: Array) -> Any:
        parts = round(arm.sample_period / model.opt.timestep)
        # Positions are taken from the states, since the sensor values of a step are those at its start.
        shown = state[parts - 1 :: parts, 1 : 1 + arm.n_joints][: len(measured.data)]
        series = sysid.TimeSeries(measured.times, shown, measured.signal_mapping)
        return ((shown - measured.data) / scale).ravel(), series, measured

    return compare


def _delayed(sysid: Any, effect_parameters: list[EffectParameter]) -> Callable[..., Any]:
    """Return a rollout function that delays and lags the commanded torques by the current values of these parameters."""
    late = [k for k in effect_parameters if k.effect in ("actuator_delay", "actuator_lag")]

    def rollout(*, control_signal: Any, param_dicts: Any, **rest: Any) -> Any:
        chunks = len(control_signal) // len(param_dicts)
        shifted = [_late(sysid, c, param_dicts[i // chunks], late) for i, c in enumerate(control_signal)]
        return sysid.sysid_rollout(control_signal=shifted, **rest)

    return rollout


def _late(sysid: Any, control: Any, params: Any, late: list[EffectParameter]) -> Any:
    data, t = control.data.copy(), control.times
    for parameter in late:
        column, value = (parameter.joint or 1) - 1, float(params[parameter.name].value[0])
        change = (
            np.interp(t - value, t, data[:, column])
            if parameter.effect == "actuator_delay"
            else _lagged(data[:, column], t, value)
        )
        data[:, column] = change
    return sysid.TimeSeries(t, data, control.signal_mapping)


def _lagged(u: Array, t: Array, constant: float) -> Array:
    """Return the mean over each step of commands, held from step to step, behind a first-order lag."""
    from scipy.signal import lfilter

    dt = float(t[1] - t[0])
    decay = math.exp(-dt / constant)
    after, _ = lfilter([1.0 - decay], [1.0, -decay], u, zi=[u[0] * decay])
    state = np.concatenate([u[:1], after[:-1]])
    mean: Array = u + (state - u) * constant / dt * (1.0 - decay)
    return mean


def _parameters(sysid: Any, arm: Arm, effect_parameters: list[EffectParameter]) -> Any:
    params = sysid.ParameterDict()
    n, b, low = arm.n_joints, arm.n_inertial, np.maximum(arm.theta - _BOUND_SIGMAS * arm.sigma, 0.05 * arm.theta)
    low = np.where(arm.theta > 0, low, -_BOUND_SIGMAS * arm.sigma)
    high = arm.theta + _BOUND_SIGMAS * arm.sigma

    def inertial(spec: Any, p: Any) -> None:
        set_inertial(spec, arm, p.value)

    def friction(spec: Any, p: Any) -> None:
        for j in range(n):
            spec.joint(f"joint{j}").damping = [p.value[j], 0.0, 0.0]
            set_coulomb(spec, j, p.value[n + j])

    params.add(sysid.Parameter("inertial", arm.theta[:b], low[:b], high[:b], modifier=inertial))
    params.add(sysid.Parameter("friction", arm.theta[b:], low[b:], high[b:], modifier=friction))
    for parameter in effect_parameters:
        params.add(_parameter(sysid, parameter))
    return params


def _parameter(sysid: Any, parameter: EffectParameter) -> Any:
    return sysid.Parameter(
        parameter.name,
        parameter.start,
        parameter.low,
        parameter.high,
        modifier=lambda s, p: parameter.set(s, float(p.value[0])),
    )


def _effect_parameters(arm: Arm, windows: list[Window]) -> list[EffectParameter]:
    """Return the effects that a parameter of MuJoCo expresses and a fit can separate; initial values lie slightly inside the bounds."""
    tau = np.concatenate([w.tau for w in windows])
    speed = np.quantile(np.abs([w.dq0 for w in windows]), 0.95, axis=0)
    travel = np.ptp([w.q0 for w in windows], axis=0)
    return [
        k
        for j in range(arm.n_joints)
        for k in _joint_effect_parameters(arm, j, tau[:, j], float(speed[j]), float(travel[j]))
    ]


def _joint_effect_parameters(arm: Arm, j: int, tau: Array, speed: float, travel: float) -> list[EffectParameter]:
    usual, top = float(np.sqrt(np.mean(tau**2))), float(np.max(np.abs(tau)))
    inertia = float(arm.theta[0] if j == 0 else arm.theta[2])
    number = j + 1

    def parameter(
        effect: str, parameter: str, neutral: float, start: float, low: float, high: float, set_it: Set
    ) -> EffectParameter:
        return EffectParameter(effect, number, parameter, neutral, start, low, high, set_it)

    def offset(spec: Any, v: float) -> None:
        spec.actuator(f"motor{j}").biasprm[0] += v

    def level(spec: Any, v: float) -> None:
        spec.actuator(f"motor{j}").forcelimited = 1
        spec.actuator(f"motor{j}").forcerange = [-v, v]

    def spring(spec: Any, v: float) -> None:
        spec.joint(f"joint{j}").stiffness = [v, 0.0, 0.0]

    def drag(spec: Any, v: float) -> None:
        old = spec.joint(f"joint{j}").damping
        spec.joint(f"joint{j}").damping = [old[0], v, 0.0]

    def armature(spec: Any, v: float) -> None:
        spec.joint(f"joint{j}").armature = v

    def zero(spec: Any, v: float) -> None:
        spec.joint(f"joint{j}").ref = v

    effect_parameters = [
        parameter("actuator_lag", "time_constant", 0.0, 5e-4, 1e-6, 0.05, lambda s, v: None),
        parameter("actuator_delay", "delay", 0.0, 5e-4, 0.0, 0.05, lambda s, v: None),
        parameter("torque_saturation", "level", 1.1 * top, 0.98 * top, 0.2 * top, 1.1 * top, level),
        parameter("joint_spring", "k", 0.0, 0.01 * usual / travel, 0.0, 3.0 * usual / travel, spring),
        parameter("quadratic_drag", "c", 0.0, 0.01 * usual / speed**2, 0.0, 3.0 * usual / speed**2, drag),
    ]
    if arm.rotary:  # on a linear axis a torque offset acts like the weight along the axis
        effect_parameters.append(parameter("torque_offset", "offset", 0.0, 0.0, -usual, usual, offset))
    if j > 0:
        effect_parameters.append(
            parameter("rotor_inertia", "inertia", 0.0, 0.01 * inertia, 0.0, 1.5 * inertia, armature)
        )
    if arm.rotary:
        effect_parameters.append(parameter("encoder_offset", "offset", 0.0, 0.0, -0.4, 0.4, zero))
    return effect_parameters


def _sysid() -> Any:
    try:
        module = importlib.import_module("mujoco.sysid")
    except ImportError as error:
        raise TrialEngineMissingError("mujoco.sysid", "the baseline sysid", "trial-baselines") from error
    if not hasattr(module, "optimize"):
        raise TrialEngineMissingError("mujoco.sysid", "the baseline sysid", "trial-baselines")
    return module


def _check() -> None:
    _sysid()


SYSID = Method(
    "sysid",
    "mujoco.sysid",
    "mujoco.sysid.optimize over windows of 0.25 s; all parameters of the arm within 4 sigmas, and the effects that a MuJoCo parameter "
    "expresses and a fit can separate (offset, lag, delay, saturation, spring, quadratic damping, armature of joint 2, encoder zero), "
    "freed at once; names those whose 95 % interval excludes no effect, unless the report warns of them",
    answer,
    check=_check,
    expresses=EXPRESSED,
)
