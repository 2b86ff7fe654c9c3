"""Exported files: arm files that read back, causes without a field, names that cannot break a file, bad input."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from armgap import Arm, Diagnosis, correct, diagnose, effects, simulate
from armgap.export import FIELDS, ExportError
from armgap.export.chain.joint import ON_JOINT
from armgap.export.corrected import LEAST_SIGMA
from armgap.simulation import Effect
from export_cases import SIZES, THETA, found, make_arm

Run = Callable[..., tuple[int, str, str]]


@pytest.mark.parametrize("kind", THETA)
def test_an_arm_file_reads_back_as_the_corrected_arm(kind: str, tmp_path: Path) -> None:
    arm = make_arm(kind, link_length=np.full(len(THETA[kind]) // 4, 0.4), link_mass=np.full(len(THETA[kind]) // 4, 3.0))
    model = correct(
        found(arm, ("payload", None, SIZES["payload"]), ("stribeck", 1, {"amplitude": 0.5, "velocity": 0.2})), arm
    )
    path = tmp_path / "corrected.toml"
    path.write_text(model.render("toml"))
    again = Arm.read(path)
    assert again.theta.tolist() == model.nominal().theta.tolist()
    assert np.all(again.sigma >= LEAST_SIGMA * np.abs(again.theta) * (1 - 1e-12))
    assert again.link_length is not None
    assert again.link_mass is not None
    assert (again.link_length.tolist(), again.link_mass.tolist()) == (arm.link_length.tolist(), arm.link_mass.tolist())
    [option] = [line for line in path.read_text().splitlines() if line.startswith("# armgap simulate")]
    assert Effect.parse(option.split()[-1]) == Effect("stribeck", 1, {"amplitude": 0.5, "velocity": 0.2})


def test_what_was_diagnosed_and_exported_closes_the_gap(run: Run, tmp_path: Path) -> None:
    """A pendulum with wrong values and a rotor: diagnosed, exported, and diagnosed again with the exported arm file."""
    arm = replace(make_arm("pendulum"), sample_period=0.004)
    true = replace(arm, theta=arm.theta * np.array([1.2, 0.9, 1.3, 0.8]))
    (tmp_path / "arm.toml").write_text(arm.to_toml())
    for seed in (1, 2):
        t = np.arange(1000) * 0.004
        draw = np.random.default_rng(seed).uniform(size=(3, 5))
        tau = (0.5 + draw[0]) * np.sin(np.outer(t, 0.5 + 8 * draw[1]) + 6 * draw[2])
        simulate(true, t, tau.sum(axis=1), noise=1e-4, seed=seed).write(tmp_path / f"{seed}.parquet")
    logs = [str(tmp_path / "1.parquet"), "--holdout", str(tmp_path / "2.parquet"), "--quiet"]
    assert run("diagnose", *logs, "--arm", tmp_path / "arm.toml", "--json", tmp_path / "d.json") == (0, "", "")
    for ending in ("toml", "xml"):
        status, out, _ = run(
            "export", tmp_path / "d.json", "--arm", tmp_path / "arm.toml", "-o", tmp_path / f"new.{ending}"
        )
        assert (status, out) == (0, "")
    new = Arm.read(tmp_path / "new.toml")
    assert new.theta == pytest.approx(true.theta, rel=0.02)
    again = diagnose(tmp_path / "1.parquet", new, holdout=tmp_path / "2.parquet")
    first = Diagnosis.from_dict(json.loads((tmp_path / "d.json").read_text()))
    assert again.verdict == "none"
    assert again.gap.before[0] < 0.05 * first.gap.before[0]
    moved = tmp_path / "moved.parquet"
    assert run("simulate", "--arm", tmp_path / "new.toml", "--torque", logs[0], "-o", moved, "--quiet")[0] == 0


@pytest.mark.parametrize("effect", [e["name"] for e in effects()])
def test_every_effect_has_a_field_or_is_named_as_missing(effect: str) -> None:
    arm = make_arm("two-link", torque_limit=np.array([200.0, 15.0]))
    entry = next(e for e in effects() if e["name"] == effect)
    p = SIZES.get(effect, {q["name"]: 0.1 for q in entry["parameters"]})
    joint = 2 if entry["scope"] == "joint" else None
    cause = (effect, joint, p)
    bare, full = correct(found(arm), arm), correct(found(arm, cause), arm)
    for form in ("mjcf", "urdf", "toml"):
        named = any(effect in line and "no field for" in line for line in full.missing(form))
        assert named == (full.field_of(full.causes[0], form) is None)
        if form == "toml":
            continue
        assert (f"no field for {effect}" in full.render(form)) == named
        written = [[(e.tag, e.attrib) for e in ET.fromstring(m.render(form)).iter()] for m in (bare, full)]
        assert (written[0] == written[1]) == named, "an effect changes the model exactly if it has a field"
    assert json.loads(full.render("json"))["effects"][0]["effect"] == effect


def test_the_table_of_fields_and_what_is_written_agree() -> None:
    assert (
        {name for name, field in FIELDS.items() if field.mjcf}
        == {*ON_JOINT, "payload", "base_tilt", "rotor_coupling"}
        == set(SIZES)
    )


def test_lengths_are_kept_on_request() -> None:
    arm = make_arm("two-link", link_length=np.array([0.46, 0.3]))
    as_found, kept = (correct(found(arm), arm, keep_lengths=k) for k in (False, True))
    assert as_found.theta.tolist() == arm.theta.tolist()
    assert as_found.links.length[0] == pytest.approx(9.81 * arm.theta[1] / arm.theta[4])  # type: ignore[union-attr]
    assert any("the arm file states 0.46" in choice for choice in as_found.links.choices)  # type: ignore[union-attr]
    assert kept.links.length == (pytest.approx(0.46), 0.3)  # type: ignore[union-attr]
    cost = lambda k: ((k - arm.theta) / arm.sigma)[[1, 4]] @ ((k - arm.theta) / arm.sigma)[[1, 4]]  # noqa: E731
    for other in (0.999, 1.001):  # nothing nearer keeps the length
        moved = kept.theta.copy()
        moved[[1, 4]] *= other
        assert cost(moved) > cost(kept.theta)
    with pytest.raises(ExportError, match="no length of link 1"):
        correct(found(make_arm("pendulum")), make_arm("pendulum"), keep_lengths=True)


def test_names_cannot_break_the_files() -> None:
    arm = replace(make_arm("pendulum"), name='a -- "b" <c>&\n--->')
    model = correct(found(arm, ("stribeck", 1, {"amplitude": 0.5, "velocity": 0.2})), arm)
    for form in ("mjcf", "urdf"):
        root = ET.fromstring(model.render(form))
        assert root.get("model" if form == "mjcf" else "name") is not None
    json.loads(model.render("json"))
    assert tomllib.loads(model.render("toml"))["name"] == arm.name + ", corrected"


@pytest.mark.parametrize(
    ("content", "options", "says"),
    [
        (None, [], "cannot be read"),
        ("{", [], "is not JSON"),
        ("[1]", [], "is not a diagnosis of schema"),
        ('{"schema": "armgap.trial/1"}', [], "armgap.trial/1"),
        ('{"schema": "armgap.diagnosis/1"}', [], "`gap` is missing"),
        ("nan", [], "with_causes.theta1 is not a finite number"),
        ("text", [], "with_causes.theta1 is not a finite number"),
        ("other", [], "was made with 0.32"),
        ("axis", [], "viscous1"),
        ("good", ["-o", "out.obj"], "does not tell the format"),
        ("good", ["--keep-lengths"], "no length of link 1"),
        ("good", ["-o", "nowhere/out.xml"], "folder does not exist"),
    ],
)
def test_bad_input_is_one_line_and_nothing_written(
    run: Run, tmp_path: Path, content, options, says, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    arm = make_arm("pendulum")
    Path("arm.toml").write_text((make_arm("two-link") if content == "axis" else arm).to_toml())
    data = deepcopy(found(arm).to_dict())
    if content in ("nan", "text"):
        data["parameters"]["with_causes"]["theta1"] = {
            "value": math.nan if content == "nan" else "x",
            "sigma": 1,
            "unit": "",
        }
    if content == "other":
        data["parameters"]["nominal"]["theta1"]["value"] = 0.32
    if content is not None:
        Path("d.json").write_text(content if content[0] in "{[" else json.dumps(data))
    before = sorted(tmp_path.rglob("*"))
    status, out, err = run(
        "export", "d.json", "--arm", "arm.toml", *(options if "-o" in options else ["-o", "out.xml", *options])
    )
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert says in err
    assert sorted(tmp_path.rglob("*")) == before
