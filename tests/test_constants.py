"""Constants: listed in the documents with their reasons, and one value each."""

from __future__ import annotations

import runpy
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
TOOL = runpy.run_path(str(ROOT / "tools" / "constants.py"))
PACKAGES: dict[str, list[Any]] = {title: TOOL["constants"](ROOT / folder) for title, folder in TOOL["PACKAGES"].items()}
#: What both languages have: file and name in Python, file and name in the crate `armgap-fit`.
SAME = [
    ("planning/outcome.py", "ABOVE_FLOOR", "acceptance.rs", "ABOVE_FLOOR"),
    ("planning/outcome.py", "MATTERS", "acceptance.rs", "MATTERS"),
    ("planning/outcome.py", "CERTAIN", "acceptance.rs", "CERTAIN"),
    ("planning/outcome.py", "HELD_CERTAIN", "acceptance.rs", "HOLDOUT_CERTAIN"),
    ("custom_effect.py", "MAX_CUSTOM_EFFECTS", "custom_effect.rs", "MAX_CUSTOM_EFFECTS"),
]


def test_the_page_is_that_of_the_sources() -> None:
    page = (ROOT / "docs" / "reference" / "constants.md").read_text(encoding="utf-8")
    assert page == TOOL["page"](), "run tools/constants.py docs/reference/constants.md"


@pytest.mark.parametrize("title", PACKAGES)
def test_every_constant_has_its_reason(title: str) -> None:
    assert PACKAGES[title] != []
    assert [f"{c.file}: {c.name}" for c in PACKAGES[title] if not c.reason] == []


@pytest.mark.parametrize("title", PACKAGES)
def test_no_name_has_two_values(title: str) -> None:
    """Within a package, whether or not other files may use the name."""
    values = defaultdict(set)
    for constant in PACKAGES[title]:
        values[constant.name].add(constant.value)
    assert {name: found for name, found in values.items() if len(found) > 1} == {}


def test_what_both_languages_have_is_the_same() -> None:
    def value(title: str, file: str, name: str) -> float:
        [found] = [c.value for c in PACKAGES[title] if c.name == name and c.file.endswith("/" + file)]
        return float(found)

    for file, name, core_file, core_name in SAME:
        assert value("armgap (Python)", file, name) == value("armgap-fit", core_file, core_name), name


def test_the_reader_of_constants() -> None:
    rust = """/// Longest step, s: a reason.
pub const STEP: f64 = 1e-3;
/// Two lines
/// of reason.
const FIRST: usize = 3;
const SECOND: usize = 4;
const TEXT: &str = "3";

#[cfg(test)]
mod tests {
    const OTHER: f64 = 1.0;
}
"""
    found = list(TOOL["_of_rust"](rust, "a.rs"))
    assert [(c.name, c.value, c.unit, c.reason) for c in found] == [
        ("STEP", "1e-3", "s", "Longest step, s: a reason."),
        ("FIRST", "3", "", "Two lines of reason."),
        ("SECOND", "4", "", "Two lines of reason."),
    ]
    python = '#: Both [rad].\nLOW, HIGH = -1.0, 2 * 3\n_LATER_S = 5  # Beside.\nMOST = 7\n"""After."""\nFLAG = True\nNAME = "x"\n'
    found = list(TOOL["_of_python"](python, "a.py"))
    assert [(c.name, c.value, c.unit, c.reason) for c in found] == [
        ("LOW", "-1.0", "rad", "Both [rad]."),
        ("HIGH", "2 * 3", "rad", "Both [rad]."),
        ("_LATER_S", "5", "s", "Beside."),
        ("MOST", "7", "", "After."),
    ]
