"""`armgap inspect`: what was put into a log is what is said about it."""

from __future__ import annotations

import json
import shlex

import numpy as np
import polars as pl
import pytest

from armgap import Arm, Log, inspect
from armgap.cli.demo import CASE_FOLDER as DEMO
from armgap.errors import LogShapeError, OptionError
from armgap.inspection import columns_of
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


@pytest.fixture
def odd(tmp_path, seed_log: Log):
    """Two seconds in milliseconds and degrees, under names that no standard knows, beside columns of other things."""
    table = pl.DataFrame(
        {
            "note": ["go"] * len(seed_log),
            "Timestamp": 1000 * seed_log.t,
            "shoulderPos": np.degrees(seed_log.q[:, 0]),
            "elbowPos": np.degrees(seed_log.q[:, 1]),
            "target_position": np.zeros(len(seed_log)),
            "shoulder_effort": seed_log.tau[:, 0],
            "elbow_effort": seed_log.tau[:, 1],
        }
    )
    path = tmp_path / "odd log.csv"
    table.write_csv(path, separator=";")
    return path


def test_without_a_mapping_the_columns_are_listed_and_one_is_proposed(run, odd):
    found = columns_of(odd)
    assert [c.name for c in found.columns][:3] == ["note", "Timestamp", "shoulderPos"]
    assert {c.name: c.trend for c in found.columns if c.trend != "varies"} == {
        "note": "text",
        "Timestamp": "rising",
        "target_position": "constant",
    }
    stamps = found.columns[1]
    assert (stamps.low, stamps.high, stamps.rows, stamps.missing) == (0.0, pytest.approx(1997.5), 800, 0)
    assert found.proposed == {
        "t": "Timestamp",
        "q1": "shoulderPos",
        "q2": "elbowPos",
        "tau1": "shoulder_effort",
        "tau2": "elbow_effort",
    }
    assert found.units == {"t": "ms", "q": "deg"}
    status, out, err = run("inspect", odd)
    assert (status, err) == (0, "")
    assert found.options in " ".join(out.split())
    assert "positive where they turn the joint towards greater q" in " ".join(out.split())


def test_what_is_proposed_can_be_run_as_it_stands(run, odd):
    words = shlex.split(columns_of(odd).options)
    status, out, _ = run("inspect", odd, *words)
    assert status == 0
    assert "q2 = elbowPos" in " ".join(out.split())


def test_the_listing_as_data(run, odd):
    status, out, _ = run("inspect", odd, "--json", "-")
    assert status == 0
    data = json.loads(out)
    assert data["schema"] == "armgap.columns/1"
    assert data["proposed"]["tau2"] == "elbow_effort"
    assert data["columns"][0] | {"rows": 800} == data["columns"][0]


def test_nothing_is_proposed_where_no_name_suggests_it(run, tmp_path):
    file = tmp_path / "x.csv"
    pl.DataFrame({"a": np.arange(30.0), "b": np.cos(np.arange(30.0)), "c": np.sin(np.arange(30.0))}).write_csv(file)
    assert columns_of(file).proposed == {"t": "a", "q1": "NAME", "tau1": "NAME"}
    status, out, _ = run("inspect", file)
    assert status == 0
    assert "no column suggests itself for q1, tau1" in " ".join(out.split())


def test_joints_are_in_the_order_of_their_numbers_and_as_many_as_the_arms(arm, tmp_path):
    t = np.arange(40) * 0.0025
    names = ("pos_2", "pos_1", "trq_2", "trq_1", "vel_2", "vel_1")
    pl.DataFrame({"time": t} | {n: np.sin(9 * t + i) for i, n in enumerate(names)}).write_csv(tmp_path / "x.csv")
    proposed = columns_of(tmp_path / "x.csv", arm).proposed
    assert proposed == {
        "t": "time",
        "q1": "pos_1",
        "q2": "pos_2",
        "tau1": "trq_1",
        "tau2": "trq_2",
        "dq1": "vel_1",
        "dq2": "vel_2",
    }


def test_a_mapping_that_is_wrong_is_refused_as_before(run, odd, tmp_path):
    status, out, err = run("inspect", odd, "--columns", "t=Timestamp,q1=nowhere")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "nowhere" in err
    status, _, err = run("inspect", odd, "--report", tmp_path / "x.html")
    assert (status, err.count("\n")) == (2, 1)
    assert not (tmp_path / "x.html").exists()


def test_a_cell_that_is_no_number_is_no_question_of_names(run, frame, tmp_path):
    path = tmp_path / "log.csv"
    texts = ["ERR" if row == 77 else str(q) for row, q in enumerate(frame["q1"])]
    frame.with_columns(q1=pl.Series(texts)).write_csv(path)
    status, out, err = run("inspect", path)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "column `q1`, row 78: `ERR` is not a number" in err
    assert "--columns" not in err


def named(tmp_path, frame, names, *, counts=False):
    """A log of one joint under names of a logger's own."""
    q = (frame["q1"] / (2 * np.pi) * 4096).round() if counts else frame["q1"]
    path = tmp_path / "own.csv"
    pl.DataFrame({name: x for name, x in zip(names, (frame["t"], q, frame["tau1"]), strict=True)}).write_csv(path)
    return path


def test_units_of_names_are_listed_and_read(run, frame, tmp_path):
    path = named(
        tmp_path, frame.with_columns(pl.col("t", "q1", "tau1") * 1000), ("Timestamp_ms", "pos_mrad", "torque_mNm")
    )
    found = columns_of(path)
    assert [c.unit for c in found.columns] == ["ms", "mrad", "mNm"]
    assert (found.units, found.currents, found.problem) == ({}, {}, "")
    status, out, _ = run("inspect", path, *shlex.split(found.options))
    assert status == 0
    assert "torques are in mNm, as the file says" in " ".join(out.split())


@pytest.mark.parametrize(("name", "unit"), [("Motor Current [mA]", "mA"), ("current_A", "A"), ("motorCurrent", "")])
def test_a_current_needs_a_factor(name, unit, run, frame, tmp_path):
    path = named(tmp_path, frame, ("time", "pos", name))
    found = columns_of(path)
    assert found.currents == {"tau1": unit}
    assert found.options.endswith("--factor tau1=VALUE")
    status, out, _ = run("inspect", path)
    assert status == 0
    assert f"`{name}` is a current" in " ".join(out.split())
    status, _, err = run("inspect", path, *shlex.split(found.options))
    assert (status, err.count("\n")) == (2, 1)
    assert "`VALUE` is not a number" in err
    status, out, _ = run("inspect", path, *shlex.split(found.options.replace("VALUE", "0.5")))
    assert status == 0
    largest = 0.5 * frame["tau1"].max()
    assert f"to {largest:.4g}" in " ".join(out.split())


def test_the_present_position_is_no_current(frame, tmp_path):
    found = columns_of(named(tmp_path, frame, ("time", "current_position", "effort")))
    assert (found.proposed["q1"], found.currents) == ("current_position", {})


def test_counts_are_proposed_with_what_they_need(run, frame, tmp_path):
    path, arm_file = named(tmp_path, frame, ("time", "pos", "trq"), counts=True), tmp_path / "arm.toml"
    text = 'kind = "pendulum"\nsample_period = 0.0025\n[inertial]\ntheta = [2.0, 9.0]\n[friction]\nviscous = [1.0]\ncoulomb = [1.0]\n'
    arm_file.write_text(text)
    status, out, _ = run("inspect", path, "--arm", arm_file)
    assert status == 0
    assert "add [encoder] counts_per_rev to the arm file" in " ".join(out.split())
    arm_file.write_text(text + "[encoder]\ncounts_per_rev = [4096]\n")
    found = columns_of(path, Arm.read(arm_file))
    assert (found.units, found.problem) == ({"q": "counts"}, "")
    status, out, _ = run("inspect", path, "--arm", arm_file, *shlex.split(found.options))
    assert status == 0
    assert "position step [rad] 0.001534" in " ".join(out.split())


def test_what_stops_a_proposal_is_said(frame, tmp_path):
    texts = ["ERR" if row == 77 else str(q) for row, q in enumerate(frame["q1"])]
    found = columns_of(named(tmp_path, frame.with_columns(q1=pl.Series(texts)), ("time", "pos", "trq")))
    assert "column `pos`, row 78: `ERR` is not a number" in found.problem


def test_corrections_without_an_arm(run, frame, tmp_path):
    frame.write_parquet(tmp_path / "log.parquet")
    status, out, _ = run("inspect", tmp_path / "log.parquet", "--flip", "tau1")
    assert status == 0
    assert "read with --flip tau1" in " ".join(out.split())
    status, _, err = run("inspect", tmp_path / "log.parquet", "--gravity", "reversed")
    assert (status, err.count("\n")) == (2, 1)
    assert "add --arm" in err


def test_the_page_has_the_conventions_of_its_arm(arm, seed_log):
    page = render([inspect(seed_log, arm)])
    assert 'id="conventions"' in page
    assert "relative to link 1" in page
    assert 'id="conventions"' not in render([inspect(seed_log)])
