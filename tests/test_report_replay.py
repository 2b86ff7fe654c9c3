"""`armgap replay`: poses, predictions, and a recording that holds both."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import report_cases as cases
from armgap import Log
from armgap.errors import OptionError
from armgap.report.forms.replay import RerunMissingError, models, poses, predicted, write_replay

HORIZON = 0.25


def test_the_two_link_arm_hangs_down_and_bends_at_its_elbow(arm) -> None:
    arm = type(arm)(**{**vars(arm), "link_length": np.array([0.45, 0.30])})
    down, out, bent = poses(arm, np.array([[0.0, 0.0], [np.pi / 2, 0.0], [0.0, np.pi / 2]]))
    np.testing.assert_allclose(down, [[0, 0], [0, -0.45], [0, -0.75]], atol=1e-12)
    np.testing.assert_allclose(out, [[0, 0], [0.45, 0], [0.75, 0]], atol=1e-12)
    np.testing.assert_allclose(bent, [[0, 0], [0, -0.45], [0.30, -0.45]], atol=1e-12)


def test_links_keep_their_lengths_in_every_pose(arm) -> None:
    arm = type(arm)(**{**vars(arm), "link_length": np.array([0.45, 0.30])})
    q = np.random.default_rng(1).uniform(-6, 6, size=(50, 2))
    lengths = np.linalg.norm(np.diff(poses(arm, q), axis=1), axis=2)
    np.testing.assert_allclose(lengths, np.tile([0.45, 0.30], (50, 1)))


def test_an_arm_without_lengths_cannot_be_drawn(arm) -> None:
    with pytest.raises(OptionError, match="link_length"):
        poses(type(arm)(**{**vars(arm), "link_length": None}), np.zeros((2, 2)))


def test_the_model_with_causes_predicts_what_the_diagnosis_says() -> None:
    log = cases.swing(3, cases.STRIBECK)
    errors = {
        name: float(np.sqrt(np.mean((predicted(model, log, HORIZON) - log.q) ** 2)))
        for name, model in models(cases.ARM, cases.named()).items()
    }
    gap = cases.named().gap
    assert errors["arm file"] == pytest.approx(gap.before[0], rel=0.3)
    assert errors["with causes"] < 0.3 * errors["arm file"]
    assert list(models(cases.ARM, None)) == ["arm file"]


def test_the_command_writes_a_recording(run, tmp_path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'armgap[rerun]'")
    (tmp_path / "arm.toml").write_text(cases.ARM.to_toml())
    (tmp_path / "d.json").write_text(cases.named().to_json())
    cases.swing(3, cases.STRIBECK).write(tmp_path / "log.parquet")
    command = ["replay", tmp_path / "log.parquet", "--arm", tmp_path / "arm.toml", "--diagnosis", tmp_path / "d.json"]
    status, out, err = run(*command, "-o", tmp_path / "out.rrd")
    assert (status, err) == (0, "")
    assert "out.rrd" in out
    recording = (tmp_path / "out.rrd").read_bytes()
    assert recording.startswith(b"RRF")
    for name in ("measured", "arm_file", "with_causes"):
        assert f"/arms/{name}".encode() in recording
        assert f"/q1/{name}".encode() in recording


def test_without_the_sdk_a_replay_says_what_to_install(monkeypatch, tmp_path) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    log: Log = cases.swing(3)
    with pytest.raises(RerunMissingError, match=r"pip install 'armgap\[rerun\]'"):
        write_replay({}, log, cases.ARM, tmp_path / "x.rrd")


@pytest.mark.parametrize(
    ("words", "says"),
    [(["-o", "x.mp4"], ".rrd"), (["--horizon", "0"], "horizon"), (["--diagnosis", "no.json"], "no.json")],
)
def test_what_cannot_be_replayed_is_refused(run, tmp_path, words, says, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.toml").write_text(cases.ARM.to_toml())
    cases.swing(3).write(tmp_path / "log.parquet")
    status, out, err = run("replay", tmp_path / "log.parquet", "--arm", tmp_path / "arm.toml", *words)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert says in err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["arm.toml", "log.parquet"]
