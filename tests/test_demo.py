"""`armgap demo`: the sealed sample case, cases that cannot be trusted, and logs of one's own."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from armgap.cli.demo import CASE_FOLDER as CASE
from armgap.trial.cases.key import HiddenEffect, Key, open_key
from armgap.trial.verdict import judge
from doc_blocks import agrees, blocks

README = Path(__file__).resolve().parents[1] / "README.md"

Run = Callable[..., tuple[int, str, str]]


class Named:
    def __init__(self, effect: str, joint: int | None) -> None:
        self.effect, self.joint = effect, joint


class Answer:
    def __init__(self, *causes: tuple[str, int | None]) -> None:
        self.verdict = "effect" if causes else "none"
        self.causes = tuple(Named(*c) for c in causes)


def key(*effects: tuple[str, int | None]) -> Key:
    return Key(tuple(HiddenEffect(e, j, {}) for e, j in effects), "off", (), {}, "")


@pytest.mark.parametrize(
    ("hidden", "named", "right", "exact"),
    [
        ([("stribeck", 2)], [("stribeck", 2)], True, True),
        ([("stribeck", 2)], [("stribeck", 1)], False, False),
        ([("stribeck", 2)], [("presliding", 2), ("stribeck", 2)], False, False),
        ([("stribeck", 2)], [], False, False),
        ([("coulomb_asymmetry", 1)], [("torque_offset", 1)], True, False),
        ([("coulomb_asymmetry", 1)], [("torque_offset", 2)], False, False),
        ([("base_tilt", None)], [("encoder_offset", 1)], True, False),
        ([("base_tilt", None)], [("encoder_offset", 2)], False, False),
        ([], [], True, True),
        ([], [("stribeck", 1)], False, False),
    ],
)
def test_an_answer_is_judged_by_its_first_cause_and_joint(hidden, named, right, exact) -> None:
    judgement = judge(Answer(*named), key(*hidden))  # type: ignore[arg-type]
    assert (judgement.right, judgement.exact) == (right, exact)


def test_the_sample_case_is_diagnosed_before_its_key_is_opened(run: Run, tmp_path: Path) -> None:
    status, out, err = run("demo", "--report", tmp_path / "demo.html", "--json", tmp_path / "demo.json")
    assert (status, err) == (0, "")
    hidden, found = open_key(CASE).effects[0], json.loads((tmp_path / "demo.json").read_text())["causes"][0]
    text = " ".join(out.split())
    assert text.index("sha256 is") < text.index("report:") < text.index("key opened")
    assert f"the answer was right: {found['effect']} of joint {found['joint']}" in text
    assert (found["effect"], found["joint"]) == (hidden.effect, hidden.joint)
    for name, value in hidden.parameters.items():
        assert found["parameters"][name]["value"] == pytest.approx(value, rel=0.05)
    assert (tmp_path / "demo.html").read_text().startswith("<!")
    [shown] = [b.text for b in blocks(README) if b.language == "text"]
    assert agrees(shown, out)


def test_a_key_changed_after_sealing_ends_the_demo(run: Run, tmp_path: Path) -> None:
    folder = shutil.copytree(CASE, tmp_path / "case")
    (folder / "key.json").write_text((folder / "key.json").read_text().replace('"off"', '"exact"'))
    status, out, err = run("demo", "--case", folder, "--report", tmp_path / "demo.html")
    assert status == 2
    assert out == ""
    assert not (tmp_path / "demo.html").exists()
    assert err.count("\n") == 1
    assert "not the key that was sealed" in err


def test_own_logs_are_diagnosed_without_a_key(run: Run, tmp_path: Path) -> None:
    train, held = CASE / "train-1.parquet", CASE / "holdout-1.parquet"
    report = tmp_path / "own.html"
    status, out, _ = run("demo", train, "--arm", CASE / "arm.toml", "--holdout", held, "--report", report)
    assert status == 0
    assert "Where is the gap?" in out
    assert "key" not in out.split()
    assert report.is_file()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["train.csv"], "no arm file was given"),
        (["--arm", "arm.toml"], "no log was given"),
        (["train.csv", "--arm", "arm.toml", "--fresh", "3"], "a case and logs of your own"),
        (["--case", str(CASE), "--fresh", "3"], "--case and --fresh"),
        (["--case", "nowhere"], "cannot be read"),
    ],
)
def test_contradictory_or_missing_input_is_refused(run: Run, tmp_path: Path, words: list[str], says: str) -> None:
    report = tmp_path / "demo.html"
    status, _, err = run("demo", *words, "--report", report)
    assert (status, err.count("\n")) == (2, 1)
    assert says in err
    assert not report.exists()
