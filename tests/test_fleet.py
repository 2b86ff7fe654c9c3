"""Fleets: manifests, entries that fail, restarts, tables, what drifts and which robot is the odd one."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from armgap import Arm
from armgap.errors import OptionError
from armgap.fleet import Entry, Fleet, read_manifest, run_fleet
from armgap.fleet.manifest import ManifestError
from armgap.fleet.page import fleet_document, moved
from armgap.fleet.series import moving, odd
from armgap.fleet.tables import PARAMETERS, SUMMARY, owner, parameter_rows, summary_rows
from armgap.fleet.work import answer, answer_within, content_keys
from fleet_size.broken import WAYS
from fleets import fleet_of
from swings import off, swing


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory, pendulum: Arm) -> Path:
    """A manifest of four visits of two robots and two broken entries, with its files."""
    folder = tmp_path_factory.mktemp("fleet")
    (folder / "arm.toml").write_text(pendulum.to_toml(), encoding="utf-8")
    for seed in (1, 2, 3, 4):
        swing(off(pendulum), seed).write(folder / f"run-{seed}.parquet")
    (folder / "broken.csv").write_text("nothing\n", encoding="utf-8")
    rows = [
        ("north", "run-1.parquet", "run-2.parquet", "2026-01-01"),
        ("north", "run-3.parquet", "", "2026-01-02"),
        ("south", "run-2.parquet;run-3.parquet", "run-1.parquet", "2026-01-01"),
        ("south", "run-4.parquet", "", "2026-01-02"),
        ("west", "broken.csv", "", "2026-01-01"),
        ("west", "run-9.parquet", "", ""),
    ]
    lines = ["robot,arm,logs,holdout,time", *(f"{r},arm.toml,{logs},{held},{t}" for r, logs, held, t in rows)]
    (folder / "manifest.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def fleet(place: Path) -> Fleet:
    return run_fleet(read_manifest(place / "manifest.csv"), place / "out", workers=2)


def test_every_entry_has_its_rows(fleet: Fleet, place: Path) -> None:
    assert fleet.answered == 6
    assert dict(fleet.summary.schema) == SUMMARY
    assert dict(fleet.parameters.schema) == PARAMETERS
    assert set(fleet.summary["robot"]) == {"north", "south", "west"}
    assert fleet.failed["robot"].to_list() == ["west", "west"]
    assert all("\n" not in error for error in fleet.failed["error"])
    assert "run-9.parquet" in fleet.failed["error"][1]
    good = fleet.summary.filter(pl.col("error").is_null())
    assert good["verdict"].null_count() == 0
    assert fleet.parameters.filter(pl.col("of") == "arm").group_by(["robot", "time"]).len()["len"].to_list() == [4] * 4
    for name, table in (("summary", fleet.summary), ("parameters", fleet.parameters)):
        assert pl.read_parquet(place / "out" / f"{name}.parquet").equals(table)
    assert "West" in (place / "out" / "index.html").read_text(encoding="utf-8").title()
    diagnoses = [p for p in (place / "out" / "diagnoses").iterdir() if not p.name.endswith(".error.json")]
    assert len(diagnoses) == 4
    assert all(json.loads(p.read_text(encoding="utf-8"))["schema"].startswith("armgap") for p in diagnoses)


def test_a_second_run_computes_nothing_and_says_the_same(fleet: Fleet, place: Path) -> None:
    entries = read_manifest(place / "manifest.csv")
    again = run_fleet(entries, place / "out", workers=2)
    assert again.answered == 0
    assert again.summary.equals(fleet.summary)
    # By content: another order and other names of the same files are the same diagnoses, other settings are not.
    (place / "copy.parquet").write_bytes((place / "run-3.parquet").read_bytes())
    moved = [Entry("north", entries[1].arm, (str(place / "copy.parquet"),), (), "", 1)]
    assert run_fleet(moved, place / "out").answered == 0
    assert run_fleet(moved, place / "out", {"horizon": 0.2}).answered == 1


def test_a_failed_entry_is_tried_again_once_its_file_is_there(fleet: Fleet, place: Path) -> None:
    entries = read_manifest(place / "manifest.csv")[5:]
    (place / "run-9.parquet").write_bytes((place / "run-4.parquet").read_bytes())
    mended = run_fleet(entries, place / "out")
    assert mended.failed.height == 0
    (place / "run-9.parquet").unlink()


def test_an_entry_that_takes_too_long_is_lost_and_tried_again(place: Path) -> None:
    entries = read_manifest(place / "manifest.csv")[:1]
    lost = run_fleet(entries, place / "slow", limit_s=0.01)
    assert "took longer" in lost.failed["error"][0]
    assert run_fleet(entries, place / "slow").failed.height == 0


def test_each_way_of_being_broken_has_its_own_line(place: Path, tmp_path: Path) -> None:
    said = set()
    for way in WAYS:
        arm, log = tmp_path / f"{way.__name__}.toml", tmp_path / f"{way.__name__}.parquet"
        shutil.copyfile(place / "arm.toml", arm)
        shutil.copyfile(place / "run-1.parquet", log)
        way(arm, log)
        outcome = answer(Entry("r", str(arm), (str(log),), (), "", 1), {})
        assert f"{tmp_path}/{way.__name__}." in outcome["error"]
        assert "\n" not in outcome["error"]
        said.add(outcome["error"].split(": ", 1)[1])
    assert len(said) == len(WAYS)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_entry_is_stopped_within_its_own_process(place: Path) -> None:
    """As on a Ray cluster, where nothing outside of the process stops it."""
    [entry] = read_manifest(place / "manifest.csv")[:1]
    late = answer_within(entry, {}, 0.05)
    assert "took longer than 0.05 s" in late["lost"]
    assert "diagnosis" in answer_within(entry, {}, 600.0)
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_a_run_that_was_killed_goes_on(place: Path) -> None:
    words = [
        sys.executable,
        "-c",
        "from armgap.cli import main; main()",
        "fleet",
        str(place / "manifest.csv"),
        "-o",
        str(place / "killed"),
        "--workers",
        "1",
    ]
    running = subprocess.Popen(words, start_new_session=True, stdout=subprocess.DEVNULL)
    diagnoses = place / "killed" / "diagnoses"
    for _ in range(100):
        if diagnoses.is_dir() and any(diagnoses.glob("*.json")):
            break
        time.sleep(0.1)
    os.killpg(running.pid, signal.SIGKILL)
    running.wait()
    stood = len(list(diagnoses.glob("*.json")))
    assert stood > 0
    after = run_fleet(read_manifest(place / "manifest.csv"), place / "killed", workers=2)
    assert after.answered == 6 - stood


def test_the_command(fleet: Fleet, place: Path, run: Callable[..., tuple[int, str, str]]) -> None:
    status, out, _ = run("fleet", str(place / "manifest.csv"), "-o", str(place / "out"))
    assert status == 0
    assert "6 entries" in out
    assert "broken.csv" in out
    # Each entry that failed has one line, however long.
    assert [line.split(":")[0] for line in out.splitlines() if line.startswith("west")] == ["west 2026-01-01", "west -"]
    (place / "one.csv").write_text("".join((place / "manifest.csv").read_text(encoding="utf-8").splitlines(True)[:2]))
    status, out, _ = run(
        "fleet", str(place / "one.csv"), "-o", str(place / "few"), "--max-causes", "0", "--workers", "1"
    )
    assert (status, "1 computed now" in out) == (0, True)
    [diagnosis] = (place / "few" / "diagnoses").iterdir()
    assert json.loads(diagnosis.read_text(encoding="utf-8"))["options"]["max_causes"] == 0
    status, _, err = run(
        "fleet", str(place / "manifest.csv"), "-o", str(place / "out"), "--address", "here:1", "--again"
    )
    assert (status, "--engine ray" in err) == (2, True)


def test_forms_of_a_manifest(place: Path) -> None:
    csv = read_manifest(place / "manifest.csv")
    pl.read_csv(place / "manifest.csv").write_parquet(place / "manifest.parquet")
    assert read_manifest(place / "manifest.parquet") == csv
    tables = [
        f'[[entry]]\nrobot = "{e.robot}"\narm = "arm.toml"\nlogs = {json.dumps([Path(p).name for p in e.logs])}\n'
        f'holdout = {json.dumps([Path(p).name for p in e.holdout])}\ntime = "{e.time}"\n'
        for e in csv
    ]
    (place / "manifest.toml").write_text("\n".join(tables), encoding="utf-8")
    assert read_manifest(place / "manifest.toml") == csv
    assert csv[2].logs == (str(place / "run-2.parquet"), str(place / "run-3.parquet"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("robot,arm\na,b\n", "`logs`.*is missing"),
        ("robot,arm,logs\n", "holds no entry"),
        ("robot,arm,logs\na,,c\n", "`arm`.*row 1.*is empty"),
        ("robot,arm,logs,time\na,b,c,noon\n", "`time`.*row 1.*`noon` is no time"),
        ("robot,arm,logs,colour\na,b,c,red\n", "`colour`.*is no column"),
        ("robot,arm,logs\na, ;,c\n", "m.csv, column `arm`, row 1: is empty"),
        ("robot,arm,logs\na,b,c\n  ,b,c\n", "m.csv, column `robot`, row 2: is empty"),
        ("robot,arm,logs\na,b, ; \n", "m.csv, column `logs`, row 1: is empty"),
        ("robot,arm,logs\na,b;d,c\n", "m.csv, column `arm`, row 1: names 2 arm files"),
        ("robot,arm,logs,time\na,b,c,\nz,b,c,\na,b, c,2026-01-01\n", "m.csv, row 3: repeats row 1"),
    ],
)
def test_manifests_that_are_none(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "m.csv").write_text(text, encoding="utf-8")
    with pytest.raises(ManifestError, match=said):
        read_manifest(tmp_path / "m.csv")


def test_values_of_a_manifest_in_toml(tmp_path: Path) -> None:
    file = tmp_path / "m.toml"
    file.write_text('[[entry]]\nrobot = 0\narm = "b"\nlogs = "c"\n', encoding="utf-8")
    assert read_manifest(file)[0].robot == "0"
    for wrong in ('robot = ["A"]\narm = "b"', 'robot = "A"\narm = {x = 1}', 'robot = "A"\narm = [[1]]'):
        file.write_text(f'[[entry]]\n{wrong}\nlogs = "c"\n', encoding="utf-8")
        with pytest.raises(ManifestError, match=r"row 1: .* is no text"):
            read_manifest(file)


def test_results_belong_to_the_description_and_to_the_files_of_a_folder(tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text(
        'kind = "serial"\nurdf = "robot.urdf"\nsample_period = 0.002\n', encoding="utf-8"
    )
    bag = tmp_path / "bag"
    (bag / "parts").mkdir(parents=True)
    entry = Entry("A", str(tmp_path / "arm.toml"), (str(bag),), (), "", 1)

    def describe(mass: float) -> None:
        (tmp_path / "robot.urdf").write_text(
            f"""<robot name="one"><link name="base"/><link name="l"><inertial><origin xyz="0 0 -0.3"/><mass value="{mass}"/>
            <inertia ixx="0.05" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.01"/></inertial></link><joint name="j" type="continuous">
            <parent link="base"/><child link="l"/><axis xyz="0 1 0"/></joint></robot>""",
            encoding="utf-8",
        )

    def key() -> str:
        return content_keys([entry], {})[entry]

    seen = [key()]  # the description is missing
    for change in (
        lambda: describe(4.0),
        lambda: describe(8.0),
        lambda: (bag / "metadata.yaml").write_text("a"),
        lambda: (bag / "parts" / "0.db3").write_text("b"),
        lambda: (bag / "parts" / "0.db3").rename(bag / "0.db3"),
        lambda: (bag / "0.db3").write_text("c"),
    ):
        change()
        seen.append(key())
    assert len(set(seen)) == len(seen)
    (bag / "0.db3").touch()
    assert key() == seen[-1]


def test_pushes_are_one_row_for_each_joint_and_no_parameters_that_drift() -> None:
    """Two pushes on one joint would be two visits of one time."""

    def push(joint: int, probability: float) -> dict[str, object]:
        impulse = {"value": 0.1, "sigma": 0.01, "unit": "N m s"}
        of = {"effect": "external_pulse", "joint": joint, "log": "run 1", "parameters": {"impulse": impulse}}
        return of | {"probability": probability}

    level = {"value": 0.2, "sigma": 0.01, "unit": "N m"}
    effect = {"effect": "stribeck", "joint": 1, "probability": 0.9, "parameters": {"amplitude": level}}
    diagnosis = {
        "verdict": "effect", "seconds": 1.0, "gap": {"closed": 0.5, "unexplained": 0.5}, "parameters": {"with_causes": {}},
        "causes": [effect, push(2, 0.4), push(1, 0.5), push(2, 0.6)],
    }  # fmt: skip
    entry = Entry("A", "arm.toml", ("a.csv",), (), "2026-01-01", 1)
    rows = [(row["effect"], row["joint"], row["probability"]) for row in summary_rows(entry, diagnosis)]
    assert rows == [("stribeck", 1, 0.9), ("external_pulse", 1, 0.5), ("external_pulse", 2, 0.6)]
    assert {row["of"] for row in parameter_rows(entry, diagnosis)} == {"stribeck:1"}


def test_a_coupled_transmission_that_drifts_has_a_place_in_words() -> None:
    values = fleet_of(np.random.default_rng(5), 7)
    cause = {"effect": "coupled_transmission", "joint": None, "joints": [1, 2], "row": [1, -1]}
    rows = [
        (f"robot {i}", f"2026-01-{k + 1:02d}T00:00:00", owner(cause), "viscous", float(v), 0.05, "N m s/rad")
        for i, row in enumerate(values)
        for k, v in enumerate(row)
    ]
    [move] = moving(pl.DataFrame(rows, schema=PARAMETERS, orient="row"))
    assert "viscous of transmission that couples two joints, difference of joints 1 and 2 by +" in moved(move)


def test_what_is_no_manifest(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match=r"\.csv, \.parquet, \.toml"):
        read_manifest(tmp_path / "m.xls")
    with pytest.raises(ManifestError, match="cannot be read"):
        read_manifest(tmp_path / "m.csv")


def test_the_page_says_what_moves() -> None:
    values = fleet_of(np.random.default_rng(5), 7)
    values[3] *= 3.0
    rows = [
        (f"robot {i}", f"2026-01-{k + 1:02d}T00:00:00", "arm", "coulomb1", float(v), 0.05, "N m")
        for i, row in enumerate(values)
        for k, v in enumerate(row)
    ]
    parameters = pl.DataFrame(rows, schema=PARAMETERS, orient="row")
    assert [(move.robot, move.name) for move in moving(parameters)] == [("robot 7", "coulomb1")]
    first = odd(parameters)[0]
    assert (first.robot, first.of, first.name) == ("robot 3", "arm", "coulomb1")
    row = ("robot 7", None, "none", None, None, None, 0.0, 0.0, 0.1, None)
    document = fleet_document(Fleet(Path(), pl.DataFrame([row], schema=SUMMARY, orient="row"), parameters, 0))
    assert "robot 7" in document.answers[0].headline
    assert "robot 3" in document.answers[1].headline
    assert document.answers[2].headline == "nothing is named"
    only_parameters = Fleet(Path(), pl.DataFrame([row], schema=SUMMARY, orient="row"), parameters, 0, {"max_causes": 0})
    assert fleet_document(only_parameters).answers[2].headline == "not asked"
