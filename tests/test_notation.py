"""The vocabulary: a glossary with sources, former public names that warn, and retired words that nobody writes any more."""

from __future__ import annotations

import ast
import importlib
import re
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

import armgap
from armgap._renamed import MOVED, RENAMED

ROOT = Path(__file__).resolve().parents[1]
NOTATION = (ROOT / "docs" / "notation.md").read_text()


def words(text: str) -> frozenset[str]:
    return frozenset(text.split())


#: Identifiers that have given way to terms of the field; docs/notation.md has the public ones.
RETIRED_PYTHON = words(
    "AtHorizon Build Heat Hidden Knob Limit Named OwnEffect PEERS Place Placed Reach Rig Shown Sized Told Track Wish course faint "
    "following knob knobs lack lacking lawful noticeable of_many own peer peers rig tell told trifle wish wishes"
)
RETIRED_RUST = words(
    "Abreast Body Bundle Contender Course Gliding Kept Lack Lacking Lacks Leap Metric Moving Passage Placed Pose Scored Shift Slopes "
    "Spread Study Swing Taken Together UserEffect Watched Way abreast dtwist glide knock knocks lacking lent lever noticeable riding "
    "rounded smoother starts stops tempered thrifty trifle twist"
)
#: What is no identifier in Rust: comments, strings, characters.
NO_IDENTIFIER = re.compile(r'//[^\n]*|/\*.*?\*/|r(#*)".*?"\1|"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])\'', re.DOTALL)


def rows(heading: str) -> list[list[str]]:
    """Cells of the table below a heading, without its own header."""
    section = NOTATION.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines[2:]]


GLOSSARY = rows("Glossary")
REFERENCES = re.findall(r"^\* ([^:]+?): ", NOTATION.partition("\n## References\n")[2], re.MULTILINE)


@pytest.mark.parametrize("row", GLOSSARY, ids=lambda row: row[0])
def test_a_term_has_a_definition_and_a_source(row: list[str]) -> None:
    term, definition, source = row
    assert term
    assert len(definition.split()) > 2 or definition.startswith("see ")
    link = re.fullmatch(r"\[[^\]]+\]\(([^)#]+)\)", source)
    assert (ROOT / "docs" / link[1]).is_file() if link else source in REFERENCES


def test_terms_are_in_order_and_each_once() -> None:
    terms = [term.lower() for term, *_ in GLOSSARY]
    assert terms == sorted(set(terms))


def test_references_are_in_order_and_used() -> None:
    assert sorted(set(REFERENCES), key=lambda r: r.replace("Å", "A")) == REFERENCES
    assert set(REFERENCES) == {source for *_, source in GLOSSARY if not source.startswith("[")}


def test_a_term_that_refers_to_another_finds_it() -> None:
    terms = {term for term, *_ in GLOSSARY}
    assert {d.removeprefix("see ") for _, d, _ in GLOSSARY if d.startswith("see ")} <= terms


def test_public_names_are_no_retired_words() -> None:
    assert all(hasattr(armgap, name) for name in armgap.__all__)
    assert not RETIRED_PYTHON & set(armgap.__all__)


@pytest.mark.parametrize("old", RENAMED)
def test_a_former_name_warns_and_is_the_new_one(old: str) -> None:
    module, _, name = old.rpartition(".")
    home, _, changed = RENAMED[old].rpartition(".")
    with pytest.warns(DeprecationWarning, match=re.escape(f"{old} is now {RENAMED[old]}")) as caught:
        value = getattr(importlib.import_module(module), name)
    assert value is getattr(importlib.import_module(home), changed)
    assert caught[0].filename == __file__
    assert name not in getattr(importlib.import_module(module), "__all__", ())


@pytest.mark.parametrize("old", MOVED)
def test_a_former_module_warns_and_is_the_new_one(old: str) -> None:
    sys.modules.pop(old, None)
    with pytest.warns(DeprecationWarning, match=re.escape(f"{old} is now {MOVED[old]}")) as caught:
        __import__(old)
    assert sys.modules[old] is importlib.import_module(MOVED[old])
    assert caught[0].filename == __file__


def test_a_module_of_a_package_that_moved_is_the_new_one() -> None:
    from armgap.arm.description import read

    with pytest.warns(
        DeprecationWarning, match=re.escape("armgap.description.read is now armgap.arm.description.read")
    ):
        assert importlib.import_module("armgap.description.read") is read
    with (
        pytest.warns(DeprecationWarning, match=re.escape("armgap.description.nothing")),
        pytest.raises(ModuleNotFoundError, match=re.escape("arm.description.nothing")),
    ):
        importlib.import_module("armgap.description.nothing")


def test_a_former_module_is_an_attribute_of_the_package() -> None:
    armgap.__dict__.pop("controller", None)
    with pytest.warns(DeprecationWarning, match=re.escape("armgap.controller is now armgap.arm.controller")) as caught:
        module = armgap.controller
    assert module is importlib.import_module("armgap.arm.controller")
    assert caught[0].filename == __file__


def test_new_names_and_other_names_do_not_warn() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for new in RENAMED.values():
            home, _, name = new.rpartition(".")
            getattr(importlib.import_module(home), name)
        for module in {old.rpartition(".")[0] for old in RENAMED}:
            with pytest.raises(AttributeError, match="no attribute 'nothing'"):
                _ = importlib.import_module(module).nothing


def test_the_page_lists_every_renamed_public_name() -> None:
    assert rows("Renamed in 0.2.0") == [[f"`{old}`", f"`{new}`"] for old, new in RENAMED.items()]


def test_the_page_lists_every_module_that_moved() -> None:
    assert rows("Moved in 0.2.0") == [[f"`{old}`", f"`{new}`"] for old, new in MOVED.items()]


def bound(tree: ast.AST) -> Iterator[str]:
    """Every name that Python code defines: variables, arguments, functions, classes, imports."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.alias):
            yield node.asname or node.name.rpartition(".")[2]


def test_no_retired_word_is_an_identifier_in_python() -> None:
    files = sorted((ROOT / "python").rglob("*.py"))
    found = [(f.name, name) for f in files for name in bound(ast.parse(f.read_text())) if name in RETIRED_PYTHON]
    assert found == []
    assert len(files) > 100


def test_no_retired_word_is_an_identifier_in_rust() -> None:
    files = sorted((ROOT / "rust").rglob("*.rs"))
    used = {f: set(re.findall(r"\b[A-Za-z_]\w*\b", NO_IDENTIFIER.sub(" ", f.read_text()))) for f in files}
    assert {f.name: found for f in files if (found := used[f] & RETIRED_RUST)} == {}
    assert len(files) > 100
