"""Effects whose law has several forms: each is simulated, and named by the name of the effect with the form that is in the arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armgap import Arm, Diagnosis, Log, diagnose, simulate
from armgap.evidence.hypothesis import Hypothesis
from armgap.export.correction import correct
from armgap.simulation import Effect

REAL = np.array([0.052, 0.58, 0.018, 0.11])  # kg m^2, N m, N m s/rad, N m
ARM = Arm("bench", "pendulum", 9.81, 0.004, 1.03 * REAL, sigma=0.1 * REAL)
TRUE = replace(ARM, theta=REAL)
FORMS = {
    "dead zone": Effect("torque_dead_zone", 1, {"level": 0.12, "jump": 1.0}),
    "load": Effect("load_dependent_friction", 1, {"mu": 0.2, "of_torque": 1.0}),
    "twice": Effect("position_dependent_friction", 1, {"a": 0.06, "b": -0.05, "twice": 1.0}),
}


def run(seed: int, effect: Effect, seconds: float = 8.0) -> Log:
    """A multisine of its own."""
    t = np.arange(round(seconds / TRUE.sample_period)) * TRUE.sample_period
    draw = np.random.default_rng(seed).uniform(size=(3, 6))
    tau = ((0.2 + 0.4 * draw[0]) * np.sin(np.outer(t, 1.0 + 9.0 * draw[1]) + 6 * draw[2])).sum(axis=1)
    return simulate(TRUE, t, tau, effects=[effect], noise=2e-5, seed=seed, tolerance=1e-6, name=f"run {seed}")


def found(effect: Effect) -> Diagnosis:
    return diagnose(run(1, effect), ARM, holdout=run(2, effect))


def test_a_dead_zone_whose_torque_jumps_at_its_level() -> None:
    diagnosis = found(FORMS["dead zone"])
    cause = diagnosis.causes[0]
    assert (cause.effect, cause.joint) == ("torque_dead_zone", 1)
    assert cause.parameters["level"].value == pytest.approx(0.12, rel=0.08)
    assert cause.parameters["jump"].value > 0.8


@pytest.mark.parametrize("name", ["load", "twice"])
def test_further_forms_of_friction(name: str) -> None:
    effect = FORMS[name]
    diagnosis = found(effect)
    cause = diagnosis.causes[0]
    assert (cause.effect, cause.joint) == (effect.name, 1)
    assert cause.shape == {"load": "torque", "twice": "twice_per_turn"}[name]
    for parameter, value in cause.parameters.items():
        assert value.value == pytest.approx(effect.parameters[parameter], rel=0.1)
    again = Hypothesis.of(diagnosis.to_dict(), ARM).effects[0]
    assert again.parameters == pytest.approx(
        {k: v.value for k, v in cause.parameters.items()} | {list(effect.parameters)[-1]: 1.0}
    )


def test_forms_differ_and_the_first_is_the_default() -> None:
    for effect in FORMS.values():
        form = list(effect.parameters)[-1]
        plain = {name: value for name, value in effect.parameters.items() if name != form}
        first = run(3, replace(effect, parameters=plain), 2.0)
        named = run(3, replace(effect, parameters=plain | {form: 0.0}), 2.0)
        np.testing.assert_allclose(named.q, first.q, atol=1e-6)
        assert np.abs(run(3, effect, 2.0).q - first.q).max() > 1e-3


def test_a_form_of_another_effect_is_refused() -> None:
    for name, values in (("stribeck", {"amplitude": 0.1, "velocity": 0.1}), ("load_dependent_friction", {"mu": 0.1})):
        with pytest.raises(ValueError, match="has no parameter `twice`"):
            run(3, Effect(name, 1, values | {"twice": 1.0}), 1.0)


def test_an_export_states_the_form() -> None:
    remarks = correct(found(FORMS["load"]), ARM).remarks("toml")
    assert any("load_dependent_friction" in line and "shape torque" in line for line in remarks)
