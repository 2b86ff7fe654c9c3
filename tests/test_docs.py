"""Examples run, docstring examples hold, and the documents speak of what exists."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
import re
import subprocess
import sys
from pathlib import Path
from typing import Literal, get_origin

import pytest

import armgap
from armgap import effects
from armgap.log.units import FACTORS

ROOT = Path(__file__).resolve().parents[1]
LONGEST_EXAMPLE = 60  # lines


def modules() -> list[str]:
    return [m.name for m in pkgutil.walk_packages(armgap.__path__, "armgap.") if not m.name.endswith("_native")]


@pytest.mark.parametrize("path", sorted((ROOT / "examples").glob("*.py")), ids=lambda p: p.name)
def test_example(path, tmp_path):
    assert len(path.read_text().splitlines()) < LONGEST_EXAMPLE
    done = subprocess.run([sys.executable, str(path)], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", modules())
def test_docstring_examples(name):
    try:
        module = importlib.import_module(name)
    except ModuleNotFoundError as missing:
        if (missing.name or "").startswith("armgap"):
            raise
        pytest.skip(f"{missing.name} is not installed")
    import numpy as np

    assert doctest.testmod(module, extraglobs={"np": np}).failed == 0


def test_every_public_name_exists_and_has_a_docstring():
    for name in armgap.__all__:
        value = getattr(armgap, name)
        assert name == "__version__" or get_origin(value) is Literal or value.__doc__, name


def test_formats_name_existing_effects_and_all_units():
    text = (ROOT / "docs" / "formats.md").read_text()
    for unit in {u for units in FACTORS.values() for u in units}:
        assert f"`{unit}`" in text
    known = {e["name"] for e in effects()}
    assert set(re.findall(r"`([a-z_]+):[0-9]*:[a-z]+=", text)) <= known


def test_links_between_documents_lead_somewhere():
    for document in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]:
        for target in re.findall(r"\]\((?!https?:)([^)#]+)", document.read_text()):
            found = (document.parent / target).exists() or target == "reference/commands.md"  # made with the site
            assert found, (document.name, target)


def test_arm_file_of_the_documentation_is_valid(tmp_path):
    text = (ROOT / "docs" / "formats.md").read_text()
    [example] = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    path = tmp_path / "arm.toml"
    path.write_text(example.replace("…", "0" * 64))
    assert armgap.Arm.read(path).n_joints == 2
