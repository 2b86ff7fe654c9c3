"""Damaged files of every format: a log, or one error that names the file; never a traceback, a crash or a hang."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from armgap import Log
from armgap.errors import ArmgapError, LogReadError
from armgap.log import guard
from armgap.log.recording import Source
from damaged import damaged, small_log
from log_files import WRITERS

COUNT = 200


def ends_well(path: Path, named: str) -> bool:
    """Whether reading gives a log; otherwise the error is of one line and names the file and a remedy."""
    failed: ArmgapError | None = None
    try:
        Log.read(path)
    except ArmgapError as error:
        failed = error
    if failed is not None:
        assert "\n" not in str(failed)
        assert named in str(failed)
        assert failed.remedy
    return failed is None


@pytest.mark.parametrize("name", [n for n in WRITERS if not n.startswith("ROS")])
def test_damaged(name, tmp_path):
    whole = WRITERS[name](small_log(), tmp_path / "log")
    data = whole.read_bytes()
    read = 0
    for i, worse in enumerate(damaged(data, COUNT, seed=len(name))):
        path = tmp_path / f"log{i}{whole.suffix}"
        path.write_bytes(worse)
        read += ends_well(path, path.name)
        path.unlink()
    assert read < COUNT
    assert [p.name for p in tmp_path.iterdir()] == [whole.name]


@pytest.mark.parametrize("part", ["metadata.yaml", "*.db3", "*.mcap"])
def test_damaged_bag(part, tmp_path):
    whole = WRITERS["ROS 2 bag in MCAP" if part == "*.mcap" else "ROS 2 bag"](small_log(), tmp_path / "bag")
    inner = next(whole.glob(part))
    data = inner.read_bytes()
    read = 0
    count = COUNT if part == "*.db3" else COUNT // 2
    for worse in damaged(data, count, seed=3):
        inner.write_bytes(worse)
        read += ends_well(whole, whole.name)
    assert read < count


def test_a_page_that_claims_too_much_is_refused_with_its_place(tmp_path):
    """The size in a page's header is damaged: trusted, it would end the whole process in an allocation of 2^61 bytes."""
    path = WRITERS["Parquet"](small_log(300), tmp_path / "log")
    data = bytearray(path.read_bytes())
    data[7] ^= 0x01  # the uncompressed size of the first page, a varint in zigzag: now negative
    path.write_bytes(data)
    with pytest.raises(LogReadError, match=r"row group 1, column `t`: the page at byte 4"):
        Log.read(path)


def crash(source: Source) -> None:
    """What a library does to its process over a damaged file."""
    import os
    import signal

    os.kill(os.getpid(), signal.SIGSEGV)


def sleep(source: Source) -> None:
    """What a library does in an endless loop."""
    import time

    time.sleep(60)


def test_a_reader_that_crashes_is_an_error_and_the_next_one_works(tmp_path):
    path = WRITERS["HDF5"](small_log(), tmp_path / "log")
    with pytest.raises(guard.CrashedError, match="crashed"):
        guard.call("test_log_damaged", "crash", Source(path))
    assert len(Log.read(path)) == 40
    assert pickle.loads(pickle.dumps(Source(path))) == Source(path)


def test_a_reader_that_never_ends_is_stopped(tmp_path, monkeypatch):
    path = WRITERS["NumPy"](small_log(), tmp_path / "log")
    monkeypatch.setattr(guard, "_PATIENCE_S", 0.5)
    with pytest.raises(guard.CrashedError, match="too long"):
        guard.call("test_log_damaged", "sleep", Source(path))
