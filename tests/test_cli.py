"""The command line: help, speed, streams, colour, interrupts."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from armgap import Log, __version__
from armgap.cli import COMMANDS

IMPORT_LIMIT_S = 0.6
PROMISED = {
    "bench",
    "export",
    "fleet",
    "compare",
    "replay",
    "inspect",
    "model",
    "plan",
    "identify",
    "simulate",
    "diagnose",
    "trial",
    "reproduce",
    "demo",
}


def armgap(*arguments: object, **options: object) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-c", "from armgap.cli import main; main()", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, check=False, timeout=120, **options)  # type: ignore[call-overload]


@pytest.fixture
def log_file(seed_log: Log, tmp_path: Path) -> Path:
    path = tmp_path / "log.parquet"
    seed_log.write(path)
    return path


def test_every_promised_command_is_listed(run):
    status, out, _ = run("--help")
    assert status == 0
    assert set(COMMANDS) == PROMISED
    assert all(name in out for name in PROMISED)


@pytest.mark.parametrize("name", sorted(PROMISED - {"reproduce", "trial"}))
def test_every_command_explains_its_options(name, run):
    status, out, err = run(name, "--help")
    assert (status, err) == (0, "")
    assert "--quiet" in out


def test_version(run):
    assert run("--version") == (0, f"armgap, version {__version__}\n", "")


def test_import_is_fast_and_loads_nothing_heavy():
    code = (
        "import sys, time; s = time.perf_counter(); import armgap; "
        "print(time.perf_counter() - s, *(m for m in ('polars', 'bokeh', 'mujoco', 'scipy') if m in sys.modules))"
    )
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(3)]
    assert [r.stdout.split()[1:] for r in runs] == [[]] * 3
    assert statistics.median(float(r.stdout.split()[0]) for r in runs) < IMPORT_LIMIT_S


def test_simulated_log_can_be_read_and_identified(arm_file, tmp_path, run):
    out = tmp_path / "seed.parquet"
    assert run("simulate", "--arm", arm_file, "--torque", "seed", "--duration", "2", "-o", out)[0] == 0
    assert len(Log.read(out)) == 800
    status, text, err = run("identify", out, "--arm", arm_file, "--scheme", "filtered-power", "--json", "-")
    assert (status, err) == (0, "")
    (result,) = json.loads(text)
    assert result["scheme"] == "filtered-power"


def test_simulation_repeats_with_its_seed(arm_file, tmp_path, run):
    logs = []
    for seed in (1, 1, 2):
        out = tmp_path / f"{len(logs)}.parquet"
        options = ("--torque", "seed", "--duration", "1", "--noise", "1e-4", "--seed", seed)
        assert run("simulate", "--arm", arm_file, *options, "-o", out, "--quiet") == (0, "", "")
        logs.append(Log.read(out).q)
    np.testing.assert_array_equal(logs[0], logs[1])
    assert np.any(logs[0] != logs[2])


def test_torques_of_a_log_are_simulated_again(arm, arm_file, log_file, tmp_path, run):
    out = tmp_path / "again.parquet"
    assert run("simulate", "--arm", arm_file, "--torque", log_file, "-o", out)[0] == 0
    again, log = Log.read(out), Log.read(log_file)
    np.testing.assert_array_equal(again.tau, log.tau)
    assert np.max(np.abs(again.q - log.q)) < 1.5 * np.max(arm.encoder_step)


@pytest.mark.parametrize("duration", ["1000", "0.0001"])
def test_a_log_of_torques_is_simulated_no_longer_than_it_lasts(duration, arm_file, log_file, tmp_path, run):
    code, _, err = run(
        "simulate", "--arm", arm_file, "--torque", log_file, "--duration", duration, "-o", tmp_path / "s.csv"
    )
    assert code == 2
    assert "--duration" in err
    assert "last" in err


def test_log_from_standard_input(arm_file, seed_log):
    buffer = io.BytesIO()
    seed_log.to_polars().write_csv(buffer)
    options = ("--scheme", "filtered-power", "--json", "-")
    done = armgap("identify", "-", "--arm", arm_file, *options, input=buffer.getvalue())
    assert (done.returncode, done.stderr) == (0, b"")
    assert json.loads(done.stdout)[0]["log"] == "stdin"


def test_columns_and_units_on_the_command_line(arm_file, log_file, tmp_path, run):
    """A log under other names and units gives the same estimate."""
    frame = pl.read_parquet(log_file)
    other = frame.select(
        time=pl.col("t") * 1e3,
        shoulder=pl.col("q1").degrees(),
        elbow=pl.col("q2").degrees(),
        a=pl.col("tau1") * 1e3,
        b=pl.col("tau2") * 1e3,
    )
    other.write_csv(tmp_path / "other.csv")
    mapping = ("--columns", "t=time,q1=shoulder,q2=elbow,tau1=a,tau2=b", "--units", "t=ms,q=deg,tau=mNm")
    tail = ("--arm", arm_file, "--scheme", "filtered-power", "--json", "-")
    results = [
        json.loads(run("identify", *words, *tail)[1])[0]["parameters"]
        for words in ((log_file,), (tmp_path / "other.csv", *mapping))
    ]
    for name, entry in results[0].items():
        assert results[1][name]["value"] == pytest.approx(entry["value"], rel=1e-6), name


@pytest.mark.slow
def test_no_color_is_honoured(arm_file, log_file):
    for force in ({}, {"FORCE_COLOR": "1"}):
        done = armgap("identify", log_file, "--arm", arm_file, env={**os.environ, "NO_COLOR": "1", **force})
        assert done.returncode == 0
        assert re.search(rb"\x1b\[[0-9;]*[34][0-8]", done.stdout) is None


def test_a_closed_pipe_is_no_error(arm_file, log_file):
    words = [sys.executable, "-c", "from armgap.cli import main; main()", "identify", log_file, "--arm", arm_file]
    with subprocess.Popen([*map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert b"Traceback" not in process.stderr.read()


def test_an_interrupt_ends_cleanly(arm_file, tmp_path):
    """Control-C during a long simulation: status 130, one line, nothing written."""
    out = tmp_path / "long.parquet"
    words = ("simulate", "--arm", arm_file, "--torque", "seed", "--duration", "15000", "-o", out)
    # A shell's background job is started with interrupts ignored; a terminal's is not.
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "import polars; import armgap.cli.model_commands.simulate; print(flush=True); armgap.cli.main()"
    )
    command = [sys.executable, "-c", code, *map(str, words)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    try:
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(0.5)
        assert process.poll() is None, "the simulation was over before the interrupt"
        process.send_signal(signal.SIGINT)
        out_text, err = process.communicate(timeout=5)
    finally:
        process.kill()
    assert process.returncode == 130
    # click ends the line on which the terminal shows ^C.
    assert (out_text, err) == (b"", b"\narmgap: interrupted\n")
    assert [p.name for p in tmp_path.iterdir()] == []


def test_the_module_is_the_command() -> None:
    ran = subprocess.run([sys.executable, "-m", "armgap", "--version"], capture_output=True, text=True, check=True)
    assert ran.stdout == f"armgap, version {__version__}\n"
