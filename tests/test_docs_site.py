"""The documentation site: a page for every effect, pictures that show its equation, and a build without a warning."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armgap import effects
from armgap.export import FIELDS

ROOT = Path(__file__).resolve().parents[1]
PAGES = ROOT / "docs" / "effects"
CATALOGUE = {e["name"]: e for e in effects()}
HEADINGS = ("## Signature", "## What excites it", "## Look-alikes", "## Reading")
#: Pairs that no log of motion tells apart; each page has to say so.
INSEPARABLE = [
    ("coulomb_asymmetry", "torque_offset"),
    ("base_tilt", "encoder_offset"),
    ("rotor_inertia", "rotor_coupling"),
]


@pytest.fixture(scope="module")
def pictures() -> Any:
    sys.path.insert(0, str(ROOT / "tools"))
    import site_pictures

    return site_pictures


@pytest.fixture(scope="module")
def hooks(pictures: Any) -> Any:
    pytest.importorskip("mkdocs", reason="the site needs armgap[docs]")
    import site_hooks

    return site_hooks


@pytest.mark.parametrize("name", CATALOGUE)
def test_every_effect_has_its_page(name: str) -> None:
    text = (PAGES / f"{name}.md").read_text()
    assert text.startswith("# ")
    assert text.count("<!-- catalogue -->") == 1
    assert [text.count(f"\n{heading}\n") for heading in HEADINGS] == [1] * len(HEADINGS)
    rows = re.findall(r"^\| (?!looks|---)(.+?) \| (.+) \|$", text, re.MULTILINE)
    assert rows, "what looks like it, and what separates them"
    assert name not in {link for row in rows for link in re.findall(r"\((\w+)\.md\)", row[0])} or name == "torque_gain"


def test_no_page_is_of_an_effect_that_does_not_exist() -> None:
    pages = {p.stem for p in PAGES.glob("*.md")} - {"index"}
    assert pages == set(CATALOGUE)
    assert set(FIELDS) <= set(CATALOGUE)


@pytest.mark.parametrize("pair", INSEPARABLE)
def test_pages_of_inseparable_effects_name_each_other(pair: tuple[str, str]) -> None:
    for name, other in (pair, pair[::-1]):
        [row] = [
            line
            for line in (PAGES / f"{name}.md").read_text().splitlines()
            if f"({other}.md)" in line and "nothing in a log" in line
        ]
        assert row


def test_every_effect_has_its_picture_and_its_family(pictures: Any, hooks: Any) -> None:
    listed = [name for names in hooks.FAMILIES.values() for name in names]
    assert len(listed) == len(set(listed))
    assert set(CATALOGUE) <= set(listed)
    for name, entry in CATALOGUE.items():
        [shown] = pictures.placed(name)
        assert set(shown.parameters) == {p["name"] for p in entry["parameters"]}
        assert pictures.SIGNATURES[name].against in pictures.AXES
        facts = hooks.facts(name)
        assert all(f"`{p['name']}`" in facts for p in entry["parameters"])


@pytest.mark.parametrize(
    ("name", "law"),
    [
        ("torque_offset", lambda x: 0.08 + 0 * x["q"]),
        ("quadratic_drag", lambda x: -0.008 * x["dq"] * np.abs(x["dq"])),
        ("joint_spring", lambda x: -0.2 * (x["q"] - 0.2)),
        ("rotor_inertia", lambda x: -0.01 * x["ddq"]),
        ("torque_gain", lambda x: 0.25 * x["tau"]),
        ("rotor_coupling", lambda x: -0.01 * x["other ddq"]),
        ("base_tilt", lambda x: -0.6 * (np.sin(x["q"] + 0.15) - np.sin(x["q"]))),
    ],
)
def test_a_picture_shows_the_effect_and_nothing_else(pictures: Any, name: str, law: Any) -> None:
    _, q, tau = pictures.motion(name)
    seen = pictures.residual_torque(pictures.SIGNATURES[name].kind, q, tau)
    moving = np.abs(seen["dq"]) > 0.1  # at rest friction takes any value up to its level
    error = np.abs(seen["residual"] - law(seen))[moving]
    assert np.quantile(error, 0.95) < 0.02 * np.max(np.abs(law(seen)))


def test_a_picture_is_drawn(pictures: Any) -> None:
    pytest.importorskip("matplotlib")
    assert b"<svg" in pictures.draw("torque_offset")


def test_the_site_builds_without_a_warning(
    pictures: Any, hooks: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The whole site but its pictures, which take most of the time and have their own tests."""
    pytest.importorskip("mkdocstrings")
    pytest.importorskip("material")
    from mkdocs.commands.build import build
    from mkdocs.config import load_config

    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(pictures, "draw", lambda name: b"<svg xmlns='http://www.w3.org/2000/svg'/>")
    build(load_config("mkdocs.yml", site_dir=str(tmp_path), strict=True))
    page = (tmp_path / "effects" / "stribeck.html").read_text()
    assert "exp(-(dq/velocity)^2)" in page
    assert "stribeck.svg" in page
    assert {p.stem for p in (tmp_path / "effects").glob("*.html")} == {*CATALOGUE, "index"}
    assert "CERTAIN" in (tmp_path / "method.html").read_text()
    assert "--keep-lengths" in (tmp_path / "reference" / "commands.html").read_text()
