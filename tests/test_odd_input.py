"""Streams that fail, values that no option can have, files that are none of what was asked for: one line, status 2."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import click
import numpy as np
import pytest

import armgap
from armgap import CustomEffect, Log, diagnose, simulate
from armgap.cli.files import InputFolder, OutputFile
from armgap.diagnosis.comparison import Comparison
from armgap.errors import OptionError
from armgap.estimation.identification import Identification
from armgap.inspection.inspection import Inspection
from armgap.planning.planning import Plan
from armgap.reproduction.experiment import Reproduction
from armgap.simulation import Effect
from commands import EVERY, armgap_process, called, parameters, refused, snapshot

# Streams that fail


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
@pytest.mark.parametrize(
    "words",
    [["--help"], ["--version"], ["diagnose", "--help"], ["inspect", "LOG"], ["inspect", "LOG", "--json", "-"]],
    ids=" ".join,
)
def test_a_full_standard_output(words, seed_log, tmp_path):
    seed_log.write(tmp_path / "log.parquet")
    words = [str(tmp_path / "log.parquet") if w == "LOG" else w for w in words]
    with open("/dev/full", "wb") as full:
        done = armgap_process(*words, stdout=full, stderr=subprocess.PIPE)
    assert (done.returncode, done.stderr.count(b"\n")) == (2, 1), done.stderr
    assert b"standard output" in done.stderr
    assert b"No space left" in done.stderr


def test_a_closed_standard_output(seed_log, tmp_path):
    """A result that nobody can get is an error; so is one whose reader went away."""
    seed_log.write(tmp_path / "log.parquet")
    words = f"{sys.executable} -c 'from armgap.cli import main; main()' inspect {tmp_path}/log.parquet"
    for tail in ("--json - >&-", ">&-"):
        done = subprocess.run(["sh", "-c", f"{words} {tail}"], capture_output=True, timeout=120)
        assert (done.returncode, done.stderr.count(b"\n")) == (2, 1), done.stderr
    for tail, status in (("--json -", 2), ("", 0)):
        read, written = os.pipe()
        os.close(read)
        done = subprocess.run(["sh", "-c", f"{words} {tail}"], stdout=written, stderr=subprocess.PIPE, timeout=120)
        os.close(written)
        assert done.returncode == status, done.stderr
        assert done.stderr.count(b"\n") == (1 if status else 0)


# Values that no option can have


NUMBERS_THAT_ARE_NONE = ["-1", "nan", "inf", "-inf", "99999999999999999999999", "", "x"]
NUMERIC = [
    (words, command, parameter)
    for words, command in EVERY
    for parameter in command.params
    if isinstance(parameter.type, click.types.IntParamType | click.types.FloatParamType)
]


@pytest.mark.parametrize("value", NUMBERS_THAT_ARE_NONE)
@pytest.mark.parametrize(
    ("words", "command", "parameter"), NUMERIC, ids=[f"{' '.join(w)} {p.name}" for w, _, p in NUMERIC]
)
def test_impossible_numbers(value, words, command, parameter, here, run):
    """With inputs that are missing, so that nothing is computed: whoever complains first does so in one line."""
    given = [parameter.opts[0], value]
    for other in command.params:
        if other.required:
            given += (
                [f"none.{other.name}"]
                if isinstance(other, click.Argument)
                else [other.opts[0], f"none-{other.name}.json"]
            )
    before = snapshot(here)
    refused(run, [*words, *given])
    assert snapshot(here) == before


ODD_NAMES = ["", "a" * 300, "none/out.json", "x/" * 2500, "file/out.json", "circle", "."]
OUTPUTS = [(words, command, p) for words, command in EVERY for p in parameters(command, OutputFile)]


@pytest.mark.parametrize(
    "name", ODD_NAMES, ids=["empty", "long", "no folder", "long path", "no folder but a file", "circle", "folder"]
)
@pytest.mark.parametrize(
    ("words", "command", "output"), OUTPUTS, ids=[f"{' '.join(w)} {p.name}" for w, _, p in OUTPUTS]
)
def test_names_under_which_nothing_can_be_written(name, words, command, output, here, run):
    """They are refused before any work, not after it."""
    (here / "file").touch()
    (here / "circle").symlink_to("circle")
    given = [output.opts[0], name]
    for other in command.params:
        if other.required and other is not output:
            value = "." if isinstance(other.type, InputFolder) else f"none-{other.name}"
            given += [value] if isinstance(other, click.Argument) else [other.opts[0], value]
    before = sorted(here.iterdir())
    err = refused(run, [*words, *given])
    assert name[:20] in err or not name
    assert called(output) in err or Path(name).name in err
    assert sorted(here.iterdir()) == before


@pytest.mark.parametrize("option", ["--seed", "--max-causes", "--horizon"])
@pytest.mark.parametrize("value", ["-1", "99999999999999999999999"])
def test_impossible_numbers_of_a_diagnosis(option, value, here, run, arm_file, seed_log):
    seed_log.write(here / "log.parquet")
    refused(
        run,
        ["diagnose", "log.parquet", "--arm", arm_file, option, value],
        value[:6] if option != "--horizon" else "horizon",
    )


@pytest.mark.parametrize(
    "options",
    [
        {"seed": -1},
        {"seed": 2**64},
        {"seed": 1.5},
        {"effects": ["stribek"]},
        {"effects": "stribeck"},
        {"effects": [None]},
    ],
    ids=str,
)
def test_impossible_options_in_python(options, arm, seed_log):
    with pytest.raises(OptionError):
        simulate(arm, seed_log.t, seed_log.tau, **options)
    with pytest.raises(OptionError):
        diagnose(seed_log, arm, **options)


def test_effects_of_the_other_function(arm, seed_log):
    own = CustomEffect("drag", 1, lambda t, q, dq, tau: dq[:, 0])
    with pytest.raises(OptionError, match="Effect"):
        simulate(arm, seed_log.t, seed_log.tau, effects=[own])  # type: ignore[list-item]
    with pytest.raises(OptionError, match="CustomEffect"):
        diagnose(seed_log, arm, effects=[Effect("stribeck", 1)])  # type: ignore[list-item]
    with pytest.raises(OptionError):
        simulate(arm, seed_log.t, seed_log.tau, effects=[Effect("torque_offset", -1, {"offset": 1.0})])
    with pytest.raises(OptionError):
        simulate(arm, seed_log.t, seed_log.tau, effects=[Effect("torque_offset", 1, {"offset": "much"})])  # type: ignore[dict-item]


# Arm files that are none


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('<?xml version="1.0"?>\n<!-- <mujoco> -->\n<robot name="ur10"/>', "URDF"),
        ("<mujoco model='a'/>", "MJCF"),
        ("<svg/>", "XML"),
        ('kind = "six-axis"', "known: axis, pendulum, two-link"),
        ('kind = "serial"', "give exactly one of urdf, mjcf and [[link]] tables"),
        ('kind = "pendulem"', "did you mean `pendulum`"),
        ("#" * (2**20 + 1), "larger than 1 MiB"),
    ],
    ids=["urdf", "mjcf", "xml", "six-axis", "serial", "slip", "size"],
)
def test_what_is_no_arm_file(text, says, here, run):
    (here / "arm.toml").write_text(text)
    err = refused(run, ["diagnose", "log.csv", "--arm", "arm.toml"], "arm.toml", says)
    assert says.startswith("did") or "did you mean" not in err
    if text.startswith("<"):
        assert "two-link" in err
        assert "docs/formats.md" in err


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="there is no /dev/zero")
@pytest.mark.parametrize(
    ("words", "size"),
    [
        (["identify", "x.csv", "--arm", "/dev/zero"], "1 MiB"),
        (["export", "/dev/zero", "--arm", "x.toml", "-o", "x.xml"], "256 MiB"),
        (["compare", "/dev/zero", "x.json"], "256 MiB"),
    ],
    ids=["arm file", "export", "compare"],
)
def test_a_file_without_an_end(words, size, here, run):
    refused(run, words, "/dev/zero", f"larger than {size}")


def test_causes_that_were_not_allowed():
    from armgap.report import words

    data = {"verdict": "unexplained", "causes": [], "options": {"max_causes": 0}}
    assert "allowed" in words.verdict(data)
    assert "library" not in words.verdict(data)
    assert "library" in words.verdict(data | {"options": {"max_causes": 4}})


def test_names_of_any_bytes(arm_file, seed_log, tmp_path):
    """A name that is no text is shown as its bytes."""
    log, out = (os.fsencode(tmp_path) + name for name in (b"/log\xff.parquet", b"/out\xfe.json"))
    seed_log.write(tmp_path / "log.parquet")
    os.rename(tmp_path / "log.parquet", log)
    words = ["-c", "from armgap.cli import main; main()", "inspect", log, "--arm", arm_file, "--json", out]
    done = subprocess.run([sys.executable, *words], capture_output=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, b"")
    assert rb"log\\xff" in Path(os.fsdecode(out)).read_bytes()
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/folder\xfd"))
    folder.mkdir()
    seed_log.write(folder / "log.parquet")
    assert len(Log.read(folder / "log.parquet")) == len(seed_log)


@pytest.mark.parametrize("arm", [3, None, {"kind": "pendulum"}, Path], ids=["number", "none", "mapping", "class"])
def test_what_is_no_arm_is_refused(arm: Any) -> None:
    """By every public function that takes an arm, in one line that says what an arm is."""
    t = np.arange(100) * 0.01
    table = {"t": t, "q1": np.sin(t), "tau1": np.cos(t)}
    log = Log.from_frame(table)
    calls: list[Callable[[], object]] = [
        lambda: armgap.diagnose(table, arm),
        lambda: armgap.fit(log, arm),
        lambda: armgap.identify(log, arm),
        lambda: armgap.simulate(arm, t, np.cos(t)),
        lambda: armgap.base_parameters(arm),
        lambda: armgap.Estimator(arm),
        lambda: armgap.plan("gap.json", arm),
        lambda: armgap.correct(None, arm),  # type: ignore[arg-type]
    ]
    if arm is not None:
        calls += [lambda: armgap.inspect(table, arm), lambda: Log.from_frame(table, arm=arm)]
    for call in calls:
        with pytest.raises(OptionError, match=r"the arm is .*not an Arm; give an Arm: Arm\.read"):
            call()


@pytest.mark.parametrize("indent", ["x.json", Path("x.json"), -1, 2.5], ids=repr)
@pytest.mark.parametrize(
    "kind",
    [armgap.Diagnosis, Comparison, Identification, Inspection, Plan, Reproduction],
    ids=lambda kind: kind.__name__,
)
def test_a_result_as_text_takes_no_file(kind: Any, indent: Any) -> None:
    """The first argument is the indentation, and the error says how a file is written."""

    class Bare(kind):  # type: ignore[misc]
        _data: ClassVar[dict[str, Any]] = {"a": 1}

        def to_dict(self) -> dict[str, Any]:
            return self._data

    result = object.__new__(Bare)
    assert json.loads(result.to_json(indent=2)) == {"a": 1}
    with pytest.raises(OptionError) as caught:
        result.to_json(indent)
    wanted = 'import write; write("x.json", result.to_json())' if "json" in str(indent) else "whole number from 0 to 16"
    assert wanted in str(caught.value)
