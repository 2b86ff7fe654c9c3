"""Diagnosis from Python: what goes in, what the JSON promises, what is said about the logs."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from armgap import Arm, Diagnosis, Log, diagnose
from armgap.errors import LogShapeError, OptionError
from armgap.simulation import Effect, simulate
from diagnosis_schema.checking import losses, misfits
from swings import swing

STRIBECK = Effect("stribeck", 1, {"amplitude": 0.15, "velocity": 0.3})


@pytest.fixture(scope="module")
def found(pendulum: Arm) -> Diagnosis:
    training = [swing(pendulum, 1, STRIBECK), swing(pendulum, 2, STRIBECK)]
    return diagnose(training, pendulum, holdout=swing(pendulum, 3, STRIBECK))


@pytest.fixture(scope="module")
def clean(pendulum: Arm) -> Diagnosis:
    return diagnose(swing(pendulum, 1), pendulum)


@pytest.mark.slow
@pytest.mark.parametrize("which", ["found", "clean"])
def test_json_keeps_the_schema(which, request):
    result: Diagnosis = request.getfixturevalue(which)
    assert misfits(json.loads(result.to_json())) == []
    assert losses(result.to_json()) == []
    for out in result.ruled_out:
        assert out.bound or out.why


@pytest.mark.parametrize("which", ["found", "clean"])
def test_json_read_again_is_the_same_diagnosis(which, request):
    result: Diagnosis = request.getfixturevalue(which)
    again = Diagnosis.from_dict(json.loads(result.to_json(indent=2)))
    assert again == result
    assert again.to_dict() == result.to_dict()


def test_keys_of_a_later_version_are_kept(found):
    data = json.loads(found.to_json())
    data["later"] = {"x": 1}
    data["gap"]["later"] = 1
    data["causes"][0]["log"] = "run 1"
    data["causes"][0]["parameters"]["amplitude"]["later"] = 1
    again = Diagnosis.from_dict(data)
    assert again.extra["later"] == {"x": 1}
    assert again.to_dict() == data


def test_a_hidden_effect_is_named_placed_and_sized(found):
    assert found.verdict == "effect"
    first = found.causes[0]
    assert (first.effect, first.joint) == ("stribeck", 1)
    for name, truth in STRIBECK.parameters.items():
        assert abs(first.parameters[name].value / truth - 1) < 0.05
    assert found.gap.after[0] < 0.2 * found.gap.before[0]


@pytest.mark.slow
def test_effects_that_no_log_tells_apart_share_one_probability(tmp_path):
    """A constant force, a tilted base and a shifted zero of a horizontal axis restore the arm file's values alike: one of them is there."""
    file = tmp_path / "axis.toml"
    file.write_text(
        'kind = "axis"\nsample_period = 0.001\n[inertial]\ntheta = [11.0, 0.0]\n[friction]\nviscous = [28.0]\ncoulomb = [14.0]\n'
    )
    axis = Arm.read(file)
    real = dataclasses.replace(axis, theta=np.array([12.0, 0.0, 30.0, 15.0]))

    def run(seed: int) -> Log:
        size, rate, phase = np.random.default_rng(seed).uniform(size=(3, 5))
        t = np.arange(6000) * 0.001
        tau = ((20 + 60 * size)[:, None] * np.sin((2 + 20 * rate)[:, None] * t + 2 * math.pi * phase[:, None])).sum(0)
        return simulate(
            real, t, tau[:, None], effects=[Effect("torque_offset", 1, {"offset": 6.0})], noise=1e-6, seed=seed
        )

    cause = diagnose(run(1), axis, holdout=run(2)).causes[0]
    listed = {cause.effect, *(e.effect for e in cause.equivalents)}
    assert {"torque_offset", "coulomb_asymmetry", "base_tilt"} <= listed
    assert cause.probability > 0.8


def test_a_clean_log_has_no_gap(clean):
    assert clean.verdict == "none"
    assert clean.causes == ()


def loaded_one_way(arm: Arm, seed: int, backlash: Effect) -> Log:
    """Return a log in which gravity keeps the gap of a transmission closed on one side."""
    log = swing(arm, seed, noise=2e-5)
    tau = 0.45 + 0.25 * log.tau[:, 0]
    loaded = simulate(arm, log.t, tau, effects=[backlash], noise=2e-5, seed=seed, name=log.name)
    settled = loaded.t > 1.6
    return dataclasses.replace(loaded, t=loaded.t[settled], q=loaded.q[settled], tau=loaded.tau[settled], moment=None)


@pytest.mark.slow
def test_backlash_that_only_the_training_log_passes_is_no_push(pendulum: Arm) -> None:
    backlash = Effect("backlash", 1, {"gap": 0.01, "rotor_share": 0.1, "riding": 0.0})
    training = swing(pendulum, 3, backlash, noise=2e-5)
    result = diagnose(training, pendulum, holdout=loaded_one_way(pendulum, 4, backlash))
    assert [(c.effect, c.joint) for c in result.causes] == [("backlash", 1)]
    gap = result.causes[0].parameters["gap"]
    assert gap.value == pytest.approx(0.01, abs=max(3 * gap.sigma, 3e-4))
    assert gap.sigma < 1e-3


@pytest.mark.slow
def test_a_gap_of_the_training_logs_alone_is_no_none(pendulum: Arm) -> None:
    """The arm of the holdout has no backlash, so learning from stretches of both by turns explains nothing."""
    backlash = Effect("backlash", 1, {"gap": 0.01, "rotor_share": 0.1, "riding": 0.0})
    result = diagnose(swing(pendulum, 1, backlash, noise=2e-5), pendulum, holdout=swing(pendulum, 2, noise=2e-5))
    assert result.verdict == "unexplained"
    assert result.causes == ()
    assert any("the training logs show a gap" in note for note in result.extra["notes"])
    assert {r.status for r in result.ruled_out if r.effect == "backlash"} == {"undecided"}
    assert "the training logs do" in result.summary()


def test_summary_gives_the_three_answers(found, clean):
    text = found.summary()
    assert all(line.strip() for line in text.splitlines())
    for words in ("Where", "Which", "How far", "tribeck", "joint 1"):
        assert words in text
    assert "tribeck" not in clean.summary()


def test_results_cannot_be_changed(found):
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.verdict = "none"
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.gap.closed = 1.0


def test_no_holdout_is_said_and_cut_from_the_logs(clean):
    assert any("40 %" in note for note in clean.extra["notes"])
    assert clean.to_dict()["holdout"] != clean.to_dict()["training"]


def test_no_training_sample_is_judged_on(pendulum):
    from armgap.diagnosis.prepared_input import split

    whole = swing(pendulum, 1)
    (first,), (last,) = split([whole])
    assert len(first) + len(last) == len(whole)
    np.testing.assert_array_equal(np.concatenate([first.q, last.q]), whole.q)
    assert last.duration == pytest.approx(0.4 * whole.duration, rel=0.01)


def test_the_same_file_on_both_sides_is_said(pendulum, tmp_path):
    path = tmp_path / "run.parquet"
    swing(pendulum, 1).write(path)
    result = diagnose(path, pendulum, holdout=path)
    assert [check.check for check in result.checks] == ["copied_holdout"]


def test_logs_of_one_name_are_told_apart(pendulum, tmp_path):
    paths = []
    for seed, folder in ((1, "monday"), (2, "tuesday")):
        (tmp_path / folder).mkdir()
        paths.append(tmp_path / folder / "run.csv")
        swing(pendulum, seed).write(paths[-1])
    text = diagnose(paths[:1], pendulum, holdout=paths[1:]).to_json()
    assert "monday/run" in text
    assert "tuesday/run" in text


def test_findings_of_the_logs_are_in_the_result(pendulum):
    log = swing(pendulum, 1)
    keep = np.r_[0:900, 1000:2000]
    holed = Log.from_arrays(log.t[keep], log.q[keep], log.tau[keep], name="holed", arm=pendulum)
    result = diagnose(holed, pendulum, holdout=swing(pendulum, 2))
    assert any(f["log"] == "holed" and f["kind"] == "gap" for f in result.extra["log_findings"])
    assert any(remark.startswith("holed: 1 gap of more than 3 sample periods") for remark in result.remarks)


@pytest.mark.slow
def test_the_same_input_gives_the_same_answer(pendulum):
    def answer() -> dict:
        data = diagnose(swing(pendulum, 1, STRIBECK), pendulum, seed=7).to_dict()
        data.pop("seconds", None)
        return data

    assert answer() == answer()


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"horizon": 0.0}, OptionError),
        ({"horizon": math.inf}, OptionError),
        ({"max_causes": -1}, OptionError),
        ({"horizon": 30.0}, LogShapeError),
        ({"holdout": []}, OptionError),
    ],
)
def test_impossible_options(options, error, pendulum):
    with pytest.raises(error) as caught:
        diagnose(swing(pendulum, 1), pendulum, **options)
    assert caught.value.remedy


def test_the_wrong_arm(pendulum, arm):
    with pytest.raises(LogShapeError, match="1 joint"):
        diagnose(swing(pendulum, 1), arm)


def test_json_on_standard_output_is_all_that_is_there(pendulum, tmp_path, run):
    log, arm_path = tmp_path / "run.parquet", tmp_path / "arm.toml"
    swing(pendulum, 1).write(log)
    arm_path.write_text(pendulum.to_toml())
    status, out, err = run("diagnose", log, "--arm", arm_path, "--json", "-", "--quiet")
    assert (status, err) == (0, "")
    assert misfits(json.loads(out)) == []


def test_json_and_report_are_written_whole(pendulum, tmp_path, run):
    log, arm_path = tmp_path / "run.parquet", tmp_path / "arm.toml"
    swing(pendulum, 1).write(log)
    arm_path.write_text(pendulum.to_toml())
    out_json, report = tmp_path / "out.json", tmp_path / "out.html"
    status, _, _ = run("diagnose", log, "--arm", arm_path, "--json", out_json, "--report", report, "--quiet")
    assert status == 0
    assert misfits(json.loads(out_json.read_text())) == []
    assert re.match(r"\s*<!doctype html", report.read_text(), re.IGNORECASE)
    assert sorted(p.name for p in Path(tmp_path).iterdir()) == ["arm.toml", "out.html", "out.json", "run.parquet"]
