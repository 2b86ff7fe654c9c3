"""Write the list of all named numbers in the sources: python tools/constants.py docs/reference/constants.md."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
#: Packages whose constants are listed: title and source folder.
PACKAGES = {
    "armgap-core": "rust/core/src",
    "armgap-fit": "rust/fit/src",
    "armgap-capi": "rust/capi/src",
    "armgap (Python)": "python/armgap",
}
HEAD = """# Constants

What decides in this library and is no setting: every named number of the sources with its value, unit, reason and file. Without a unit it is
a ratio or a count, or the reason says it. Written by `tools/constants.py`.
"""
#: Regular expression for units in comments, where a unit stands after the last comma or in brackets.
_UNITS = r"1/s|s|ms|rad|m|mm|deg|kg|N m|Hz|W|KB|MB|bytes|rad/s|m/s|m/s\^2|kg m\^2|samples|standard deviations|standard errors|degrees"
_UNIT = re.compile(rf"\[({_UNITS}|SI)\]|, ({_UNITS})(?=[.:;,]|$)")
#: Suffixes of constants' names, with the units that these suffixes stand for.
_SUFFIXES = {"_S": "s", "_RAD": "rad", "_M": "m", "_HZ": "Hz", "_US": "us", "_BYTES": "bytes", "_SAMPLES": "samples"}
_RUST = re.compile(
    r"((?:^///[^\n]*\n)*)^(?:pub(?:\([a-z]+\))? )?const ([A-Z][A-Z0-9_]*): ([^=]+?) =\s*([^;]+);",
    re.MULTILINE,
)
_NUMBER = re.compile(
    r"[-+0-9.eE_*/() \[\],]|f64::(?:consts::)?[A-Z_0-9]+|std::f64::consts::[A-Z_0-9]+|1 << \d+|f64|usize|u\d+|i\d+"
)


_TESTS = re.compile(r"^#\[cfg\(test\)\]\n(?:#\[.*\]\n)*(?:pub(?:\(\w+\))? )?mod ", re.MULTILINE)


class Constant(NamedTuple):
    """A named number: name, value as the source writes it, unit (empty for a ratio or count), comment, file."""

    name: str
    value: str
    unit: str
    reason: str
    file: str


def constants(folder: Path) -> list[Constant]:
    """Return the constants in a package's sources, in order of file and line."""
    found: list[Constant] = []
    for path in sorted([*folder.rglob("*.rs"), *folder.rglob("*.py")]):
        read = _of_rust if path.suffix == ".rs" else _of_python
        found += read(path.read_text(encoding="utf-8"), path.relative_to(ROOT).as_posix())
    return found


def _unit(name: str, reason: str) -> str:
    if told := _UNIT.search(reason):
        return told.group(1) or told.group(2)
    return next((unit for suffix, unit in _SUFFIXES.items() if name.endswith(suffix)), "")


def _of_rust(text: str, file: str) -> Iterator[Constant]:
    program = _TESTS.split(text)[0]
    reason, end = "", -1
    for match in _RUST.finditer(program):
        comment, name, kind, value = match.groups()
        own = " ".join(line.strip().removeprefix("///").strip() for line in comment.splitlines())
        # A comment also applies to the constants on the lines directly below its own.
        reason = own or (reason if match.start() == end + 1 else "")
        end = match.end()
        if _NUMBER.sub("", value).strip() or not re.search(r"\d|f64::", value) or "&" in kind:
            continue
        yield Constant(name, " ".join(value.split()), _unit(name, reason), reason, file)


def _of_python(text: str, file: str) -> Iterator[Constant]:
    lines = text.splitlines()
    body = ast.parse(text).body
    shared, end = "", -1
    for i, statement in enumerate(body):
        if isinstance(statement, ast.Assign):
            target, value = statement.targets[0], statement.value
        elif isinstance(statement, ast.AnnAssign) and statement.value is not None:
            target, value = statement.target, statement.value
        else:
            continue
        reason = _comment(lines, statement.lineno) or _beside(lines[statement.lineno - 1]) or _docstring(body, i)
        reason = shared = reason or (shared if statement.lineno == end + 1 else "")
        end = statement.end_lineno or statement.lineno
        for name, number in _pairs(target, value):
            yield Constant(name, number, _unit(name, reason), reason, file)


def _pairs(target: ast.expr, value: ast.expr) -> Iterator[tuple[str, str]]:
    """Yield upper-case names with their numbers, from an assignment of one name or of a tuple of names."""
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        for one, its in zip(target.elts, value.elts, strict=True):
            yield from _pairs(one, its)
    elif isinstance(target, ast.Name) and re.fullmatch(r"_?[A-Z][A-Z0-9_]*", target.id) and _is_number(value):
        yield target.id, ast.unparse(value)


def _is_number(value: ast.expr) -> bool:
    if isinstance(value, ast.Constant):
        return isinstance(value.value, int | float) and not isinstance(value.value, bool)
    if isinstance(value, ast.Tuple | ast.List):
        return bool(value.elts) and all(map(_is_number, value.elts))
    if isinstance(value, ast.UnaryOp):
        return _is_number(value.operand)
    return isinstance(value, ast.BinOp) and _is_number(value.left) and _is_number(value.right)


def _comment(lines: list[str], first: int) -> str:
    """Return the comment above line `first`, empty if there is none."""
    found: list[str] = []
    for line in reversed(lines[: first - 1]):
        if not line.startswith("#"):
            break
        found.insert(0, line.lstrip("#: "))
    return " ".join(found)


def _beside(line: str) -> str:
    """Return the comment at the end of a line, empty if there is none."""
    return line.partition("  # ")[2]


def _docstring(body: list[ast.stmt], i: int) -> str:
    after = body[i + 1] if i + 1 < len(body) else None
    if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) and isinstance(after.value.value, str):
        return " ".join(after.value.value.split())
    return ""


def page() -> str:
    """Return the list of constants as a Markdown page."""
    parts = [HEAD]
    for title, folder in PACKAGES.items():
        rows = [f"| `{c.name}` | `{c.value}` | {c.unit} | {c.reason} | `{c.file}` |" for c in constants(ROOT / folder)]
        parts.append(
            "\n".join(
                [
                    f"## {title}\n",
                    "| name | value | unit | what and why | file |",
                    "| --- | --- | --- | --- | --- |",
                    *rows,
                ]
            )
        )
    return "\n".join([parts[0], "\n\n".join(parts[1:])]) + "\n"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page(), encoding="utf-8")
