"""The same run in every format is the same log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from armgap import Arm, Log, diagnose
from armgap.log.formats import FORMATS
from log_files import WRITERS

ROOT = Path(__file__).resolve().parents[1]
DEMO = ROOT / "demo" / "case"


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
    np.testing.assert_allclose(log.t, demo_log.t, rtol=0, atol=1e-12)
    assert log.name == "run"


def test_same_diagnosis(demo_log, demo_arm, tmp_path):
    """What a stamp in nanoseconds rounds away does not move a figure by 1e-9."""
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
