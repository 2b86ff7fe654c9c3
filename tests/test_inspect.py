"""`armgap inspect`: what was put into a log is what is said about it."""

from __future__ import annotations

import json

import numpy as np
import polars as pl
import pytest

from armgap import Arm, Log, inspect
from armgap.cli.demo import CASE_FOLDER as DEMO
from armgap.errors import LogShapeError, OptionError
from armgap.inspection.channels import step_of
from armgap.inspection.page import render


def made(n: int = 4000, h: float = 1e-3, step: float = 2e-4, limit: float = 5.0) -> Log:
    """Motion in the first half and rest in the second, an encoder, and a torque cut off at a limit."""
    t = np.arange(n) * h
    q = np.where(t < t[-1] / 2, np.sin(2 * np.pi * 2 * t), 0.0)
    tau = np.clip(8 * np.cos(2 * np.pi * 2 * t), -limit, limit)
    return Log.from_arrays(t, np.round(q / step) * step, tau, name="made")


def test_sampling():
    found = inspect(made())
    s = found.sampling
    assert (s.samples, s.gaps) == (4000, 0)
    assert s.rate_hz == pytest.approx(1000)
    assert s.jitter_s < 1e-9


def test_jitter_and_gaps():
    rng = np.random.default_rng(1)
    t = np.arange(2000) * 1e-3 + 2e-5 * rng.standard_normal(2000)
    t[1000:] += 0.05
    t[1500:] += 0.02
    s = inspect(Log.from_arrays(t, np.sin(9 * t), np.cos(9 * t))).sampling
    assert s.gaps == 2
    assert s.widest[0][0] == pytest.approx(0.999, abs=1e-3)
    assert s.widest[0][1] == pytest.approx(0.051, abs=2e-4)
    assert s.jitter_s == pytest.approx(np.sqrt(2) * 2e-5, rel=0.1)


def test_steps_saturation_and_rest():
    [j] = inspect(made()).joints
    assert j.q_step == pytest.approx(2e-4, rel=1e-6)
    assert j.tau_step is None
    assert [f.level for f in j.flat_tops] == [5.0, -5.0]
    # |8 cos| is at 5 or beyond for this share of the time, half of it on either side.
    share = np.arccos(5 / 8) / np.pi
    assert j.flat_tops[0].share == pytest.approx(share, abs=0.01)
    assert j.flat_tops[0].longest_s == pytest.approx(share / 2, abs=0.005)
    assert j.rest == pytest.approx(0.5, abs=0.02)
    assert j.rest + j.motion == pytest.approx(1)
    assert j.reversals == 8


@pytest.mark.parametrize("step", [1e-6, 3.7e-5, 2 * np.pi / 1024000, 0.01])
def test_the_step_of_a_channel(step):
    q = np.sin(np.arange(4000) / 50.0)
    assert step_of(np.round(q / step) * step) == pytest.approx(step, rel=1e-6)
    assert step_of(q + 1e-7 * np.random.default_rng(1).standard_normal(4000)) is None


def test_excitation_by_oracle(arm: Arm, seed_log: Log):
    """The seed's torques excite all parameters; a log in which joint 2 is at rest tells nothing about its friction."""
    found = inspect(seed_log, arm).excitation
    assert found is not None
    assert {p.excited for p in found.parameters} == {"well"}
    assert 1 < found.condition < 1e3
    still = Log.from_arrays(seed_log.t, seed_log.q * [1, 0], seed_log.tau, arm=arm)
    poor = inspect(still, arm).excitation
    assert poor is not None
    excited = {p.name: p.excited for p in poor.parameters}
    assert {excited["viscous2"], excited["coulomb2"]} == {"not"}
    assert excited["coulomb1"] == "well"
    assert poor.condition > 1e3 * found.condition


def test_information_adds_up(arm: Arm, seed_log: Log):
    """``P^-1 - P0^-1`` of recursive least squares is ``sum psi' psi``: for a line through data it is the Gram matrix."""
    from armgap.inspection.excitation import _information

    whole = _information(seed_log, arm)
    halves = [_information(seed_log.part(*rows, "half"), arm) for rows in ((0, 400), (400, 800))]
    np.testing.assert_allclose(np.diag(halves[0] + halves[1]), np.diag(whole), rtol=0.1)
    np.testing.assert_allclose(whole, whole.T, rtol=1e-6, atol=1e-9 * np.abs(whole).max())


def test_command(run, tmp_path):
    log, out, page = DEMO / "train-1.parquet", tmp_path / "i.json", tmp_path / "i.html"
    status, said, _ = run("inspect", log, "--arm", DEMO / "arm.toml", "--json", out, "--report", page)
    assert status == 0
    for words in ("400 Hz", "position step", "condition number", "viscous2"):
        assert words in said
    data = json.loads(out.read_text())
    assert data["schema"] == "armgap.inspection/1"
    assert data["columns"]["q1"] == "q1"
    assert len(data["excitation"]["parameters"]) == 9
    html = page.read_text()
    assert "position step" in html
    assert "<script" in html
    assert "https://" not in html.replace("https://www.w3.org", "").partition("<script")[0]


def test_several_logs_and_no_arm(run, tmp_path, frame):
    frame.rename({"q1": "shoulder"}).write_parquet(tmp_path / "a.parquet")
    frame.rename({"q1": "shoulder"}).write_csv(tmp_path / "b.csv")
    status, said, _ = run("inspect", tmp_path / "?.*", "--columns", "q1=shoulder", "--json", tmp_path / "i.json")
    assert status == 0
    assert "q1 = shoulder" in said
    data = json.loads((tmp_path / "i.json").read_text())
    assert [d["log"] for d in data] == ["a", "b"]
    assert data[0]["joints"] == data[1]["joints"]
    assert data[0]["excitation"] is None


def test_user_strings_are_escaped(frame):
    log = Log.from_frame(frame.rename({"q1": "<b>q1"}), columns={"q1": "<b>q1"}, name="<script>x")
    html = render([inspect(log)])
    assert "<b>q1" not in html
    assert "<script>x" not in html


def test_refused(arm, frame, tmp_path):
    with pytest.raises(LogShapeError, match="1 joints, the arm has 2"):
        inspect(made(), arm)
    with pytest.raises(OptionError, match="2 logs"):
        inspect([frame, frame])


def test_what_was_left_out_and_where_gaps_are_is_counted_listed_and_drawn():
    frame = made().to_polars()
    found = inspect(pl.concat([frame[:100], frame[99:300], frame[320:]]))
    times = {f.kind: f.times for f in found.findings if f.times}
    assert times["cleaned"] == pytest.approx([0.099])
    assert times["gap"] == pytest.approx([0.299])
    assert "1 row like the row before" in " ".join(f.message for f in found.findings)
    text = render([found])
    assert '"left out"' in text
    assert '"gap"' in text
