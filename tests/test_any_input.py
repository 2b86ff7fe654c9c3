"""Whatever a file holds, reading it ends in a result or in an error of this package."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from armgap import Arm, Log
from armgap.errors import ArmgapError
from conftest import TABLE_ONE

EXAMPLES = 150
SCRAPS = [
    "",
    ",",
    ";",
    "\t",
    "\n",
    '"',
    "#",
    "nan",
    "-inf",
    "1e999",
    "1,5",
    "0x1F",
    "\x00",
    "é",
    "t",
    "q1",
    "[",
    "]",
    "=",
]
hurried = settings(
    derandomize=True, max_examples=EXAMPLES, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def spoilt(text: str) -> st.SearchStrategy[str]:
    """A text with up to four pieces cut out and replaced by scraps."""
    places = st.tuples(st.integers(0, len(text)), st.integers(0, 12), st.sampled_from(SCRAPS))

    def spoil(cuts: list[tuple[int, int, str]]) -> str:
        worse = text
        for start, length, scrap in cuts:
            worse = worse[:start] + scrap + worse[start + length :]
        return worse

    return st.lists(places, min_size=1, max_size=4).map(spoil)


def small_table() -> str:
    t = np.arange(30) * 0.0025
    rows = zip(t, np.sin(t), np.cos(t), 5 * np.cos(9 * t), np.sin(7 * t), strict=True)
    return "t,q1,q2,tau1,tau2\n" + "".join(",".join(f"{x:.6f}" for x in row) + "\n" for row in rows)


def ends_well(read: Callable[[Path], object], path: Path) -> None:
    """Reading gives a result, or an error of one line that names the file and a remedy."""
    failed: ArmgapError | None = None
    try:
        read(path)
    except ArmgapError as error:
        failed = error
    if failed is not None:
        assert "\n" not in str(failed)
        assert path.name in str(failed)
        assert failed.remedy


@given(text=spoilt(small_table()))
@hurried
def test_spoilt_table(text, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    ends_well(Log.read, path)


@given(data=st.binary(max_size=400), suffix=st.sampled_from([".csv", ".parquet", ".tsv"]), magic=st.booleans())
@hurried
def test_any_bytes_as_a_log(data, suffix, magic, tmp_path):
    path = tmp_path / f"log{suffix}"
    path.write_bytes(b"PAR1" + data + b"PAR1" if magic else data)
    ends_well(Log.read, path)


@given(data=st.data())
@hurried
def test_spoilt_parquet(data, seed_log, tmp_path):
    path = tmp_path / "log.parquet"
    seed_log.part(0, 40, "part").write(path)
    # Cut short anywhere. Bytes overwritten inside can make polars' own decoder abort the process, which no caller can catch.
    whole = path.read_bytes()
    path.write_bytes(whole[: data.draw(st.integers(0, len(whole) - 1))])
    ends_well(Log.read, path)


@given(text=spoilt(TABLE_ONE))
@hurried
def test_spoilt_arm_file(text, tmp_path):
    path = tmp_path / "arm.toml"
    path.write_text(text, encoding="utf-8")
    ends_well(Arm.read, path)


@pytest.mark.parametrize("text", ["", "\n", "t\n", "t,q1,tau1\n1\n", ",,,\n1,2,3,4\n", '"t","q1\n', "t,t\n1,1\n"])
def test_small_tables(text, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(ArmgapError):
        Log.read(path)
