"""One run, read from every format, gives equal logs."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from armgap import Arm, Log, diagnose
from armgap.cli.demo import CASE_FOLDER as DEMO
from armgap.errors import ColumnError, LogReadError, TimeError
from armgap.log.formats import FORMATS
from log_files import WRITERS, mcap


def said(log: Log, kind: str) -> str:
    return "; ".join(f.message for f in log.findings if f.kind == kind)


@pytest.fixture(scope="module")
def demo_arm() -> Arm:
    return Arm.read(DEMO / "arm.toml")


@pytest.fixture(scope="module")
def demo_log(demo_arm: Arm) -> Log:
    return Log.read(DEMO / "train-1.parquet", arm=demo_arm).part(0, 1200, "run")


@pytest.mark.parametrize("name", WRITERS)
def test_same_log(name, demo_log, demo_arm, tmp_path):
    log = Log.read(WRITERS[name](demo_log, tmp_path / "run"), arm=demo_arm)
    np.testing.assert_array_equal(log.q, demo_log.q)
    np.testing.assert_array_equal(log.tau, demo_log.tau)
    np.testing.assert_array_equal(log.t, demo_log.t)
    assert log.name == "run"


@pytest.mark.slow
def test_same_diagnosis(demo_log, demo_arm, tmp_path):
    """A stamp in whole nanoseconds and a time in seconds give the same figures."""
    results = [
        diagnose(Log.read(WRITERS[name](demo_log, tmp_path / "run"), arm=demo_arm), demo_arm, max_causes=1)
        for name in ("Parquet", "ROS 2 bag")
    ]
    flat = [
        _numbers({k: r.to_dict()[k] for k in ("gap", "causes", "ruled_out", "parameters", "where")}) for r in results
    ]
    assert len(flat[0]) == len(flat[1]) > 100
    for (path, a), (_, b) in zip(*flat, strict=True):
        assert a == pytest.approx(b, rel=1e-9, abs=1e-9), path
    assert results[0].verdict == results[1].verdict


def _numbers(value, path=""):
    if isinstance(value, dict):
        return [pair for k, v in value.items() for pair in _numbers(v, f"{path}/{k}")]
    if isinstance(value, list | tuple):
        return [pair for i, v in enumerate(value) for pair in _numbers(v, f"{path}/{i}")]
    return [(path, value)] if isinstance(value, int | float) else []


def test_every_format_has_a_writer():
    assert len(FORMATS) == 7
    for known in FORMATS:
        assert any(known.name.split()[0] in name for name in WRITERS), known.name


def test_torques_on_another_clock_are_held(demo_log, demo_arm, tmp_path):
    """Commands at half the rate, 1 ms after every other position: each is held until the next, from its own time on."""
    part = demo_log.part(0, 400, "run")
    path = mcap(part, tmp_path / "run", tau=lambda k: 1_000_000 if k % 2 == 0 else None)
    log = Log.read(path, arm=demo_arm)
    assert len(log) == 399  # the first position has no torque yet
    np.testing.assert_array_equal(log.q, part.q[1:])
    held = [2 * ((k - 1) // 2) for k in range(1, 400)]
    np.testing.assert_array_equal(log.tau, part.tau[held])
    clock = said(log, "clock")
    assert "starting 1 ms after the positions" in clock
    assert "every 5 ms; positions every 2.5 ms" in clock
    assert "recorder's time" in clock
    assert "/joint_states was recorded 0.2 ms after its stamps" in clock
    assert said(log, "cleaned") == "left out before the first torque: 1 row"
    assert "/effort_controller/commands" in said(log, "torque")
    assert "1 is shoulder, 2 is elbow" in said(log, "joints")


def test_joints_by_their_names(demo_log, demo_arm, tmp_path):
    path = mcap(demo_log.part(0, 200, "run"), tmp_path / "run")
    swapped = {"q1": "elbow", "q2": "shoulder", "tau1": "elbow", "tau2": "shoulder"}
    log = Log.read(path, arm=demo_arm, columns=swapped)
    np.testing.assert_array_equal(log.q, demo_log.q[:200, ::-1])
    np.testing.assert_array_equal(log.tau, demo_log.tau[:200, ::-1])


def test_late_and_repeated_messages_are_counted(demo_log, demo_arm, tmp_path):
    from armgap.log.formats import messages

    part = demo_log.part(0, 100, "run")
    path = mcap(part, tmp_path / "run")
    seen: list[messages.Message] = []
    original = messages.record

    def shuffled(incoming, *rest):
        seen.extend(incoming)
        order = [*range(50), 49, 51, 50, *range(52, 100)]
        return original([seen[k] for k in order], *rest)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(messages, "record", shuffled)
        log = Log.read(path, arm=demo_arm)
    np.testing.assert_array_equal(log.q, part.q)
    assert "1 message came late" in said(log, "cleaned")
    assert "left out 1 message like the one before" in said(log, "cleaned")


def test_more_joints_than_the_arm_has_must_be_chosen(demo_log, tmp_path):
    pendulum = Arm("one", "pendulum", 9.81, 0.0025, np.ones(4), sigma=np.ones(4))
    path = mcap(demo_log.part(0, 100, "run"), tmp_path / "run")
    with pytest.raises(ColumnError, match=r"2 joints \(shoulder, elbow\), the arm has 1; .*q1=shoulder,tau1=shoulder"):
        Log.read(path, arm=pendulum)


@pytest.mark.parametrize(
    ("name", "module", "extra"),
    [
        ("MCAP", "mcap.reader", "ros"),
        ("ROS 2 bag", "rosbags.highlevel", "ros"),
        ("HDF5", "h5py", "formats"),
        ("MATLAB 5", "scipy.io", "formats"),
    ],
)
def test_a_missing_extra_is_named(name, module, extra, demo_log, tmp_path, monkeypatch):
    path = WRITERS[name](demo_log.part(0, 50, "run"), tmp_path / "run")
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(LogReadError, match=rf"pip install 'armgap\[{extra}\]'") as caught:
        Log.read(path)
    assert path.name in str(caught.value)


def test_clocks_that_share_no_time(demo_log, tmp_path):
    path = tmp_path / "run.npz"
    np.savez(path, t=demo_log.t[:100], q=demo_log.q[:100], t_tau=50 + demo_log.t[:90], tau=demo_log.tau[:90])
    with pytest.raises(TimeError, match="share no span") as caught:
        Log.read(path)
    assert caught.value.column == "t_tau"


def test_arrays_on_two_clocks(demo_log, tmp_path):
    """Half of the torques, at their own times, in groups that each have a time."""
    import h5py

    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["state/t"], file["state/q"] = demo_log.t[:200], demo_log.q[:200].T  # one column per sample
        file["command/t"], file["command/tau"] = demo_log.t[:200:2], demo_log.tau[:200:2]
        file["state/q"].attrs["units"] = "rad"
    log = Log.read(tmp_path / "run.h5")
    np.testing.assert_array_equal(log.q, demo_log.q[:200])
    np.testing.assert_array_equal(log.tau, np.repeat(demo_log.tau[:200:2], 2, axis=0))
    assert "`state/q` has one column per sample" in said(log, "format")
    assert "`command/t`, every 5 ms" in said(log, "clock")
