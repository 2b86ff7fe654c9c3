"""Progress and interrupts: what is reports, what a terminal shows, and what an interrupt leaves."""

from __future__ import annotations

import os
import pty
import re
import select
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from armgap import Arm, Log, diagnose, seed_torque, simulate
from armgap.cli.progress import left
from armgap.progress import part_callback, report_progress, use_callback
from armgap.simulation import Effect

CONTROL_C = b"\x03"
# A background job of a shell is started with interrupts ignored; a program at a terminal is not.
CODE = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from armgap.cli import main; main()"
PERCENTAGE = re.compile(rb"(\d+)%")


@pytest.fixture(scope="module")
def motion(arm: Arm) -> Log:
    """A log whose diagnosis takes a second or so."""
    t = np.arange(2400) * arm.sample_period
    return simulate(arm, t, seed_torque(t), effects=[Effect("stribeck", 2, {"amplitude": 1.0, "velocity": 0.4})])


@pytest.fixture(scope="module")
def case(motion: Log, arm_file: Path, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Words of its diagnosis."""
    log = tmp_path_factory.mktemp("progress") / "log.parquet"
    motion.write(log)
    return ["diagnose", str(log), "--arm", str(arm_file)]


def at_terminal(words: list[str], *, interrupt: bool = False, **environment: str) -> tuple[int, bytes]:
    """Run the command line at a terminal; control-C is typed once a percentage is shown. Return its status and the terminal's text."""
    shown, terminal = pty.openpty()
    env = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "100", **environment}
    command = [sys.executable, "-c", CODE, *words]
    process = subprocess.Popen(
        command, stdin=terminal, stdout=subprocess.DEVNULL, stderr=terminal, env=env, start_new_session=True,
        preexec_fn=_own_terminal,
    )  # fmt: skip
    os.close(terminal)
    text = b""
    while select.select([shown], [], [], 60)[0]:
        try:
            text += os.read(shown, 1 << 16)
        except OSError:  # closed at the other end
            break
        if interrupt and PERCENTAGE.search(text):
            os.write(shown, CONTROL_C)
            interrupt = False
    os.close(shown)
    return process.wait(60), text


def _own_terminal() -> None:
    """Make standard input the terminal that controls the process, so that control-C reaches it."""
    import fcntl
    import termios

    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


def test_a_diagnosis_tells_what_it_does_and_never_falls_back(arm, motion):
    reports: list[tuple[str, float]] = []
    diagnose([motion], arm, progress=lambda work, fraction: reports.append((work, fraction)))
    fractions = np.array([fraction for _, fraction in reports])
    assert all(work for work, _ in reports)
    assert np.all(np.diff(fractions) >= 0)
    assert 0 <= fractions[0] < fractions[-1] == 1


def test_progress_changes_no_result(arm, motion):
    followed = diagnose([motion], arm, progress=lambda *_: None).to_dict()
    alone = diagnose([motion], arm).to_dict()
    assert {**followed, "seconds": 0} == {**alone, "seconds": 0}


def test_an_interrupt_or_an_error_of_the_callback_ends_a_diagnosis(arm, motion):
    def interrupt(work: str, fraction: float) -> None:
        signal.raise_signal(signal.SIGINT)

    def fail(work: str, fraction: float) -> None:
        raise LookupError(work)

    old = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            diagnose([motion], arm, progress=interrupt)
    finally:
        signal.signal(signal.SIGINT, old)
    with pytest.raises(LookupError):
        diagnose([motion], arm, progress=fail)


@pytest.mark.parametrize("name", ["log.parquet", "log.csv"])
def test_reading_tells_the_file_and_how_much_of_it(name, seed_log, tmp_path):
    seed_log.write(tmp_path / name)
    reports: list[tuple[str, float]] = []
    with use_callback(lambda work, fraction: reports.append((work, fraction))):
        Log.read(tmp_path / name)
    assert {work for work, _ in reports} == {f"reading {name}"}
    assert max(fraction for _, fraction in reports) > 0.5


def test_parts_of_many_share_the_whole():
    reports: list[tuple[str, float]] = []
    with use_callback(lambda work, fraction: reports.append((work, fraction))):
        for part in range(2):
            with use_callback(part_callback("both", part, 2)):
                report_progress("one", 0.0)
                report_progress("one", 1.0)
        report_progress("after", 0.5)
    assert reports == [("both", 0.0), ("both", 0.5), ("both", 0.5), ("both", 1.0), ("after", 0.5)]


def test_the_time_left_follows_the_work_done():
    assert left(30.0, 0.75) == pytest.approx(10.0)
    assert left(0.5, 0.75) is None
    assert left(30.0, 0.0) is None


def test_a_terminal_shows_a_bar_that_goes_away(case):
    status, text = at_terminal(case)
    shown = [int(p) for p in PERCENTAGE.findall(text.rpartition(b"reading")[2])]
    assert status == 0
    assert shown
    assert shown == sorted(shown)
    assert text.rstrip().endswith(b"\x1b[2K")  # the line is wiped


@pytest.mark.parametrize("plain", [{"words": ["--quiet"]}, {"environment": {"NO_COLOR": "1"}}])
def test_no_bar_where_none_is_wanted(case, plain):
    status, text = at_terminal([*case, *plain.get("words", [])], **plain.get("environment", {}))
    assert (status, text) == (0, b"")


def test_no_bar_where_nobody_looks(case):
    done = subprocess.run([sys.executable, "-c", CODE, *case], capture_output=True, check=True)
    assert done.stderr == b""


def test_control_c_during_a_diagnosis_ends_it_and_leaves_nothing(arm, arm_file, tmp_path_factory, tmp_path):
    """The log is long enough that nobody diagnoses it before the key is pressed."""
    log = tmp_path_factory.mktemp("long") / "log.parquet"
    t = np.arange(24_000) * arm.sample_period
    simulate(arm, t, seed_torque(t)).write(log)
    case = ["diagnose", str(log), "--arm", str(arm_file)]
    report, data = tmp_path / "report.html", tmp_path / "data.json"
    status, text = at_terminal([*case, "--report", str(report), "--json", str(data)], interrupt=True)
    assert status == 130
    assert text.rstrip().endswith(b"armgap: interrupted")
    assert b"Traceback" not in text
    assert list(tmp_path.iterdir()) == []
