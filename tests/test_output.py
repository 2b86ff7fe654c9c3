"""Results appear whole or not at all, with mode and owner kept; streams and devices are written through."""

from __future__ import annotations

import os
import resource
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from armgap.errors import ResultError
from armgap.files.output import check_writable, is_stdout, write, write_folder
from commands import refused

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
    other = "os.setgroups([])\nos.setgid(65534)\nos.setuid(65534)"
    code = f"import os\nfrom armgap.files.output import write\nos.chdir({str(folder)!r})\n{other}\n{body}"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=120)


@pytest.mark.parametrize("reason", ["write-protected", "belongs to another user", "folder cannot be written"])
def test_what_may_not_be_written_is_left_alone(reason):
    if os.geteuid() != 0:
        pytest.skip("needs root to become somebody else")
    with tempfile.TemporaryDirectory() as place:  # pytest's own are closed to others
        _check_left_alone(reason, Path(place))


def _check_left_alone(reason: str, folder: Path) -> None:
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
    done = as_nobody("from armgap.files.output import check_writable\ncheck_writable('out.json')", folder)
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
        # Under nohup, or in the background of a shell, these signals are ignored by every child.
        "import signal, sys, time; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "signal.signal(signal.SIGHUP, signal.SIG_DFL)\n"
        "import armgap.cli.bench as bench\n"
        "from armgap.files.output import write\n"
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
            code = f"from armgap.files.output import write; print('one'); write({name!r}, 'two\\n'); print('three')"
            subprocess.run([sys.executable, "-c", code], stdout=stream, check=True, timeout=120)
    assert file.read_text() == "before\n" + 4 * "one\ntwo\nthree\n"


def test_what_leads_to_standard_output(tmp_path):
    assert is_stdout("-")
    assert is_stdout(None, "/dev/stdout") is not is_stdout(None, os.devnull)
    assert not is_stdout(tmp_path / "new", None)
    with pytest.raises(ResultError, match="999"):
        check_writable("/dev/fd/999")
