"""Nothing lost: no output is an input or another output; files appear whole or not at all; streams and devices are written through.

The cases are made from what the commands declare, so that a new command or option is covered without a line here.
"""

from __future__ import annotations

import os
import re
import resource
import signal
import socket
import stat
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import click
import pytest

import armgap
from armgap import CustomEffect, Log, diagnose, simulate
from armgap.cli import COMMANDS, cli
from armgap.cli.files import Command, Group, InputFile, InputFolder, OutputFile, OutputFolder, Words
from armgap.errors import OptionError, ResultError
from armgap.output import check_writable, is_stdout, write, write_folder
from armgap.simulation import Effect

PACKAGE = Path(armgap.__file__).parent
NUMBERS = (
    click.types.IntParamType,
    click.types.FloatParamType,
    click.types.BoolParamType,
    click.Choice,
)
ROLES = (InputFile, InputFolder, OutputFile, OutputFolder, Words)


def leaves(command: click.Command, words: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """A command and its sub-commands with the words that call them; groups count where they do something by themselves."""
    if not isinstance(command, click.Group):
        yield words, command
        return
    if command.invoke_without_command:
        yield words, command
    for name, inner in command.commands.items():
        yield from leaves(inner, (*words, name))


def every_command() -> list[tuple[tuple[str, ...], click.Command]]:
    found: list[tuple[tuple[str, ...], click.Command]] = []
    context = click.Context(cli)
    for name in COMMANDS:
        command = cli.get_command(context, name)
        assert command is not None
        found += leaves(command, (name,))
    return found


EVERY = every_command()


def parameters(command: click.Command, kind: type | tuple[type, ...]) -> list[click.Parameter]:
    return [p for p in command.params if isinstance(p.type, kind)]


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


def called(parameter: click.Parameter) -> str:
    """What a message calls it."""
    if isinstance(parameter, click.Argument):
        return str(parameter.metavar).strip("[]…")
    return max(parameter.opts, key=len)


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


def snapshot(folder: Path) -> dict[str, bytes | None]:
    return {str(p): p.read_bytes() if p.is_file() else None for p in sorted(folder.rglob("*"))}


def refused(run: Callable[..., tuple[int, str, str]], words: list[str], *names: str) -> str:
    status, out, err = run(*words)
    assert (status, out, err.count("\n")) == (2, "", 1), err
    for name in names:
        assert name in err
    return err


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


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
    """Everything that opens a file for writing stands in `armgap.output`; tables and recordings are handed a path by it."""
    handed = {"log/log.py", "trial/case.py", "cli/simulate.py"}
    writing = re.compile(r"\.write_(text|bytes|parquet|csv)\b|(?<!def )(?<![\w.])open\(")
    found = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if writing.search(path.read_text(encoding="utf-8"))
    }
    assert found - handed == {"output.py", "cli/streams.py"}


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


def armgap_process(*words: object, **options: object) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-c", "from armgap.cli import main; main()", *map(str, words)]
    return subprocess.run(command, capture_output="stdout" not in options, check=False, timeout=120, **options)  # type: ignore[call-overload]


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


# Whole or not at all


def test_mode_links_and_attributes_are_kept(tmp_path):
    target, link = tmp_path / "out.json", tmp_path / "link.json"
    target.write_text("first")
    target.chmod(0o640)
    link.symlink_to("out.json")
    write(link, "second")
    assert link.is_symlink()
    assert target.read_text() == "second"
    assert stat.S_IMODE(target.stat().st_mode) == 0o640
    assert sorted(p.name for p in tmp_path.iterdir()) == ["link.json", "out.json"]


def test_a_link_to_nothing_makes_its_target(tmp_path):
    (tmp_path / "link.json").symlink_to("new.json")
    write(tmp_path / "link.json", "text")
    assert (tmp_path / "link.json").is_symlink()
    assert (tmp_path / "new.json").read_text() == "text"


@pytest.mark.parametrize("umask", [0o022, 0o077])
def test_new_files_follow_the_umask(umask, tmp_path):
    before = os.umask(umask)
    try:
        write(tmp_path / "new.json", "text")
        write_folder(tmp_path / "folder", lambda p: write(p / "inside", b"text"))
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "new.json").stat().st_mode) == 0o666 & ~umask
    assert stat.S_IMODE((tmp_path / "folder").stat().st_mode) == 0o777 & ~umask


def test_the_owner_is_kept(tmp_path):
    if os.geteuid() != 0:
        pytest.skip("only root may give files away")
    target = tmp_path / "out.json"
    target.write_text("first")
    os.chown(target, 12345, 54321)
    target.chmod(0o4755)
    write(target, "second")
    there = target.stat()
    assert (there.st_uid, there.st_gid, stat.S_IMODE(there.st_mode)) == (12345, 54321, 0o4755)


def as_nobody(body: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a few lines without the rights of root."""
    code = f"import os\nfrom armgap.output import write\nos.chdir({str(folder)!r})\nos.setgroups([])\nos.setgid(65534)\nos.setuid(65534)\n{body}"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=120)


@pytest.mark.parametrize("reason", ["write-protected", "belongs to another user", "folder cannot be written"])
def test_what_may_not_be_written_is_left_alone(reason, tmp_path):
    if os.geteuid() != 0:
        pytest.skip("needs root to become somebody else")
    folder = tmp_path / "folder"
    folder.mkdir()
    for parent in (tmp_path, *tmp_path.parents):
        if parent != Path("/tmp") and parent.is_relative_to("/tmp"):
            parent.chmod(0o755)
    target = folder / "out.json"
    target.write_text("the user's")
    folder.chmod(0o555 if reason.startswith("folder") else 0o777)
    if reason == "write-protected":
        os.chown(target, 65534, 65534)
        target.chmod(0o444)
    else:
        target.chmod(0o666)
    if reason.startswith("folder"):
        os.chown(target, 65534, 65534)
    done = as_nobody("from armgap.output import check_writable\ncheck_writable('out.json')", folder)
    assert reason in done.stderr.splitlines()[-1]
    done = as_nobody("write('out.json', 'mine')", folder)
    assert "ResultError" in done.stderr
    assert target.read_text() == "the user's"
    assert [p.name for p in folder.iterdir()] == ["out.json"]


def test_the_other_name_of_a_hard_link_keeps_what_it_held(tmp_path):
    """Whole or not at all wins over the link."""
    (tmp_path / "a").write_text("first")
    os.link(tmp_path / "a", tmp_path / "b")
    write(tmp_path / "a", "second")
    assert (tmp_path / "a").read_text() == "second"
    assert (tmp_path / "b").read_text() == "first"


def test_a_name_as_long_as_names_can_be(tmp_path):
    target = tmp_path / ("x" * 250 + ".json")
    write(target, "text")
    assert target.read_text() == "text"


def half(path: Path) -> None:
    path.write_text("half of i")
    raise KeyboardInterrupt


def test_an_interrupt_leaves_nothing(tmp_path):
    target = tmp_path / "out.json"
    target.write_text("first")
    with pytest.raises(KeyboardInterrupt):
        write(target, half)
    with pytest.raises(KeyboardInterrupt):
        write_folder(tmp_path / "folder", lambda p: half(p / "a"))
    assert target.read_text() == "first"
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_that_is_there_is_not_replaced(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "mine").touch()
    with pytest.raises(ResultError, match="folder"):
        write_folder(tmp_path / "folder", lambda p: (p / "new").touch())
    assert [p.name for p in tmp_path.rglob("*")] == ["folder", "mine"]


def test_many_writers_of_one_file(tmp_path):
    """Whoever is last wins, and nobody's content is mixed with another's."""
    target = tmp_path / "out.json"
    contents = [bytes([65 + i]) * 200_000 for i in range(8)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda c: [write(target, c) for _ in range(5)], contents))
    assert target.read_bytes() in contents
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("name", ["out.parquet", "out.csv"])
def test_a_full_disk_leaves_what_was_there(name, seed_log, tmp_path):
    """A limit on the size of files stands for a disk that is full."""
    target = tmp_path / name
    target.write_bytes(b"the user's")
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limit[1]))
    try:
        with pytest.raises(ResultError, match=name):
            seed_log.write(target)
        with pytest.raises(ResultError, match=name):
            write(target, b"x" * 5000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
        signal.signal(signal.SIGXFSZ, before)
    assert target.read_bytes() == b"the user's"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_signal_in_the_middle_of_writing_leaves_nothing(number, tmp_path):
    """The status is that of a program that the signal ended."""
    code = (
        "import signal, sys, time; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "import armgap.cli.bench as bench\n"
        "from armgap.output import write\n"
        "def slow(path):\n    path.write_text('half'); print('now', flush=True); time.sleep(60)\n"
        "bench.measure = lambda *a, **k: write('out.json', slow)\n"
        "bench.interruptible = lambda work: work()\n"
        "from armgap.cli import main; main(['bench'])"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"now\n"
    process.send_signal(number)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 128 + number
    assert err == b"\narmgap: interrupted\n" if number == signal.SIGINT else err.strip() == b"armgap: interrupted"
    assert list(tmp_path.iterdir()) == []


# What is no regular file


def test_a_pipe_is_written_through(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    got: list[bytes] = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()))
    reader.start()
    write(pipe, lambda path: path.write_text("through"))
    reader.join(timeout=10)
    assert got == [b"through"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert list(tmp_path.iterdir()) == [pipe]


def test_a_pipe_that_is_input_and_output(here, run, arm_file):
    os.mkfifo(here / "pipe.csv")
    refused(run, ["simulate", "--torque", "pipe.csv", "--arm", arm_file, "-o", "pipe.csv"], "pipe.csv", "--torque")


def test_devices_stay_devices(tmp_path):
    write("/dev/null", "text")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    (tmp_path / "link").symlink_to("/dev/null")
    write(tmp_path / "link", "text")
    assert (tmp_path / "link").is_symlink()


def test_a_full_device_and_a_socket_say_so(tmp_path):
    with socket.socket(socket.AF_UNIX) as end:
        end.bind(str(tmp_path / "socket"))
        with pytest.raises(ResultError, match="cannot be written"):
            write(tmp_path / "socket", "text")
        assert stat.S_ISSOCK((tmp_path / "socket").stat().st_mode)
    if Path("/dev/full").exists():
        with pytest.raises(ResultError, match="No space left"):
            write("/dev/full", "text")
        assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


def test_files_that_the_shell_has_opened_are_written_through(tmp_path):
    """The shell's own descriptor goes on where the result ends: nothing before or after it is lost."""
    file = tmp_path / "out.json"
    file.write_text("before\n")
    for name in ("/dev/stdout", "/dev/fd/1", "-", str(file)):
        with file.open("ab") as stream:
            code = f"from armgap.output import write; print('one'); write({name!r}, 'two\\n'); print('three')"
            subprocess.run([sys.executable, "-c", code], stdout=stream, check=True, timeout=120)
    assert file.read_text() == "before\n" + 4 * "one\ntwo\nthree\n"


def test_what_leads_to_standard_output(tmp_path):
    assert is_stdout("-")
    assert is_stdout(None, "/dev/stdout") is not is_stdout(None, os.devnull)
    assert not is_stdout(tmp_path / "new", None)
    with pytest.raises(ResultError, match="999"):
        check_writable("/dev/fd/999")


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
        ('kind = "serial"', "known: axis, pendulum, two-link"),
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


@pytest.mark.parametrize(
    "words", [["identify", "x.csv", "--arm"], ["export", "--arm", "x.toml", "-o", "x.xml"], ["compare", "x.json"]]
)
def test_a_file_without_an_end(words, here, run):
    err = refused(run, [*words, "/dev/zero"])
    assert "larger than" in err or "x.json" in err or "not" in err


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
