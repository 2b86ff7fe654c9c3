"""One table of broken logs, arm files and options: each has its own error, status 2, and nothing is written."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from armgap import Log
from armgap.cli import cli
from armgap.errors import (
    CATALOGUE,
    ArmFileError,
    ArmgapError,
    ColumnError,
    LogReadError,
    LogShapeError,
    ModelFileError,
    OptionError,
    ResultError,
    SampleError,
    TimeError,
    UnitError,
)
from conftest import TABLE_ONE

ROW = 411  # the row that gets broken: the 412th


@dataclass(frozen=True)
class Case:
    """One broken input: how to make it, and what the error has to say."""

    name: str
    error: type[ArmgapError]
    says: tuple[str, ...]
    column: str | None = None
    row: int | None = None


def at(column: str, value: float | None) -> Callable[[pl.DataFrame], pl.DataFrame]:
    """Put a value into the 412th row."""

    def change(frame: pl.DataFrame) -> pl.DataFrame:
        values = frame[column].to_list()
        values[ROW] = value
        return frame.with_columns(pl.Series(column, values, dtype=pl.Float64))

    return change


def times(column: str, factor: float) -> Callable[[pl.DataFrame], pl.DataFrame]:
    return lambda frame: frame.with_columns(pl.col(column) * factor)


def without(*columns: str) -> Callable[[pl.DataFrame], pl.DataFrame]:
    return lambda frame: frame.drop(*columns)


def swapped_times(frame: pl.DataFrame) -> pl.DataFrame:
    t = frame["t"].to_numpy().copy()
    t[[ROW - 1, ROW]] = t[[ROW, ROW - 1]]
    return frame.with_columns(pl.Series("t", t))


def repeated_time(frame: pl.DataFrame) -> pl.DataFrame:
    t = frame["t"].to_numpy().copy()
    t[ROW] = t[ROW - 1]
    return frame.with_columns(pl.Series("t", t))


def small_degrees(frame: pl.DataFrame) -> pl.DataFrame:
    """Half a degree of motion, in degrees and whole encoder counts: only the steps give it away."""
    counts = np.round(np.linspace(0, 1400, frame.height) + 20 * np.sin(np.arange(frame.height)))
    q1 = pl.Series("q1", counts * 360 / 1024000)
    return frame.with_columns(q1).drop("dq1", "dq2")


DEGREE = 180 / math.pi

# Logs that are tables, broken in one place.
TABLES: list[tuple[Case, Callable[[pl.DataFrame], pl.DataFrame]]] = [
    (Case("no time", ColumnError, ("missing", "--columns t="), "t"), without("t")),
    (Case("no torque of joint 2", ColumnError, ("missing", "tau1"), "tau2"), without("tau2")),
    (Case("a joint too few", ColumnError, ("missing",), "q2"), without("q2", "tau2", "dq2")),
    (
        Case("a joint too many", LogShapeError, ("2 joints", "arm file"), "q3"),
        lambda f: f.with_columns(q3=pl.col("q2"), tau3=pl.col("tau2")),
    ),
    (Case("no rows", LogShapeError, ("no samples",)), lambda f: f.head(0)),
    (Case("few rows", LogShapeError, ("12 samples", "20"), "t", 12), lambda f: f.head(12)),
    (Case("missing value", SampleError, ("missing", "cut"), "tau2", 412), at("tau2", None)),
    (Case("not a number", SampleError, ("nan",), "q1", 412), at("q1", math.nan)),
    (Case("infinite", SampleError, ("inf",), "tau1", 412), at("tau1", math.inf)),
    (Case("velocity missing", SampleError, ("missing",), "dq2", 412), at("dq2", None)),
    (Case("time repeats", TimeError, ("repeats", "drop"), "t", 412), repeated_time),
    (Case("time runs backwards", TimeError, ("goes back", "sort"), "t", 412), swapped_times),
    (Case("time in ms, but not the arm's period", UnitError, ("0.0025 s", "--units t=ms"), "t"), times("t", 4e2)),
    (Case("time in us, but not the arm's period", UnitError, ("--units t=us",), "t"), times("t", 4e5)),
    (Case("time in ns, but not the arm's period", UnitError, ("--units t=ns",), "t"), times("t", 4e8)),
    (Case("time in minutes", UnitError, ("give times in s",), "t"), times("t", 1 / 60)),
    (
        Case("degrees", UnitError, ("--units q=deg",), "q1"),
        lambda f: times("q1", DEGREE)(f).drop("dq1", "dq2"),
    ),
    (Case("degrees against velocities", UnitError, ("57", "--units q=deg"), "q2"), times("q2", DEGREE)),
    (Case("velocities in degrees", UnitError, ("57", "--units dq=deg/s"), "dq1"), times("dq1", DEGREE)),
    (Case("degrees by their steps", UnitError, ("encoder count", "--units q=deg"), "q1"), small_degrees),
    (
        Case("encoder counts", UnitError, ("whole numbers", "--units q=counts"), "q1"),
        lambda f: f.with_columns((pl.col("q1") * 1e4).round()).drop("dq1", "dq2"),
    ),
    (Case("torque in N mm", UnitError, ("200", "torque limit"), "tau1"), times("tau1", 1e3)),
    (
        Case("nothing moves", LogShapeError, ("no joint moves",), "q1"),
        lambda f: f.with_columns(q1=0.3, q2=0.1),
    ),
    (Case("no torque", LogShapeError, ("all torques are zero",), "tau1"), lambda f: f.with_columns(tau1=0.0, tau2=0.0)),
    (
        Case("words in a column", ColumnError, ("`fault` is not a number",), "q1", 1),
        lambda f: f.with_columns(q1=pl.lit("fault")),
    ),
    (
        Case("truth values", ColumnError, ("Boolean",), "tau1", 1),
        lambda f: f.with_columns(tau1=pl.col("tau1") > 0),
    ),
    (Case("lists", ColumnError, ("List",), "q2", 1), lambda f: f.with_columns(q2=pl.concat_list("q1", "q2"))),
    (Case("shorter than the horizon", LogShapeError, ("horizon", "longer log")), lambda f: f.head(60)),
    (Case("few windows", LogShapeError, ("windows", "more data")), lambda f: f.head(400)),
]


def csv_lines(frame: pl.DataFrame) -> list[str]:
    return frame.write_csv().splitlines()


def tsv(frame: pl.DataFrame) -> list[str]:
    return frame.write_csv(separator="\t").splitlines()


def put(lines: list[str], row: int, text: str) -> str:
    return "\n".join([*lines[:row], text, *lines[row + 1 :]]) + "\n"


# Logs that are files, broken as files.
FILES: list[tuple[Case, str, Callable[[pl.DataFrame], bytes | str | None]]] = [
    (Case("no such log", LogReadError, ("No such file",)), "none.parquet", lambda f: None),
    (Case("empty file", LogReadError, ("is empty",)), "log.csv", lambda f: ""),
    (Case("unknown ending", LogReadError, (".xlsx", "known")), "log.xlsx", lambda f: "t,q1"),
    (Case("text as Parquet", LogReadError, ("not a Parquet",)), "log.parquet", lambda f: f.write_csv()),
    (Case("cut Parquet", LogReadError, ("cut short",)), "log.parquet", lambda f: _parquet(f)[:5000]),
    (Case("damaged Parquet", LogReadError, ("damaged",)), "log.parquet", lambda f: _damaged(f)),
    (
        Case("cut archive", LogReadError, ("not a readable NumPy archive",)),
        "log.npz",
        lambda f: b"PK\x03\x04" + bytes(99),
    ),
    (Case("text as HDF5", LogReadError, ("not a readable HDF5 file",)), "log.h5", lambda f: f.write_csv()),
    (Case("text as MATLAB", LogReadError, ("not a readable MATLAB file",)), "log.mat", lambda f: f.write_csv()),
    (Case("cut MCAP", LogReadError, ("not a readable MCAP file",)), "log.mcap", lambda f: b"\x89MCAP0\r\n" + bytes(99)),
    (Case("cut bag", LogReadError, ("not a readable ROS bag",)), "log.db3", lambda f: b"SQLite format 3\0" + bytes(99)),
    (
        Case("a unit of something else", UnitError, ("is in ms", "no unit of positions"), "q1 [ms]"),
        "log.csv",
        lambda f: f.write_csv().replace("q1", "q1 [ms]", 1),
    ),
    (Case("only comments", LogReadError, ("comments",)), "log.csv", lambda f: "# t,q1\n# none\n"),
    (Case("only a header", LogReadError, ("no samples",)), "log.csv", lambda f: csv_lines(f)[0] + "\n"),
    (
        Case("no header", ColumnError, ("numbers, not names", "add a header")),
        "log.csv",
        lambda f: "\n".join(csv_lines(f)[1:]),
    ),
    (
        Case("a name twice", ColumnError, ("2 times in the header",), "q1"),
        "log.csv",
        lambda f: f.write_csv().replace("q2", "q1", 1),
    ),
    (
        Case("a row cut short", ColumnError, ("3 values", "7 names"), "q2", 412),
        "log.csv",
        lambda f: put(csv_lines(f), 412, "1.0275,0.1,0.2"),
    ),
    (
        Case("a row too long", ColumnError, ("9 values", "7 names"), "dq2", 412),
        "log.csv",
        lambda f: put(csv_lines(f), 412, csv_lines(f)[412] + ",1,2"),
    ),
    (
        Case("a word among numbers", ColumnError, ("`OVERRUN` is not a number",), "q1", 412),
        "log.csv",
        lambda f: put(csv_lines(f), 412, ",".join(["1.0275", "OVERRUN", *csv_lines(f)[412].split(",")[2:]])),
    ),
    (
        Case("an empty cell", SampleError, ("missing",), "q1", 412),
        "log.csv",
        lambda f: put(csv_lines(f), 412, ",".join(["1.0275", "", *csv_lines(f)[412].split(",")[2:]])),
    ),
    (
        Case("a decimal comma among points", ColumnError, ("`0,5` is not a number", "decimal points"), "q1", 412),
        "log.tsv",
        lambda f: put(tsv(f), 412, "\t".join(["1.0275", "0,5", *tsv(f)[412].split("\t")[2:]])),
    ),
]


def _parquet(frame: pl.DataFrame) -> bytes:
    import io

    buffer = io.BytesIO()
    frame.write_parquet(buffer)
    return buffer.getvalue()


def _damaged(frame: pl.DataFrame) -> bytes:
    data = bytearray(_parquet(frame))
    data[-400:-8] = bytes(392)
    return bytes(data)


# Arm files: a text of the good one and what takes its place.
ARMS: list[tuple[Case, str, str]] = [
    (Case("not TOML", ArmFileError, ("not valid TOML", "line 3")), "gravity = 9.81", "gravity = = 9.81"),
    (Case("unknown key", ArmFileError, ("did you mean `gravity`",), "gravitation"), "gravity", "gravitation"),
    (Case("unknown table", ArmFileError, ("did you mean `friction`",), "frictions"), "[friction]", "[frictions]"),
    (
        Case("unknown key in a table", ArmFileError, ("did you mean `viscous`",), "friction.viscos"),
        "viscous =",
        "viscos =",
    ),
    (Case("no kind", ArmFileError, ("is missing",), "kind"), 'kind = "two-link"\n', ""),
    (
        Case("no description of a serial arm", ModelFileError, ("No such file",)),
        TABLE_ONE,
        'kind = "serial"\nsample_period = 0.002\nurdf = "none.urdf"\n',
    ),
    (Case("unknown kind", ArmFileError, ("did you mean `two-link`",), "kind"), "two-link", "twolink"),
    (Case("kind is a number", ArmFileError, ("must be a string",), "kind"), '"two-link"', "2"),
    (Case("no sample period", ArmFileError, ("is missing",), "sample_period"), "sample_period = 0.0025\n", ""),
    (Case("sample period in ms", ArmFileError, ("2.5", "SI"), "sample_period"), "0.0025", "2.5"),
    (Case("gravity upwards", ArmFileError, ("-9.81",), "gravity"), "9.81", "-9.81"),
    (Case("gravity is text", ArmFileError, ("finite number",), "gravity"), "9.81", '"9.81"'),
    (
        Case("inertial beside links", ArmFileError, ("exactly one",), "inertial"),
        "[friction]",
        "[inertial]\ntheta = [2.35, 0.084, 0.102, 38.5, 1.83]\n[friction]",
    ),
    (Case("too few masses", ArmFileError, ("2 numbers", "1 values"), "links.mass"), "[23.902, 3.880]", "[23.902]"),
    (Case("negative mass", ArmFileError, ("entry 2", "-3.88"), "links.mass"), "3.880", "-3.880"),
    (Case("negative inertia", ArmFileError, ("entry 1",), "links.inertia"), "[1.266", "[-1.266"),
    (Case("no centre of mass", ArmFileError, ("is missing",), "links.com"), "com = [0.091, 0.048]\n", ""),
    (Case("a number that is none", ArmFileError, ("nan", "finite"), "links.length"), "0.45", "nan"),
    (Case("a word for a number", ArmFileError, ("'heavy'",), "links.mass"), "3.880", '"heavy"'),
    (
        Case("no friction", ArmFileError, ("is missing", "[friction]"), "friction"),
        TABLE_ONE[TABLE_ONE.index("[fri") :],
        "",
    ),
    (Case("negative friction", ArmFileError, ("entry 2",), "friction.coulomb"), "1.734", "-1.734"),
    (
        Case("no trust at all", ArmFileError, ("above 0",), "friction.sigma_viscous"),
        "coulomb =",
        "sigma_viscous = [0.1, 0]\ncoulomb =",
    ),
    (Case("no counts", ArmFileError, ("above 0",), "encoder.counts_per_rev"), "1024000", "0"),
    (
        Case("a table that is none", ArmFileError, ("must be a table",), "geometry"),
        "gravity = 9.81",
        "gravity = 9.81\ngeometry = 0.45",
    ),
    (
        Case("a column that is none", ArmFileError, ("not a column",), "columns.q3"),
        "[encoder]",
        '[columns]\nq3 = "x"\n[encoder]',
    ),
    (
        Case("a column mapped twice in the arm file", ArmFileError, ("mapped twice",), "columns.q1"),
        "[encoder]",
        '[columns]\nq1 = "x"\nq2 = "x"\n[encoder]',
    ),
    (Case("no seal", ArmFileError, ("SHA-256",), "sealed.sha256"), "[encoder]", '[sealed]\nsha256 = "12"\n[encoder]'),
    (
        Case("impossible inertia", ArmFileError, ("not positive definite",), "inertial.theta"),
        TABLE_ONE[TABLE_ONE.index("[links]") : TABLE_ONE.index("[friction]")],
        "[inertial]\ntheta = [0.084, 2.351, 0.102, 38.465, 1.825]\n",
    ),
]

# Options after `diagnose LOG --arm ARM`.
OPTIONS: list[tuple[Case, list[str]]] = [
    (Case("no horizon", OptionError, ("horizon", "positive")), ["--horizon", "0"]),
    (Case("horizon is NaN", OptionError, ("horizon",)), ["--horizon", "nan"]),
    (Case("fewer than no causes", OptionError, ("-1",)), ["--max-causes", "-1"]),
    (Case("mapping without a name", OptionError, ("--columns", "q1=NAME")), ["--columns", "q1"]),
    (Case("mapping given twice", OptionError, ("given twice",)), ["--columns", "q1=a,q1=b"]),
    (Case("mapped column missing", ColumnError, ("mapped to q1", "tau1"), "shoulder"), ["--columns", "q1=shoulder"]),
    (Case("column mapped to two", ColumnError, ("mapped to both",), "q2"), ["--columns", "q1=q2,q2=q2"]),
    (Case("mapped joint too many", ColumnError, ("2 joints",), "q3"), ["--columns", "q3=q2"]),
    (Case("mapping of no column", ColumnError, ("not a column",), "speed1"), ["--columns", "speed1=dq1"]),
    (Case("unknown unit", OptionError, ("furlong", "known")), ["--units", "q=furlong"]),
    (Case("unknown group", OptionError, ("tau",)), ["--units", "torque=Nm"]),
    (Case("a length for an angle", OptionError, ("turns",)), ["--units", "q=mm"]),
    (Case("no such holdout", LogReadError, ("No such file",)), ["--holdout", "none.csv"]),
    (Case("no such folder", ResultError, ("folder does not exist",)), ["--json", "none/out.json"]),
]


def _check(case: Case, arguments: list[str], run: Callable[..., tuple[int, str, str]], folder: Path) -> None:
    """The error is of its class, carries its place, and reaches the user as one line with status 2."""
    before = sorted(folder.rglob("*"))
    with pytest.raises(case.error) as caught:
        cli.main(args=arguments, prog_name="armgap", standalone_mode=False)
    assert type(caught.value) is case.error
    assert caught.value.remedy
    assert caught.value.column == case.column or (case.column is None and case.error is ColumnError)
    assert caught.value.row == case.row
    status, out, err = run(*arguments)
    assert status == 2
    assert out == ""
    assert err.count("\n") == 1
    assert err.endswith("\n")
    places = [] if case.error is OptionError else [Path(str(caught.value.file)).name]
    places += [f"`{case.column}`"] if case.column else []
    places += [f"row {case.row}"] if case.row else []
    for words in (*places, *case.says):
        assert words in err
    assert sorted(folder.rglob("*")) == before


def _arguments(log: Path, arm: Path, folder: Path) -> list[str]:
    outputs = ["--json", str(folder / "out.json"), "--report", str(folder / "out.html")]
    return ["diagnose", str(log), "--arm", str(arm), *outputs]


def test_the_unbroken_log_passes(frame: pl.DataFrame, arm: object, tmp_path: Path) -> None:
    for name in ("log.parquet", "log.csv"):
        path = tmp_path / name
        frame.write_parquet(path) if name.endswith("parquet") else frame.write_csv(path)
        assert Log.read(path, arm=arm).findings == ()  # type: ignore[arg-type]


@pytest.mark.parametrize(("case", "change"), TABLES, ids=[c.name for c, _ in TABLES])
def test_table(case, change, frame, arm_file, run, tmp_path):
    log = tmp_path / "log.parquet"
    change(frame).write_parquet(log)
    _check(case, _arguments(log, arm_file, tmp_path), run, tmp_path)


@pytest.mark.parametrize(("case", "name", "content"), FILES, ids=[c.name for c, _, _ in FILES])
def test_file(case, name, content, frame, arm_file, run, tmp_path):
    log = tmp_path / name
    data = content(frame)
    if data is not None:
        log.write_bytes(data if isinstance(data, bytes) else data.encode())
    _check(case, _arguments(log, arm_file, tmp_path), run, tmp_path)


@pytest.mark.parametrize(("case", "good", "bad"), ARMS, ids=[c.name for c, _, _ in ARMS])
def test_arm_file(case, good, bad, frame, run, tmp_path):
    assert good in TABLE_ONE
    log, arm = tmp_path / "log.parquet", tmp_path / "arm.toml"
    frame.write_parquet(log)
    arm.write_text(TABLE_ONE.replace(good, bad, 1))
    _check(case, _arguments(log, arm, tmp_path), run, tmp_path)


@pytest.mark.parametrize(("case", "options"), OPTIONS, ids=[c.name for c, _ in OPTIONS])
def test_option(case, options, frame, arm_file, run, tmp_path):
    log = tmp_path / "log.parquet"
    frame.write_parquet(log)
    _check(case, [*_arguments(log, arm_file, tmp_path), *options], run, tmp_path)


@pytest.mark.parametrize("name", ["log", "arm"])
def test_folder_in_place_of_a_file(name, frame, arm_file, run, tmp_path):
    log = tmp_path / "log.parquet"
    frame.write_parquet(log)
    place = tmp_path / "folder"
    place.mkdir()
    error, paths = (LogReadError, (place, arm_file)) if name == "log" else (ArmFileError, (log, place))
    _check(
        Case(name, error, ("folder",) if name == "log" else ("directory",)), _arguments(*paths, tmp_path), run, tmp_path
    )


@pytest.mark.parametrize(
    ("effect", "says"),
    [
        ("stribeck", "NAME:JOINT:"),
        ("stribek:1:amplitude=1,velocity=1", "stribeck"),
        ("stribeck:1:amplitude=1", "velocity"),
        ("stribeck:1:amplitude=1,velocity=0.1,gap=2", "gap"),
        ("stribeck:3:amplitude=1,velocity=0.1", "joint from 1 to 2"),
        ("stribeck::amplitude=1,velocity=0.1", "joint from 1 to 2"),
        ("base_tilt:1:angle=0.1", "whole arm"),
        ("torque_gain:1:gain=much", "key=number"),
        ("actuator_delay:1:delay=-1", "outside"),
        ("torque_offset:1:offset=nan", "outside"),
    ],
)
def test_effect(effect, says, arm_file, run, tmp_path):
    arguments = ["simulate", "--arm", arm_file, "--torque", "seed", "--effect", effect, "-o", tmp_path / "o.parquet"]
    status, out, err = run(*arguments)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert says in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments",
    [["diagnose"], ["diagnos"], ["diagnose", "--arm"], ["identify", "x", "--arm", "y", "--scheme", "guess"]],
)
def test_words_the_command_line_does_not_know(arguments, run):
    status, out, err = run(*arguments)
    assert (status, out, err.count("\n")) == (2, "", 1)


def test_every_error_has_its_case():
    cases = [case for table in (TABLES, FILES, ARMS, OPTIONS) for case, *_ in table]
    assert {case.error for case in cases} == set(CATALOGUE)
    ours = {error for error in ArmgapError.__subclasses__() if error.__module__ == "armgap.errors"}
    assert ours == set(CATALOGUE)
    assert len({case.name for case in cases}) == len(cases) >= 30
