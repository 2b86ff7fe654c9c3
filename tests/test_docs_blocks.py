"""Every block of the documents that a reader would type does what the document says."""

from __future__ import annotations

import shutil
from pathlib import Path

import click
import numpy as np
import pytest

from armgap import Arm, Log, effects, simulate
from armgap.cli import COMMANDS, cli
from armgap.simulation import Effect
from conftest import TABLE_ONE
from doc_blocks import Block, agrees, blocks, commands, run

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
RUN = [
    ROOT / "README.md",
    *(ROOT / "docs" / name for name in ("index.md", "tutorial.md", "reference/errors.md")),
    *sorted((ROOT / "docs" / "how-to").glob("*.md")),
]
#: Commands that other tests run, and take long.
ELSEWHERE = {"demo": "test_demo.py", "reproduce": "test_reproduce.py", "trial": "test_trial_command.py"}
BENCH = """\
name = "bench arm"
kind = "pendulum"
sample_period = 0.004

[inertial]
theta = [0.050, 0.60]

[friction]
viscous = [0.02]
coulomb = [0.10]

[geometry]
link_length = [0.3]
"""


def named(path: Path) -> str:
    return str(path.relative_to(ROOT))


def record(arm: Arm, true: np.ndarray, secret: Effect, seed: int, seconds: float, size: np.ndarray) -> Log:
    """A log under five random sines per joint."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds / arm.sample_period)) * arm.sample_period
    tau = np.zeros((len(t), arm.n_joints))
    for j in range(arm.n_joints):
        draw = rng.uniform(size=(3, 5))
        tau[:, j] = size[j] * ((0.1 + 0.3 * draw[0]) * np.sin(np.outer(t, 0.5 + 8.5 * draw[1]) + 6 * draw[2])).sum(
            axis=1
        )
    real = Arm(arm.name, arm.kind, arm.gravity, arm.sample_period, true, arm.sigma)
    return simulate(real, t, tau, effects=[secret], noise=2e-5, seed=seed, tolerance=1e-8)


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the how-to guides assume: an arm file and logs of a pendulum with Stribeck friction."""
    folder = tmp_path_factory.mktemp("bench")
    (folder / "arm.toml").write_text(BENCH)
    arm = Arm.read(folder / "arm.toml")
    secret = Effect("stribeck", 1, {"amplitude": 0.15, "velocity": 0.3})
    for seed, name in enumerate(("a", "b", "c", "d", "run"), start=1):
        record(arm, arm.theta * np.array([1.04, 0.97, 0.9, 1.1]), secret, seed, 4.0, np.ones(1)).write(
            folder / f"{name}.parquet"
        )
    return folder


@pytest.fixture(scope="session")
def two_links(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the README assumes: an arm file and logs of two joints, one of them a CSV with other names."""
    folder = tmp_path_factory.mktemp("two")
    (folder / "arm.toml").write_text(TABLE_ONE)
    arm = Arm.read(folder / "arm.toml")
    for seed, name in enumerate(("a", "b", "c", "run", "other-run"), start=1):
        log = record(
            arm, arm.theta, Effect("stribeck", 2, {"amplitude": 0.8, "velocity": 0.5}), seed, 3.0, np.array([50.0, 6.0])
        )
        log.write(folder / f"{name}.parquet")
    table = Log.read(folder / "a.parquet").to_polars()
    table.rename({"t": "time", "q1": "shoulder_pos", "tau1": "shoulder_torque"}).write_csv(folder / "log.csv")
    return folder


@pytest.mark.parametrize("document", RUN, ids=named)
def test_blocks_do_what_they_show(document: Path, bench: Path, two_links: Path, tmp_path: Path, monkeypatch) -> None:
    given = {"README.md": two_links, "tutorial.md": None}.get(document.name, bench)
    for file in sorted(given.iterdir()) if given else ():
        shutil.copy(file, tmp_path)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "__main__"}
    for block in blocks(document):
        if any(words[1] in ELSEWHERE for words, _ in commands(block)):
            block = without(block, ELSEWHERE)
        run(block, names)


def without(block: Block, names: dict[str, str]) -> Block:
    kept = [line for line in block.text.splitlines(keepends=True) if not any(f"armgap {n}" in line for n in names)]
    return Block(block.language, block.title, "".join(kept), block.line)


@pytest.mark.parametrize("document", DOCUMENTS, ids=named)
def test_commands_and_options_exist(document: Path) -> None:
    context = cli.make_context("armgap", [], resilient_parsing=True)
    known = {e["name"] for e in effects()}
    for block in blocks(document):
        for words, _ in commands(block) if block.language in ("sh", "console") else ():
            assert words[1] in COMMANDS or words[1].startswith("-"), (document.name, words)
            command = cli.get_command(context, words[1])
            if isinstance(command, click.Group) and words[2:] and words[2] in command.commands:
                command = command.commands[words[2]]
            options = {o for p in command.params for o in p.opts} | {"--help", "-h"} if command else {"--version"}
            for word in words[2:]:
                assert not word.startswith("--") or word.split("=")[0] in options, (document.name, words[1], word)
            placed = [words[i + 1] for i, word in enumerate(words) if word == "--effect"]
            assert {text.split(":")[0] for text in placed} <= known


def test_rust_examples_are_those_that_the_documentation_tests_compile() -> None:
    """The README is part of the core's documentation tests; other documents show the same block."""
    [compiled] = [b.text for b in blocks(ROOT / "README.md") if b.language == "rust"]
    shown = [
        b.text for document in (ROOT / "docs" / "how-to").glob("*.md") for b in blocks(document) if b.language == "rust"
    ]
    assert shown == [compiled] * len(shown) != []


def test_shown_and_real_output_are_compared_word_by_word() -> None:
    real = "one 14.70 mrad, and\n  then 0.5 (p 1.00)."
    assert agrees("one 14.1 mrad, … then 0.5 (p 1.00).", real)
    assert agrees("", real)
    assert not agrees("one 10.1 mrad,", real)
    assert not agrees("one 14.7 rad,", real)
    assert not agrees("then … one", real)
