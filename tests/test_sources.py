"""Rules for source files that no linter knows."""

from __future__ import annotations

import re
from collections.abc import Iterator
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


def _modules(source: Path) -> list[str]:
    """Modules of a crate in the order of its `lib.rs`, which is that of the data."""
    return re.findall(r"^(?:pub )?mod (\w+);", (source / "lib.rs").read_text(encoding="utf-8"), re.MULTILINE)


def _backward(texts: dict[str, str], order: list[str]) -> Iterator[str]:
    """Uses of a later module: paths, and methods that later modules add to the context of a diagnosis."""
    place = {file: order.index(Path(file).parts[0].removesuffix(".rs")) for file in texts}
    home: dict[str, int] = {}
    for file, text in texts.items():
        for block in re.findall(r"^impl<[^\n]*> DiagnosisContext<.*?^}", text, re.MULTILINE | re.DOTALL):
            home |= dict.fromkeys(re.findall(r"^    (?:pub[^ ]* )?fn (\w+)", block, re.MULTILINE), place[file])
    for file, text in texts.items():
        for used in sorted(set(re.findall(r"\bcrate::(\w+)", text))):
            if used in order and order.index(used) > place[file]:
                yield f"{file} uses {used}"
        for used in sorted(set(re.findall(r"\b(?:self|context)\s*\.(\w+)\(", text))):
            if home.get(used, -1) > place[file] and f"fn {used}(" not in text and f"fn {used}<" not in text:
                yield f"{file} calls {used}, of {order[home[used]]}"


def test_no_folder_uses_a_later_one() -> None:
    """In the crate of the diagnosis, whose folders are in the order of the data."""
    source = ROOT / "rust" / "fit" / "src"
    texts = {path.relative_to(source).as_posix(): path.read_text(encoding="utf-8") for path in source.rglob("*.rs")}
    del texts["lib.rs"]
    assert list(_backward(texts, _modules(source))) == []


def test_a_backward_use_is_found() -> None:
    late = "impl<A: Arm, const N: usize> DiagnosisContext<A, N> {\n    pub(crate) fn found(&self) {}\n}\n"
    texts = {
        "log/a.rs": "use crate::search::b;\n",
        "log/c.rs": "let x = self.found();\n",
        "search/b.rs": "use crate::log::a;\n" + late,
    }
    expected = ["log/a.rs uses search", "log/c.rs calls found, of search"]
    assert list(_backward(texts, ["log", "search"])) == expected
