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
from armgap.log.conversion.units import COUNTED, FACTORS

ROOT = Path(__file__).resolve().parents[1]
LONGEST_EXAMPLE = 60  # lines
#: What the arm file of a serial arm in the documentation describes: two joints and a finger.
ROBOT = """\
<robot name="bench arm"><link name="base_link"/>
<link name="upper"><inertial><origin xyz="0 0 0.1"/><mass value="3"/>
  <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tool0"><inertial><origin xyz="0 0 0.1"/><mass value="2"/>
  <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tip"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="continuous"><parent link="base_link"/><child link="upper"/><axis xyz="0 1 0"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="tool0"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/></joint>
<joint name="finger" type="prismatic"><parent link="tool0"/><child link="tip"/><axis xyz="1 0 0"/>
  <limit lower="0" upper="0.04" effort="10" velocity="1"/></joint></robot>
"""


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
    for unit in {u for units in FACTORS.values() for u in units} | set(COUNTED.values()):
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
    planar, described, links = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    (tmp_path / "robot.urdf").write_text(ROBOT)
    path = tmp_path / "arm.toml"
    for example, n_joints in (
        (planar.replace("…", "0" * 64), 2),
        (described, 2),
        (f'kind = "serial"\nsample_period = 0.002\n{links}', 1),
    ):
        path.write_text(example)
        assert armgap.Arm.read(path).n_joints == n_joints
