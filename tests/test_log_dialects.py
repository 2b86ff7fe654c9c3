"""Text in the dialects that loggers write, units that files state, tables in memory, and several logs at once."""

from __future__ import annotations

import math

import numpy as np
import polars as pl
import pytest

from armgap import Log
from armgap.cli.common import parse_columns
from armgap.errors import LogReadError, OptionError, TimeError, UnitError
from armgap.log import gather, paths

DEGREE = 180 / math.pi


def said(log: Log, kind: str) -> str:
    return "; ".join(f.message for f in log.findings if f.kind == kind)


def same(a: Log, b: Log, tolerance: float = 1e-12) -> None:
    for x, y in ((a.t, b.t), (a.q, b.q), (a.tau, b.tau)):
        np.testing.assert_allclose(x, y, rtol=tolerance, atol=tolerance)


def header(text: str, names: str) -> str:
    return names + text[text.index("\n") :]


UNITS = "t [ms],q1 [deg],q2 (°),tau1 [N·m],tau2 [Nm],dq1 [deg/s],dq2 [°/s]"


def in_those_units(f: pl.DataFrame) -> pl.DataFrame:
    return f.with_columns(pl.col("t") * 1e3, pl.col("q1", "q2", "dq1", "dq2") * DEGREE)


@pytest.mark.parametrize(
    ("write", "kind", "says"),
    [
        (lambda f: header(in_those_units(f).write_csv(), UNITS), "units", "positions are in deg, as the file says"),
        (
            lambda f: (
                f.columns.__class__ and ";".join(f.columns) + "\nms;deg;deg;Nm;Nm;deg/s;deg/s\n"
                + in_those_units(f).write_csv(separator=";", include_header=False, decimal_comma=True)
            ),
            "format",
            "decimal commas",
        ),
        (lambda f: header(f.with_columns(pl.col("t") * 1e3).write_csv(), "t_ms," + ",".join(f.columns[1:])), "units", "ms"),
        (lambda f: f.write_csv().replace("\n", ",\n"), "format", ""),
        (lambda f: f.write_csv(include_header=True).replace("\n", ",\n").replace(",\n", "\n", 1), "format", ""),
        (lambda f: "% log of today\n% " + f.write_csv(), "format", "from the comment above"),
        (lambda f: f.write_csv(separator="\t").replace(".", ","), "format", "decimal commas"),
        (lambda f: f.write_csv() + "1.99,0.1", "cleaned", "last row was cut short"),
        (lambda f: "\ufeff" + f.write_csv().encode().decode(), "format", ""),
        (lambda f: "// made by hand\n" + f.write_csv(), "format", ""),
    ],
    ids=[
        "units in names", "row of units", "unit behind a dash", "trailing separators", "trailing, not in the header",
        "header in a comment", "tabs and decimal commas", "torn last row", "byte order mark", "slashes",
    ],
)  # fmt: skip
def test_dialect(write, kind, says, seed_log, arm, frame, tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(write(frame).encode())
    log = Log.read(path, arm=arm)
    same(log, seed_log)
    assert says in said(log, kind)


def test_utf_16_and_windows_1252(seed_log, arm, frame, tmp_path):
    path = tmp_path / "log.csv"
    for encoding in ("utf-16", "cp1252"):
        text = header(in_those_units(frame).write_csv(), UNITS.replace("·", " "))
        path.write_bytes(text.encode(encoding))
        log = Log.read(path, arm=arm)
        same(log, seed_log)
        assert encoding in said(log, "format")


def test_long_text_is_read_in_blocks(seed_log, arm, frame, tmp_path, monkeypatch):
    from armgap.log.formats import text

    path = tmp_path / "log.csv"
    whole = frame.with_columns(mode=pl.when(pl.int_range(pl.len()) > 300).then(pl.lit("swing")).otherwise(pl.lit("7")))
    whole.write_csv(path)
    monkeypatch.setattr(text, "_BLOCK", 100)
    monkeypatch.setattr(text, "_SAMPLE", 10)
    same(Log.read(path, arm=arm), seed_log, 1e-15)


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_times_in_another_unit_are_recognised(unit, seed_log, arm, frame):
    factor = {"ms": 1e3, "us": 1e6, "ns": 1e9}[unit]
    log = Log.from_frame(
        frame.with_columns((pl.col("t") * factor).round().cast(pl.Int64) if unit == "ns" else pl.col("t") * factor),
        arm=arm,
    )
    same(log, seed_log)
    assert f"times are in {unit}: the median period" in said(log, "units")


def test_stamps_since_1970_need_no_arm_and_lose_nothing(seed_log, frame):
    stamps = 1_700_000_000_000_000_000 + (pl.col("t") * 1e9).round().cast(pl.Int64)
    log = Log.from_frame(frame.with_columns(t=stamps))
    np.testing.assert_array_equal(log.t, seed_log.t)
    assert "times are in ns: they are stamps since 1970" in said(log, "units")


def test_degrees_are_recognised_by_velocities_and_by_counts(seed_log, arm, frame):
    degrees = frame.with_columns(pl.col("q1", "q2") * DEGREE)
    log = Log.from_frame(degrees, arm=arm)
    same(log, seed_log)
    assert "positions are in degrees: `q1`" in said(log, "units")
    log = Log.from_frame(degrees.drop("dq1", "dq2"), arm=arm)
    same(log, seed_log)
    assert "whole encoder counts" in said(log, "units")
    fast = frame.with_columns(pl.col("dq1", "dq2") * DEGREE)
    log = Log.from_frame(fast, arm=arm)
    np.testing.assert_allclose(log.dq, seed_log.dq, rtol=1e-12)
    assert "velocities are in deg/s" in said(log, "units")


def test_a_unit_of_something_else_is_refused(frame):
    with pytest.raises(UnitError, match="is in ms, which is no unit of positions"):
        Log.from_frame(frame.rename({"q1": "q1 [ms]"}))
    # What the user declares comes before what the file says.
    assert len(Log.from_frame(frame.rename({"q1": "q1 [deg]"}), units={"q": "rad"})) == frame.height


def test_rows_that_repeat_are_left_out_and_counted(seed_log, frame):
    log = Log.from_frame(pl.concat([frame[:400], frame[399:]]))
    same(log, seed_log, 0)
    assert said(log, "cleaned") == "left out: 1 row like the row before in every value, the first of them row 401"
    other = frame[399:].with_columns(pl.col("q1") + 1e-3)
    with pytest.raises(TimeError, match="repeats"):
        Log.from_frame(pl.concat([frame[:400], other]))


def test_torques_with_their_own_stamps_in_one_table(seed_log, frame):
    shifted = frame.with_columns(t_tau=pl.col("t") + 0.001)
    log = Log.from_frame(shifted)
    np.testing.assert_array_equal(log.tau, seed_log.tau[:-1])
    np.testing.assert_array_equal(log.q, seed_log.q[1:])


def test_tables_in_memory(seed_log, frame):
    pandas = pytest.importorskip("pandas")
    pyarrow = pytest.importorskip("pyarrow")
    columns = {name: frame[name].to_numpy() for name in frame.columns}
    indexed = pandas.DataFrame(columns).set_index("t")
    blocks = {"t": seed_log.t, "q": seed_log.q, "tau": seed_log.tau}
    tables = [frame, frame.lazy(), pandas.DataFrame(columns), indexed, pyarrow.table(columns), columns, blocks]
    for table in tables:
        same(Log.from_frame(table), seed_log, 0)
    assert [log.name for log in gather(tables)] == [f"log {i}" for i in range(1, 8)]
    with pytest.raises(OptionError, match="int is not a log"):
        gather(3)
    with pytest.raises(OptionError, match="not a table"):
        Log.from_frame(object())


def test_patterns(frame, tmp_path, run, arm_file):
    for name in ("b", "a"):
        frame.write_parquet(tmp_path / f"{name}.parquet")
    frame.write_parquet(tmp_path / "c[1].parquet")
    assert [p.name for p in paths([tmp_path / "[ab].parquet", tmp_path / "c[1].parquet"])] == [
        "a.parquet",
        "b.parquet",
        "c[1].parquet",
    ]
    with pytest.raises(LogReadError, match="matches no file"):
        paths([tmp_path / "*.csv"])
    status, out, _ = run("inspect", tmp_path / "[ab].parquet", "--arm", arm_file)
    assert status == 0
    assert out.index("a\n") < out.index("b\n")
    status, _, err = run("diagnose", tmp_path / "*.csv", "--arm", arm_file)
    assert (status, err.count("\n")) == (2, 1)
    assert parse_columns("q1=a") == {"q1": "a"}
