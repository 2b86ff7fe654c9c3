"""Text in the dialects that loggers write, units that files state, tables in memory, and several logs at once."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl
import pytest

from armgap import Arm, Log
from armgap.arm.corrections import Corrections
from armgap.cli.common import parse_columns
from armgap.errors import ColumnError, LogReadError, OptionError, TimeError, UnitError
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


def stamps(t: pl.Expr) -> pl.Expr:
    """Nanoseconds since 1970, exactly."""
    return (t * 1e9).round().cast(pl.Int64) + 1_700_000_000_000_000_000


def quoted_with_commas(f: pl.DataFrame) -> str:
    lines = f.write_csv(separator=";").replace(".", ",").splitlines()
    return "\n".join(";".join(f'"{cell}"' for cell in line.split(";")) for line in lines)


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
        (lambda f: f.write_csv() + "1.99" + ",0.1" * (len(f.columns) - 2) + ",", "cleaned", "last row was cut short"),
        (lambda f: f.write_csv() + "1.99" + ",0.1" * (len(f.columns) - 2) + ",3.7e-", "cleaned", "last row was cut short"),
        (lambda f: quoted_with_commas(f), "format", "decimal commas"),
        (lambda f: f.with_columns(pl.from_epoch(stamps(pl.col("t")), "ns").dt.to_string("iso")).write_csv(), "format", ""),
        (lambda f: "\ufeff" + f.write_csv().encode().decode(), "format", ""),
        (lambda f: "// made by hand\n" + f.write_csv(), "format", ""),
    ],
    ids=[
        "units in names", "row of units", "unit behind a dash", "trailing separators", "trailing, not in the header",
        "header in a comment", "tabs and decimal commas", "torn last row", "torn before the last value", "torn within it",
        "quoted decimal commas", "dates as text", "byte order mark", "slashes",
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


def dates(frame: pl.DataFrame, offset: Callable[[int], str]) -> pl.DataFrame:
    """The frame with dates as text in winter time until row 400 and in summer time from there on, each with its offset from UTC."""
    start = np.datetime64("2026-03-29T00:59:59", "ns")
    utc = start + (frame["t"] * 1e9).round().cast(pl.Int64).to_numpy().astype("timedelta64[ns]")
    hours = np.where(np.arange(len(frame)) < 400, 1, 2)
    local = utc + hours.astype("timedelta64[h]")
    texts = [str(t).replace("T", " ")[:23] + offset(int(h)) for t, h in zip(local, hours, strict=True)]
    return frame.with_columns(t=pl.Series(texts))


@pytest.mark.parametrize("offset", ["+{:02d}:00", "+{:02d}00", "+{:02d}", " +{:02d}:00"])
def test_dates_with_an_offset_from_utc(offset, seed_log, frame, tmp_path):
    """As pandas, polars and databases write them; the change to summer time is no jump."""
    path = tmp_path / "log.csv"
    frame = frame.with_columns(pl.col("t") * 0.4)  # 1 ms, which three decimals hold
    dates(frame, offset.format).write_csv(path)
    np.testing.assert_allclose(Log.read(path).t, 0.4 * seed_log.t, atol=1e-9)


def test_dates_as_pandas_writes_them(seed_log, frame, tmp_path):
    pandas = pytest.importorskip("pandas")
    path = tmp_path / "log.csv"
    table = pandas.DataFrame({name: frame[name].to_numpy() for name in frame.columns})
    table["t"] = pandas.to_datetime(table["t"], unit="s", utc=True).dt.round("us").dt.tz_convert("Europe/Berlin")
    table.to_csv(path, index=False)
    assert "+01:00" in path.read_text()
    same(Log.read(path), seed_log, 1e-9)


@pytest.mark.parametrize(
    ("texts", "says"),
    [
        ({3: "ERR"}, "row 4: `ERR` is not a date, as the other times are"),
        ({3: None}, "row 4: the value is missing"),
        (dict.fromkeys(range(800), "05.01.2026 12:00:00,004"), "dates like 2026-01-05T12:00:00.004"),
    ],
    ids=["a word", "an empty cell", "other dates"],
)
def test_what_is_no_date_is_named_with_its_row(texts, says, frame):
    changed = dates(frame, "+{:02d}:00".format)["t"].to_list()
    for row, text in texts.items():
        changed[row] = text
    with pytest.raises(ColumnError) as caught:
        Log.from_frame(frame.with_columns(t=pl.Series(changed)))
    assert says in str(caught.value)


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


def one_joint(frame: pl.DataFrame) -> pl.DataFrame:
    return frame.select("t", "q1", "tau1", "dq1")


def test_units_of_counters_are_converted(frame, tmp_path):
    path = tmp_path / "log.csv"
    f = one_joint(frame)
    f = f.with_columns(pl.col("q1") * 1e3, pl.col("dq1") * 30 / math.pi, pl.col("tau1") * 1e3)
    path.write_text(header(f.write_csv(), "t,q1 [mrad],tau1 [N mm],dq1 [rpm]"))
    log = Log.read(path)
    for column, name in ((log.q, "q1"), (log.tau, "tau1"), (log.dq, "dq1")):
        np.testing.assert_allclose(column[:, 0], frame[name].to_numpy(), rtol=1e-12, atol=1e-12)


def test_a_unit_of_one_column(frame):
    degrees = frame.with_columns(pl.col("q2") * DEGREE)
    log = Log.from_frame(degrees, units={"q2": "deg"})
    np.testing.assert_allclose(log.q, frame.select("q1", "q2").to_numpy(), rtol=1e-12)
    with pytest.raises(OptionError, match="`t1` is not a group of columns"):
        Log.from_frame(frame, units={"t1": "ms"})
    with pytest.raises(OptionError, match="`q3` is no column of an arm with 1 joint"):
        Log.from_frame(one_joint(frame), arm=counter(), units={"q3": "deg"})


@pytest.mark.parametrize("mapped", [False, True])
@pytest.mark.parametrize(("names", "column"), [("t,q1,tau1 [A]", "tau1 [A]"), ("t,q1 [gon],tau1", "q1 [gon]")])
def test_a_unit_that_is_not_known_is_refused_until_it_is_declared(names, column, mapped, frame, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(header(frame.select("t", "q1", "tau1").write_csv(), names))
    key = column.split()[0]
    columns = {key: column} if mapped else None
    with pytest.raises(UnitError, match="a unit that is not known") as caught:
        Log.read(path, columns=columns)
    unit = {"q": "rad", "tau": "Nm"}[key[:-1]]
    assert f"--units {key[:-1]}={unit}" in caught.value.remedy
    assert caught.value.column == column
    log = Log.read(path, columns={key: column}, units={key[:-1]: unit})
    np.testing.assert_array_equal(log.tau[:, 0], frame["tau1"].to_numpy())


@pytest.mark.parametrize(
    ("names", "factors"),
    [
        ("Timestamp_ms,pos_deg,torque_mNm", (1e3, DEGREE, 1e3)),
        ("time s,elbow pos mrad,elbow torque Ncm", (1, 1e3, 1e2)),
        ("t_us,angle_turns,torque_kgfcm", (1e6, 1 / (2 * math.pi), 1 / 0.0980665)),
        ("t,q_rad,trq_nm", (1, 1, 1)),
        # What also means something else, or is no unit of the column's quantity, is no unit: elbow of the right arm, motor m.
        ("t,pos_m,torque_rev", (1, 1, 1)),
        ("t,pos_ms,torque_deg", (1, 1, 1)),
    ],
)
def test_units_behind_names_of_any_kind(names, factors, frame, tmp_path):
    path = tmp_path / "log.csv"
    f = frame.select(*(pl.col(name) * factor for name, factor in zip(("t", "q1", "tau1"), factors, strict=True)))
    path.write_text(header(f.write_csv(), names))
    log = Log.read(path, columns=dict(zip(("t", "q1", "tau1"), names.split(","), strict=True)))
    for values, name in ((log.t, "t"), (log.q[:, 0], "q1"), (log.tau[:, 0], "tau1")):
        np.testing.assert_allclose(values, frame[name].to_numpy(), rtol=1e-9, atol=1e-9)
    assert ("as the file says" in said(log, "units")) == (factors != (1, 1, 1))


def test_a_current_is_read_with_a_factor_alone(frame, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(header(frame.select("t", "q1", pl.col("tau1") * 50).write_csv(), "t,q1,i_q mA"))
    columns = {"tau1": "i_q mA"}
    with pytest.raises(
        UnitError, match=r"`mA`, a unit that is not known.*--factor tau1=VALUE, N m at the joint per mA"
    ):
        Log.read(path, columns=columns)
    arm = Arm(
        "bench",
        "pendulum",
        9.81,
        0.0025,
        np.ones(4),
        sigma=np.ones(4),
        corrections=Corrections.parse(factor="tau1=0.02"),
    )
    log = Log.read(path, columns=columns, arm=arm)
    np.testing.assert_allclose(log.tau[:, 0], frame["tau1"].to_numpy(), rtol=1e-12)


def counter(**changed: Any) -> Arm:
    """A pendulum with an encoder of 4096 counts per turn of the joint."""
    return replace(
        Arm("bench", "pendulum", 9.81, 0.0025, np.ones(4), sigma=np.ones(4), counts_per_rev=[4096]), **changed
    )


def in_counts(frame: pl.DataFrame, per_turn: float = 4096) -> pl.DataFrame:
    return frame.select("t", (pl.col("q1") / (2 * math.pi) * per_turn).round().alias("q1"), "tau1")


def test_positions_in_counts_are_converted_by_the_arm_file(frame):
    for counts in (in_counts(frame), in_counts(frame).cast({"q1": pl.Int64})):
        log = Log.from_frame(counts, arm=counter(), units={"q": "counts"})
        assert np.max(np.abs(log.q[:, 0] - frame["q1"].to_numpy())) <= math.pi / 4096 + 1e-9
        assert log.units["q1"] == "counts"
    named = Log.from_frame(in_counts(frame).rename({"q1": "q1 [counts]"}), arm=counter())
    np.testing.assert_array_equal(named.q, log.q)
    assert "positions are in counts, as the file says" in said(named, "units")
    speeds = in_counts(frame).with_columns(dq1=frame["dq1"] / (2 * math.pi) * 4096)
    log = Log.from_frame(speeds, arm=counter(), units={"q": "counts", "dq": "counts/s"})
    np.testing.assert_allclose(log.dq[:, 0], frame["dq1"].to_numpy(), rtol=1e-12)


@pytest.mark.parametrize("per_turn", [100, 400, 4096, 36000])
def test_positions_in_whole_numbers_are_counts(per_turn, frame):
    """Whatever their number, with velocities in rad/s or without; degrees are offered as well, and never taken."""
    counts = in_counts(frame, per_turn)
    for f in (counts, counts.with_columns(frame["dq1"])):
        for arm in (None, counter(counts_per_rev=None)):
            with pytest.raises(
                UnitError, match=r"moves in whole numbers.*\[encoder\] counts_per_rev.*counts per turn of the joint"
            ):
                Log.from_frame(f, arm=arm)
        with pytest.raises(UnitError, match=r"looks like counts: add --units q=counts, or --units q=deg") as caught:
            Log.from_frame(f, arm=counter(counts_per_rev=[per_turn]))
        assert caught.value.column == "q1"
    Log.from_frame(counts, units={"q": "deg"})


def test_counts_without_their_number_per_turn_are_refused(frame):
    for arm, says in ((None, "give an arm file with"), (counter(counts_per_rev=None), "bench does not say.*add")):
        with pytest.raises(UnitError, match=f"is in counts, and .*{says} .*counts_per_rev.*times the gear ratio"):
            Log.from_frame(in_counts(frame), arm=arm, units={"q": "counts"})
    second = in_counts(frame).with_columns(q_link1=pl.col("q1"))
    for table in (second, second.rename({"q_link1": "q_link1 [counts]"})):
        with pytest.raises(UnitError, match=r"may not be in counts: counts_per_rev .* that of the encoder of `q1`"):
            Log.from_frame(table, arm=counter(), units={"q": "counts"})
    declared = second.rename({"q_link1": "q_link1 [counts]"}).with_columns(frame["q1"])
    assert len(Log.from_frame(declared, arm=counter(), units={"q": "rad"})) == len(frame)
    fine = second.with_columns(frame["q1"].alias("q_link1 [rad]")).drop("q_link1")
    log = Log.from_frame(fine, arm=counter(), units={"q": "counts"})
    assert log.q_link is not None
    np.testing.assert_array_equal(log.q_link[:, 0], frame["q1"].to_numpy())


def test_a_row_of_units_with_one_that_is_not_known_is_no_row_of_numbers(frame, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(frame.select("t", "q1", "tau1").write_csv().replace("\n", "\ns,rad,A\n", 1))
    with pytest.raises(UnitError, match="`A`, a unit that is not known"):
        Log.read(path)


def test_names_in_brackets_and_words_for_no_unit_are_no_units():
    from armgap.log.conversion.spellings import foreign, is_foreign

    assert foreign("position[elbow]") is None
    assert foreign("q1 (elbow)") is None
    assert foreign("q1 [0]") is None
    assert foreign("q1 [mrad]") is None
    assert not is_foreign("none")
    assert not is_foreign("-")
    assert is_foreign("mA")


def test_a_column_without_a_number_is_the_only_joint(frame):
    f = frame.select("t", pl.col("q1").alias("q"), pl.col("tau1").alias("tau"))
    log = Log.from_frame(f)
    np.testing.assert_array_equal(log.q[:, 0], frame["q1"].to_numpy())
    with pytest.raises(ColumnError, match="q1"):
        Log.from_frame(f.with_columns(frame["q2"]))


def test_stamps_of_two_clocks_in_two_units_agree(frame):
    f = frame.select("q1", "tau1", t=pl.from_epoch(stamps(pl.col("t")), "ns"), t_tau=pl.col("t") + 1.7e9)
    log = Log.from_frame(f)
    # A number of seconds since 1970 is known to 0.2 us, so some torques come a row later.
    assert len(log) > len(frame) - 3
    assert np.mean(log.tau[:, 0] == frame["tau1"].to_numpy()[-len(log) :]) > 0.3
    assert "stamps in s" in said(log, "units")


@pytest.mark.parametrize(
    ("name", "left"), [("seed", True), ("runs/seed.csv", True), ("seed.csv", True), ("other", False)]
)
def test_a_span_to_be_left_out_names_a_log_or_its_file(name, left, seed_log):
    corrected = Corrections(skip=(f"{name}:0-0.5",)).on_log(seed_log)
    assert (len(corrected) < len(seed_log)) == left
    assert ("--skip" in said(corrected, "corrected")) == left


def test_torques_on_a_clock_in_another_unit_last_as_long_as_the_positions(frame):
    log = Log.from_frame(frame.select("q1", "tau1", (pl.col("t") * 1e3).alias("t [ms]"), t_tau="t"))
    assert "last as long" in said(log, "units")
    assert np.mean(log.tau[:, 0] == frame["tau1"].to_numpy()[-len(log) :]) > 0.9
