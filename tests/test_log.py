"""Logs: what goes in comes out, under any name, separator and declared unit."""

from __future__ import annotations

import datetime
import io
import math

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armgap import Arm, Log
from armgap.errors import ColumnError, OptionError


def same(a: Log, b: Log, tolerance: float = 0.0) -> None:
    for x, y in ((a.t, b.t), (a.q, b.q), (a.tau, b.tau)):
        np.testing.assert_allclose(x, y, rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize("name", ["log.parquet", "log.csv"])
def test_written_and_read_again(name, seed_log, arm, tmp_path):
    seed_log.write(tmp_path / name)
    again = Log.read(tmp_path / name, arm=arm)
    same(again, seed_log)
    np.testing.assert_array_equal(again.dq, seed_log.dq)
    assert again.name == "log"
    assert [p.name for p in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize(
    "write",
    [
        lambda f: f.write_csv(separator=";"),
        lambda f: f.write_csv(separator="\t"),
        lambda f: f.write_csv(separator=";", decimal_comma=True),
        lambda f: f.write_csv().replace(",", "  "),
        lambda f: f.write_csv().replace(",", ", "),
        lambda f: "\ufeff" + f.write_csv().replace("\n", "\r\n"),
        lambda f: "# a comment\n\n" + f.write_csv().replace("\n", "\n# another, with commas\n", 1),
        lambda f: '"t","q1","q2","tau1","tau2","dq1","dq2"\n' + f.write_csv(include_header=False),
        lambda f: f.write_csv(float_scientific=True, float_precision=17),
    ],
    ids=[
        "semicolon",
        "tab",
        "decimal comma",
        "blanks",
        "comma and blank",
        "Windows",
        "comments",
        "quoted",
        "exponents",
    ],
)
def test_text_in_many_forms(write, seed_log, arm, tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(write(seed_log.to_polars()).encode())
    same(Log.read(path, arm=arm), seed_log, 1e-15)


def test_standard_input(seed_log, arm, monkeypatch):
    class Stream:
        buffer = io.BytesIO(seed_log.to_polars().write_csv().encode())

    monkeypatch.setattr("sys.stdin", Stream)
    log = Log.read("-", arm=arm)
    same(log, seed_log)
    assert log.name == "stdin"


def test_columns_by_mapping_arm_file_and_standard_name(seed_log, arm, frame):
    import dataclasses

    other = frame.rename({"t": "time", "q1": "shoulder", "tau2": "elbow torque"})
    names = {"t": "time", "q1": "shoulder", "tau2": "elbow torque"}
    same(Log.from_frame(other, columns=names), seed_log)
    mapped = dataclasses.replace(arm, columns=names)
    same(Log.from_frame(other, arm=mapped), seed_log)
    # What armgap wrote itself has standard names, and is read with the same arm file.
    same(Log.from_frame(frame, arm=mapped), seed_log)
    # A mapping given by hand wins over the arm file's.
    twice = other.with_columns(torque=pl.col("elbow torque") * 0.5)
    log = Log.from_frame(twice, arm=mapped, columns={"tau2": "torque"})
    np.testing.assert_allclose(log.tau[:, 1], 0.5 * seed_log.tau[:, 1])


def test_other_columns_are_ignored_and_types_do_not_matter(seed_log, frame):
    more = frame.with_columns(mode=pl.lit("swing"), q1=pl.col("q1").cast(pl.Float32), extra=None)
    same(Log.from_frame(more), seed_log, 1e-6)


def test_declared_units(seed_log, arm, frame):
    degrees = frame.with_columns(
        pl.col("t") * 1e3, pl.col("q1", "q2", "dq1", "dq2") * 180 / math.pi, pl.col("tau1", "tau2") * 1e3
    )
    units = {"t": "ms", "q": "deg", "dq": "deg/s", "tau": "mNm"}
    log = Log.from_frame(degrees, arm=arm, units=units)
    same(log, seed_log, 1e-12)
    np.testing.assert_allclose(log.dq, seed_log.dq, rtol=1e-12)


def test_declaring_radians_settles_a_joint_that_spins(frame, arm):
    spinning = frame.with_columns(q1=pl.col("t") * 30.0).drop("dq1", "dq2")
    assert Log.from_frame(spinning, arm=arm, units={"q": "rad"}).q[-1, 0] > 50


def test_times_with_a_type_know_their_unit(seed_log, frame):
    start = datetime.datetime(2026, 3, 1, 12, 0, 0)
    stamps = pl.Series("t", [start + datetime.timedelta(microseconds=2500 * i) for i in range(frame.height)])
    for column in (stamps, stamps.cast(pl.Datetime("ns")), stamps - start):
        same(Log.from_frame(frame.with_columns(column)), seed_log, 1e-12)


def test_time_starts_anywhere(seed_log, frame):
    log = Log.from_frame(frame.with_columns(pl.col("t") + 1.7e9))
    assert log.t[0] == 0
    np.testing.assert_allclose(log.t, seed_log.t, atol=5e-7)  # what is left of a double after 1.7e9 s


@pytest.mark.parametrize(
    ("change", "kind", "says"),
    [
        (lambda f: f.filter(~pl.col("t").is_between(0.5, 0.52)), "gap", "1 gap"),
        (lambda f: f.with_columns(pl.col("t") + 0.0004 * (pl.int_range(pl.len()) % 2)), "sampling", "399 of 799"),
        (lambda f: f.with_columns(pl.col("t") * 2).drop("dq1", "dq2"), "period", "5 ms"),
        (lambda f: f.with_columns(tau2=0.0), "constant", "`tau2` is constant at 0"),
        (lambda f: f.with_columns(pl.col("tau2") * 2), "limit", "limit of 15"),
        (lambda f: f.drop("dq1"), "columns", "`dq2`"),
    ],
)
def test_findings(change, kind, says, frame, arm):
    found = {f.kind: f.message for f in Log.from_frame(change(frame), arm=arm).findings}
    assert says in found[kind]


def test_a_gap_names_its_row(frame, arm):
    [gap] = [
        f
        for f in Log.from_frame(frame.filter(~pl.int_range(pl.len()).is_between(411, 419)), arm=arm).findings
        if f.kind == "gap"
    ]
    assert "after row 411" in gap.message
    assert "25 ms" in gap.message


def test_arrays_in_and_read_only_out(seed_log):
    t, q, tau = (np.array(x) for x in (seed_log.t, seed_log.q, seed_log.tau))
    log = Log.from_arrays(t, q, tau)
    same(log, seed_log)
    assert log.q.flags.c_contiguous
    with pytest.raises(ValueError, match="read-only"):
        log.q[0, 0] = 1.0
    q[0, 0] = 7.0  # the caller's own arrays stay the caller's
    assert log.q[0, 0] == seed_log.q[0, 0]
    with pytest.raises(OptionError, match=r"\(799, 2\)"):
        Log.from_arrays(t, q[1:], tau)


def test_one_joint_needs_no_second_axis():
    t = np.arange(100) * 1e-2
    log = Log.from_arrays(t, np.sin(t), np.cos(t))
    assert log.q.shape == log.tau.shape == (100, 1)
    assert log.n_joints == 1


def test_part_keeps_the_times_of_the_whole(seed_log):
    part = seed_log.part(300, 500, "middle")
    np.testing.assert_array_equal(part.t, seed_log.t[300:500])
    assert len(part) == 200
    np.testing.assert_array_equal(part.q, seed_log.q[300:500])


@settings(max_examples=50, deadline=None)
@given(
    row=st.integers(0, 99),
    column=st.sampled_from(["t", "q1", "tau1"]),
    value=st.sampled_from([math.nan, math.inf, -math.inf, None]),
)
def test_no_value_that_is_not_finite_gets_through(row, column, value):
    t = np.arange(100) * 1e-2
    data = {"t": t.tolist(), "q1": np.sin(t).tolist(), "tau1": np.cos(t).tolist()}
    data[column][row] = value
    with pytest.raises(ValueError, match=rf"column `{column}`, row {row + 1}:"):
        Log.from_frame(pl.DataFrame(data))


def test_unknown_column_lists_what_is_there(frame):
    with pytest.raises(ColumnError) as caught:
        Log.from_frame(frame.rename({"t": "stamp"}))
    assert "stamp, q1, q2, tau1, tau2" in str(caught.value)


def test_encoder_counts_in_degrees_are_not_taken_for_radians(arm: Arm):
    """The check for degrees by their steps stays quiet on steps in radians."""
    t = np.arange(800) * arm.sample_period
    step = 2 * math.pi / 1024000
    q1 = np.round(np.sin(9 * t) / step) * step
    tau = np.column_stack([np.cos(t), np.sin(t)])
    assert Log.from_arrays(t, np.column_stack([q1, q1]), tau, arm=arm).n_joints == 2
