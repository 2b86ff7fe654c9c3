"""Verdicts that agree with their tables, values that are not believed, candidates that are not named, and the same bytes every time."""

from __future__ import annotations

import copy
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import report_cases
from armgap import Arm, Diagnosis, Log, _native, diagnose
from armgap.diagnosis.diagnosis import _columns
from armgap.evidence import plausibility
from armgap.simulation import Effect
from next_experiment.cases import Case, log_of, multisine, play, poor, write_arm
from swings import off, swing

SEVERAL, CONSEQUENCE = 4.0, 1e-3
STRIBECK = Effect("stribeck", 1, {"amplitude": 0.15, "velocity": 0.3})
PUSHES = [Effect("external_pulse", 1, {"impulse": 0.05, "time": time, "duration": 0.06}) for time in (2.0, 4.0, 6.0)]


def as_they_stand(arm: Arm, training: Log, holdout: Log, **options: Any) -> dict[str, Any]:
    """The diagnosis of logs as they are, before anything checks or repairs them."""
    logs = [[log.to_native()] for log in (training, holdout)]
    return json.loads(_native.diagnose(arm.to_native(), *logs, {"horizon": 0.25, "max_causes": 4, **options}))


def contradicts(data: dict[str, Any]) -> bool:
    """Whether a verdict says that nothing is left where several floors are, of consequence beside the motion."""
    gap = data["gap"]
    left = any(
        after > SEVERAL * floor and after > CONSEQUENCE * motion
        for after, floor, motion in zip(gap["after"], gap["floor"], gap["motion"], strict=True)
    )
    return left and data["verdict"] in ("none", "parameters")


def held(log: Log, rows: int) -> Log:
    return replace(log, q=log.q[np.arange(len(log.t)) // rows * rows])


@pytest.mark.parametrize("rows", [2, 3, 5])
def test_held_positions_do_not_pass_for_noise(pendulum: Arm, rows: int) -> None:
    logs = [held(swing(off(pendulum), seed), rows) for seed in (1, 2)]
    data = as_they_stand(pendulum, *logs, max_causes=0)
    [floor], [after] = data["gap"]["floor"], data["gap"]["after"]
    assert data["noise"]["position_sigma"][0] < 1.4 * 2e-4
    assert after > SEVERAL * floor
    assert not contradicts(data)


@pytest.mark.parametrize("seed", [6, 12])
def test_a_wrong_arm_file_beside_coarse_encoders_is_a_matter_of_parameters(tmp_path: Path, seed: int) -> None:
    """The first prediction errs by a hundred times the noise, and some windows begin where a joint stops."""
    case = Case("geared", "stribeck", 1, {"amplitude": 0.1, "velocity": 0.1})
    arm, arm_file = write_arm(case, seed, tmp_path)
    reference = multisine(arm_file, "geared", 10.0, seed)
    found = diagnose(log_of(play(case, arm, reference, hidden=False), "log"), arm_file, max_causes=0)
    assert found.verdict == "parameters"
    assert max(a / f for a, f in zip(found.gap.after, found.gap.floor, strict=True)) < 1.5
    names = [*(f"theta{i}" for i in range(1, 6)), "viscous1", "viscous2", "coulomb1", "coulomb2"]
    for name, true in zip(names, arm.theta, strict=True):
        found_value = found.parameters["refit"][name]
        assert abs(found_value.value - true) < 4 * found_value.sigma, name


@pytest.mark.parametrize(("model", "seed"), [("geared", 7101), ("pendulum", 7112)])
def test_a_large_motion_is_no_outlier_beside_a_small_one(tmp_path: Path, model: str, seed: int) -> None:
    """The arm file predicts the small log well and the large one badly; re-estimated parameters explain both."""
    case = Case(model, "stribeck", 1, {"amplitude": 0.1, "velocity": 0.1})
    arm, arm_file = write_arm(case, seed, tmp_path)
    small, large = poor(arm, model), multisine(arm_file, model, 5.0, seed)
    logs = [
        log_of(play(case, arm, motion, hidden=False), name) for motion, name in ((small, "small"), (large, "large"))
    ]
    found = diagnose(logs, arm_file)
    assert found.verdict == "parameters"
    assert max(a / f for a, f in zip(found.gap.after, found.gap.floor, strict=True)) < 1.2


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_known_noise_is_the_floor(pendulum: Arm, seed: int) -> None:
    """What the true arm misses by, from starts measured with a known noise."""
    data = as_they_stand(pendulum, swing(pendulum, seed), swing(pendulum, seed + 10), max_causes=0)
    [floor], [before] = data["gap"]["floor"], data["gap"]["before"]
    assert data["verdict"] == "none"
    assert data["noise"]["position_sigma"] == [pytest.approx(2e-4, rel=0.1)]
    assert 0.7 < floor / before < 1.4


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("off_by", [0.02, 0.04])
def test_a_model_that_is_wrong_raises_no_floor(pendulum: Arm, seed: int, off_by: float) -> None:
    """A weight that is off and trusted: most windows are missed by more than their starts, and the others by no less for that."""
    logs = swing(pendulum, seed), swing(pendulum, seed + 10)
    trusted = replace(pendulum, sigma=np.full(len(pendulum.theta), 1e-9))
    wrong = replace(trusted, theta=pendulum.theta * np.where(np.arange(len(pendulum.theta)) == 1, 1.0 + off_by, 1.0))
    [true] = as_they_stand(trusted, *logs, max_causes=0)["gap"]["before"]
    gap = as_they_stand(wrong, *logs, max_causes=0)["gap"]
    assert gap["after"][0] > 3.0 * true
    assert 0.7 < gap["floor"][0] / true < 1.4


@pytest.fixture(scope="module")
def turned(pendulum: Arm) -> dict[str, Any]:
    """An arm file whose gravity pulls the other way."""
    wrong = replace(pendulum, theta=pendulum.theta * [1, -1, 1, 1])
    data = as_they_stand(wrong, swing(pendulum, 1), swing(pendulum, 2), max_causes=0)
    return {**data, "plausibility": plausibility(data, wrong)}


def test_gravity_turned_over_is_said_and_not_plausible(turned: dict[str, Any]) -> None:
    [sanity] = [s for s in turned["sanity"] if s["kind"] == "sign"]
    assert sanity["parameter"] == "theta2"
    assert sanity["message"] in turned["notes"]
    [check] = [p for p in turned["plausibility"] if "gravity" in p["check"]]
    assert not check["holds"]


def test_sanity_and_candidates_are_read_back(turned: dict[str, Any]) -> None:
    data = copy.deepcopy(turned)
    data["candidates"] = [{**report_cases.named().to_dict()["causes"][0], "why": "its probability is 0.20"}]
    found = Diagnosis.from_dict(data)
    assert [(s.parameter, s.kind) for s in found.sanity] == [(s["parameter"], s["kind"]) for s in data["sanity"]]
    [candidate] = found.candidates
    assert (candidate.effect, candidate.why) == ("stribeck", "its probability is 0.20")
    assert found.to_dict() == data


def test_sigmas_without_bound_do_not_stop_the_fit(pendulum: Arm) -> None:
    free = replace(pendulum, theta=1.2 * pendulum.theta, sigma=np.full(4, 1e12))
    data = as_they_stand(free, swing(pendulum, 1), swing(pendulum, 2))
    assert data["verdict"] == "parameters"
    for name, true in zip(("theta1", "theta2"), pendulum.theta, strict=False):
        assert data["parameters"]["with_causes"][name]["value"] == pytest.approx(true, rel=0.02)
    assert any("sigma of theta1" in note for note in data["notes"])


def test_an_arm_that_cannot_be_moved_is_said_to_be_stuck(pendulum: Arm) -> None:
    theta = pendulum.theta * [1e7, 1e7, 1, 1]
    heavy = replace(pendulum, theta=theta, sigma=0.1 * theta)
    data = as_they_stand(heavy, swing(pendulum, 1), swing(pendulum, 2), max_causes=0)
    assert data["verdict"] == "unexplained"
    assert data["sanity"]


def test_a_value_that_no_arm_has_is_a_candidate(pendulum: Arm) -> None:
    """Torques at the motor's side of a gear of 50: whatever is found, no gain of 50 is named."""
    logs = [replace(log, tau=log.tau / 50) for log in (swing(pendulum, 1), swing(pendulum, 2))]
    data = as_they_stand(pendulum, *logs)
    gains = [c for c in data["causes"] if c["effect"] == "torque_gain"]
    assert all(0.5 <= c["parameters"]["gain"]["value"] <= 2.0 for c in gains)
    assert all(c["probability"] >= 0.3 for c in data["causes"])
    assert all(c["why"] for c in data["candidates"])
    assert not contradicts(data)
    if not data["causes"] and not any(data["options"]["friction_widths"]):
        assert data["gap"]["after"] == data["gap"]["refit"]


@pytest.fixture(scope="module")
def pushed(pendulum: Arm) -> list[Log]:
    return [swing(pendulum, 1, *PUSHES), swing(pendulum, 2)]


@pytest.mark.parametrize("most", [0, 1])
def test_pushes_are_named_beside_the_effects_allowed(pendulum: Arm, pushed: list[Log], most: int) -> None:
    """Events of a log, not properties of the arm: all three of them with one effect allowed, and none if no cause is to be named."""
    found = diagnose(pushed[0], pendulum, holdout=pushed[1], max_causes=most)
    named, rest = (found.causes, found.candidates) if most else (found.candidates, found.causes)
    assert [c.effect for c in named] == ["external_pulse"] * 3
    assert rest == ()
    assert {c.log for c in named} == {"run 1"}
    assert any("no cause was allowed" in note for note in found.extra["notes"]) == (most == 0)
    if most == 0:
        assert found.gap.after == found.gap.refit


_RUN = """
import json, sys
from armgap import Arm, diagnose
from armgap.simulation import Effect
from swings import swing
arm = Arm.read(sys.argv[1])
hidden = Effect("stribeck", 1, {"amplitude": 0.15, "velocity": 0.3})
data = diagnose(swing(arm, 1, hidden), arm, holdout=swing(arm, 3, hidden)).to_dict()
del data["seconds"]
print(json.dumps(data))
"""


def test_one_thread_and_two_give_the_same_bytes(tmp_path: Any) -> None:
    from swings import PENDULUM

    file = tmp_path / "pendulum.toml"
    file.write_text(PENDULUM)

    def result(threads: int) -> bytes:
        env = {**os.environ, "RAYON_NUM_THREADS": str(threads), "PYTHONPATH": os.pathsep.join(sys.path)}
        return subprocess.run([sys.executable, "-c", _RUN, file], env=env, capture_output=True, check=True).stdout

    assert result(1) == result(2)


def test_a_joint_that_stands_still_asks_for_no_other_columns(pendulum: Arm) -> None:
    given = SimpleNamespace(arm=pendulum, training=[swing(pendulum, 1)], holdout=[swing(pendulum, 2)])
    still = {"gap": {"after": [0.1], "motion": [0.0], "horizon_s": 0.25}}
    assert _columns(still, given) == []
