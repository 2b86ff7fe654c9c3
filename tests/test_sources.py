"""Rules for source files that no linter knows."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[1]
#: Lines of a file at most.
MOST_LINES = 500
FOLDERS = ("python", "rust", "tests", "tools", "examples", "benches")
ENDINGS = ("py", "pyi", "rs", "html", "js", "css")


def test_no_file_is_too_long() -> None:
    found = {
        path.relative_to(ROOT): path.read_text(encoding="utf-8").count("\n")
        for folder in FOLDERS
        for ending in ENDINGS
        for path in (ROOT / folder).rglob(f"*.{ending}")
        if "target" not in path.parts
    }
    assert {path.parts[0] for path in found} == set(FOLDERS)
    assert {str(path): lines for path, lines in found.items() if lines > MOST_LINES} == {}, "split by concepts"
