"""No output of a command is one of its inputs or another of its outputs.

The cases are made from what the commands declare, so that a new command or option is covered without a line here.
"""

from __future__ import annotations

import os
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

import click
import pytest

import armgap
from armgap.cli import COMMANDS
from armgap.cli.files import Command, Group, InputFile, InputFolder, OutputFile, OutputFolder, Words
from commands import EVERY, armgap_process, called, parameters, refused, snapshot

PACKAGE = Path(armgap.__file__).parent
NUMBERS = (
    click.types.IntParamType,
    click.types.FloatParamType,
    click.types.BoolParamType,
    click.Choice,
)
ROLES = (InputFile, InputFolder, OutputFile, OutputFolder, Words)


@dataclass(frozen=True)
class Clash:
    """A command whose `output` is given the file or folder of `other`."""

    words: tuple[str, ...]
    command: click.Command
    output: click.Parameter
    other: click.Parameter

    def __str__(self) -> str:
        return f"{' '.join(self.words)}: {self.output.name} = {self.other.name}"


CLASHES = [
    Clash(words, command, output, other)
    for words, command in EVERY
    for output in parameters(command, (OutputFile, OutputFolder))
    for other in parameters(command, (InputFile, InputFolder, OutputFile, OutputFolder))
    if other is not output
]
FILE_CLASHES = [c for c in CLASHES if isinstance(c.output.type, OutputFile) and isinstance(c.other.type, InputFile)]

FOLDER_CLASHES = [
    c for c in CLASHES if isinstance(c.output.type, OutputFile) and isinstance(c.other.type, InputFolder | OutputFolder)
]


def arguments(clash: Clash, output: str, other: str) -> list[str]:
    """A call in which all that is needed is given, and one output is another file."""
    given: list[str] = []
    for parameter in clash.command.params:
        if parameter is clash.output:
            value = output
        elif parameter is clash.other:
            value = other
        elif parameter.required:
            value = f"other-{parameter.name}"
            if isinstance(parameter.type, InputFolder):
                Path(value).mkdir(exist_ok=True)
        else:
            continue
        given += [value] if isinstance(parameter, click.Argument) else [parameter.opts[0], value]
    return [*clash.words, *given]


# Declarations


@pytest.mark.parametrize(("words", "command"), EVERY, ids=[" ".join(w) for w, _ in EVERY])
def test_every_parameter_says_whether_it_is_a_file(words, command):
    """A plain text parameter could be a file that nobody compares."""
    assert isinstance(command, Command | Group), "its files are not checked"
    for parameter in command.params:
        assert isinstance(parameter.type, (*ROLES, *NUMBERS)), f"{' '.join(words)}: {parameter.name} has no role"


def test_every_command_that_writes_is_among_the_cases():
    writing = {c.words[0] for c in CLASHES} | {w[0] for w, c in EVERY if parameters(c, (OutputFile, OutputFolder))}
    assert writing == set(COMMANDS)
    assert len(FILE_CLASHES) >= 20


def test_only_one_module_writes_files():
    """Everything that opens a file for writing stands in `armgap.files.output`; tables and recordings are handed a path by it."""
    handed = {
        "log/log.py",
        "trial/cases/case.py",
        "cli/model_commands/simulate.py",
        "fleet/folder.py",
        "planning/planning.py",
    }
    writing = re.compile(r"\.write_(text|bytes|parquet|csv)\b|(?<!def )(?<![\w.])open\(")
    found = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if writing.search(path.read_text(encoding="utf-8"))
    }
    assert found - handed == {"files/output.py", "cli/streams.py"}


# Outputs that are inputs or other outputs


@pytest.mark.parametrize("clash", CLASHES, ids=str)
def test_an_output_is_no_other_file(clash, here, run):
    """The same name twice, there already or not yet."""
    folder = isinstance(clash.other.type, InputFolder | OutputFolder)
    for exists in (True, False):
        if isinstance(clash.other.type, InputFile | InputFolder) and not exists:
            continue
        name = "both.json"
        if exists:
            (here / name).mkdir() if folder else (here / name).write_bytes(b"the user's")
        words = arguments(clash, name, name)
        before = snapshot(here)
        refused(run, words, name, called(clash.output), called(clash.other))
        assert snapshot(here) == before
        if exists:
            (here / name).rmdir() if folder else (here / name).unlink()


@pytest.mark.parametrize("clash", FILE_CLASHES, ids=str)
@pytest.mark.parametrize("way", ["symlink", "symlink to the output", "hard link", "folder's link", "other spelling"])
def test_an_output_that_leads_to_an_input(clash, way, here, run):
    (here / "in.json").write_bytes(b"the user's")
    given, output = "in.json", "out.json"
    if way == "symlink":
        (here / "out.json").symlink_to("in.json")
    elif way == "symlink to the output":
        (here / "out.json").write_bytes(b"the user's")
        (here / "in.json").unlink()
        (here / "in.json").symlink_to(here / "out.json")
    elif way == "hard link":
        os.link("in.json", "out.json")
    elif way == "folder's link":
        (here / "again").symlink_to(here)
        output = "again/in.json"
    else:
        (here / "sub").mkdir()
        output = str(here / "sub" / ".." / "in.json")
    before = {p: p.read_bytes() for p in here.iterdir() if p.is_file()}
    refused(run, arguments(clash, output, given), output, called(clash.other))
    assert {p: p.read_bytes() for p in here.iterdir() if p.is_file()} == before


@pytest.mark.parametrize("clash", FOLDER_CLASHES, ids=str)
def test_an_output_is_no_part_of_a_folder(clash, here, run):
    """A file of a trial or of a recording, by name and by a link from elsewhere."""
    case = here / "folder" / "case-0001"
    case.mkdir(parents=True)
    (case / "arm.toml").write_text("the user's")
    os.link(case / "arm.toml", here / "linked.json")
    for output in ("folder/case-0001/arm.toml", "folder/case-0001/new.json", "linked.json"):
        words = arguments(clash, output, "folder")
        before = snapshot(here)
        refused(run, words, output, called(clash.output), called(clash.other))
        assert snapshot(here) == before


def test_patterns_are_inputs_too(here, run):
    (here / "a.parquet").write_bytes(b"the user's")
    refused(run, ["diagnose", "*.parquet", "--arm", "arm.toml", "--json", "a.parquet"], "a.parquet", "LOG")
    assert (here / "a.parquet").read_bytes() == b"the user's"


def test_a_recording_that_is_a_folder_is_not_written_into(here, run):
    (here / "bag").mkdir()
    (here / "bag" / "metadata.yaml").write_text("rosbag2_bagfile_information:")
    refused(run, ["inspect", "bag", "--json", "bag/metadata.yaml"], "bag/metadata.yaml", "LOG")
    refused(run, ["inspect", "bag", "--json", "bag/new.json"], "bag/new.json", "LOG")


def test_scores_may_lie_beside_the_cases(here, run):
    (here / "folder" / "case-0001").mkdir(parents=True)
    for _ in range(2):
        err = refused(run, ["trial", "score", "folder", "--md", "folder/scores.md"])
        assert "holds no cases" in err
        (here / "folder" / "scores.md").write_text("of the last time")


def test_two_results_on_standard_output(here, run, arm_file):
    for second in ("-", "/dev/stdout", "/dev/fd/1"):
        words = ["diagnose", "x.csv", "--arm", arm_file, "--json", "-", "--report", second]
        refused(run, words, "--json", "--report")


def test_two_results_may_be_thrown_away(here, run, arm_file):
    words = ["diagnose", "none.csv", "--arm", arm_file, "--json", "/dev/null", "--report", "/dev/null"]
    assert "extension" in refused(run, words)  # of the report; the two do not clash


def test_what_standard_input_is_redirected_from_is_an_input(arm_file, seed_log, tmp_path):
    log = tmp_path / "log.csv"
    seed_log.write(log)
    before = log.read_bytes()
    with log.open("rb") as stream:
        done = armgap_process("identify", "-", "--arm", arm_file, "--json", log, stdin=stream)
    assert (done.returncode, done.stderr.count(b"\n")) == (2, 1)
    with log.open("ab") as stream:
        done = armgap_process(
            "simulate", "--torque", log, "--arm", arm_file, "-o", "-", stdout=stream, stderr=subprocess.PIPE
        )
    assert (done.returncode, done.stderr.count(b"\n")) == (2, 1)
    assert log.read_bytes() == before
