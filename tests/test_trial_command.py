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
        main(["trial", "--cases", str(CASES), "--seed", "5", "--duration", "2", "--make-only", "--folder", str(target)])
    assert not stop.value.code
    return target


def test_cases_are_numbered_and_sealed(folder):
    assert [p.name for p in sorted(folder.iterdir())] == ["case-0000", "case-0001"]
    for case in folder.iterdir():
        assert {"arm.toml", "key.json", "train-1.parquet", "holdout-1.parquet"} <= {p.name for p in case.iterdir()}


def test_score(folder, run, tmp_path):
    status, out, err = run("trial", "--score", folder, "--json", tmp_path / "score.json")
    assert (status, err) == (0, "")
    score = json.loads((tmp_path / "score.json").read_text())
    assert score["of"] == len(score["cases"]) == CASES
    assert score["right"] == sum(case["right"] for case in score["cases"])
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


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    """A whole trial without baselines, made, answered and scored by one command; its folder and its page."""
    from armgap.cli import main

    pytest.importorskip("pebble", reason="answering cases needs armgap[trial]")
    target = tmp_path_factory.mktemp("whole")
    page = target / "scores.md"
    words = ["trial", "all", "-n", "2", "--seed", "6", "--duration", "2", "--workers", "1", "-o", str(target / "cases")]
    with pytest.raises(SystemExit) as stop:
        main([*words, "--no-baselines", "--md", str(page), "--quiet"])
    assert not stop.value.code
    return target / "cases", page.read_text()


def test_page_says_how_to_make_it_again(trial):
    _, page = trial
    assert "armgap trial all -n 2 --seed 6" in page
    assert "| armgap |" in page
    assert "/" + "tmp" not in page


def test_the_key_is_not_needed_to_answer(trial, run, tmp_path):
    import shutil

    copy = tmp_path / "cases"
    shutil.copytree(trial[0], copy, ignore=shutil.ignore_patterns("key.json", "answers"))
    status, out, err = run("trial", "run", copy, "--workers", "1")
    assert (status, err) == (0, "")
    assert "2 cases answered, 0 were before" in out
    for case in ("case-0000", "case-0001"):
        again, first = (json.loads((f / "answers" / "armgap" / f"{case}.json").read_text()) for f in (copy, trial[0]))
        assert {**again, "seconds": 0} == {**first, "seconds": 0}
    status, out, err = run("trial", "score", copy)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "key.json" in err


def test_a_trial_goes_on_where_it_stopped(trial, run):
    folder, _ = trial
    (folder / "answers" / "armgap" / "case-0001.json").unlink()
    status, _, err = run("trial", "score", folder)
    assert (status, "1 of 2 cases are not answered" in err) == (2, True)
    _, out, _ = run("trial", "run", folder, "--workers", "1")
    assert "1 cases answered, 1 were before" in out
    status, out, _ = run("trial", "make", "-n", "2", "--seed", "6", "--duration", "2", "--workers", "1", "-o", folder)
    assert status == 0
    status, out, _ = run("trial", "score", folder, "--json", "-")
    data = json.loads(out)
    assert data["trial"]["seed"] == 6
    assert [m["method"] for m in data["methods"]] == ["armgap"]
    assert len(data["methods"][0]["cases"]) == 2


def test_a_case_that_takes_too_long_has_an_answer_that_says_so(trial):
    from armgap.trial.methods import ARMGAP
    from armgap.trial.running import answer_cases, open_cases

    cases = open_cases(trial[0], ARMGAP, again=True)[:1]
    [(_, answer)] = answer_cases(cases, ARMGAP, limit_s=0.01)
    assert answer.error == "took longer than 0.01 s"
    assert answer.causes == ()
    [(_, answer)] = answer_cases(cases, ARMGAP)
    assert answer.error is None


def test_an_answer_to_another_case_is_refused(trial, run, tmp_path):
    import shutil

    copy = tmp_path / "cases"
    shutil.copytree(trial[0], copy)
    answers = copy / "answers" / "armgap"
    shutil.copy(answers / "case-0000.json", answers / "case-0001.json")
    status, out, err = run("trial", "score", copy)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "case-0001.json" in err
    assert "another case" in err


def test_a_method_that_answered_some_cases_is_not_scored_and_said_so(trial, run, tmp_path):
    import shutil

    copy = tmp_path / "cases"
    shutil.copytree(trial[0], copy)
    (copy / "answers" / "constant").mkdir()
    shutil.copy(copy / "answers" / "armgap" / "case-0000.json", copy / "answers" / "constant")
    status, out, _ = run("trial", "score", copy)
    assert status == 0
    assert "constant guess has answered 1 of 2 cases" in out


def test_another_trial_is_not_mixed_in(trial, run):
    status, out, err = run("trial", "make", "-n", "2", "--seed", "7", "--duration", "2", "-o", trial[0])
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "another trial" in err


def test_former_names_of_the_baselines_still_work(run, tmp_path, monkeypatch):
    """``trial peers`` warns; ``--no-peers`` is taken; neither is shown."""
    monkeypatch.chdir(tmp_path)
    status, out, err = run("trial", "peers", ".", "--only", "oracle")
    assert (status, out, err.count("\n")) == (2, "", 2)
    assert "'peers' is deprecated" in err
    assert "no method `oracle`" in err
    status, out, _ = run("trial", "all", "-n", "1", "--duration", "1", "-o", "DIR", "--no-peers", "--help")
    assert status == 0
    assert "peers" not in out
    assert "peers" not in run("trial", "--help")[1]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--cases", "3", "run", "."], "before `run`"),
        (["score", "."], "no cases"),
        (["run", "none"], "none"),
        (["baselines", ".", "--only", "oracle"], "oracle"),
        (["all", "-n", "2"], "--output"),
        (["make", "-n", "0", "-o", "x"], "-n"),
    ],
)
def test_sub_commands_that_make_no_sense(words, says, run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, out, err = run("trial", *words)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert says in err
    assert list(tmp_path.iterdir()) == []
