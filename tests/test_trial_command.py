"""``armgap trial``: cases are made once, scored from their folder, and a broken seal is no answer."""

from __future__ import annotations

import json

import pytest

pytest.importorskip("mujoco", reason="making cases needs armgap[trial]")

CASES = 2


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    from armgap.cli import main

    target = tmp_path_factory.mktemp("trial") / "cases"
    with pytest.raises(SystemExit) as stop:
        main(["trial", "--cases", str(CASES), "--seed", "5", "--duration", "4", "--make-only", "--folder", str(target)])
    assert not stop.value.code
    return target


def test_cases_are_numbered_and_sealed(folder):
    assert [p.name for p in sorted(folder.iterdir())] == ["case-0000", "case-0001"]
    for case in folder.iterdir():
        assert {"arm.toml", "key.json", "train-1.parquet", "holdout-1.parquet"} <= {p.name for p in case.iterdir()}


def test_score(folder, run):
    status, out, err = run("trial", "--score", folder, "--json", "-")
    assert (status, err) == (0, "")
    score = json.loads(out)
    assert score["of"] == len(score["cases"]) == CASES
    assert score["right"] == sum(case["right"] for case in score["cases"])
    status, out, _ = run("trial", "--score", folder)
    assert f"right: {score['right']} of {CASES}" in out


def test_a_changed_key_is_refused(folder, run, tmp_path):
    import shutil

    copy = tmp_path / "cases"
    shutil.copytree(folder, copy)
    key = copy / "case-0000" / "key.json"
    key.write_text(key.read_text().replace('"nominal"', '"nominal" ', 1))
    status, out, err = run("trial", "--score", copy)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "key.json" in err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--make-only"], "--folder"),
        (["--score", "none"], "no cases"),
        (["--duration", "0"], "1 to 600"),
        (["--cases", "0"], "--cases"),
        (["--score", "a", "--folder", "b"], "--score"),
    ],
)
def test_words_that_make_no_sense(words, says, run):
    status, out, err = run("trial", *words)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert says in err
