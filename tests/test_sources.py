"""Rules for source files that no linter knows."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: Lines of a file at most.
MOST_LINES = 500
PACKAGE = ROOT / "python" / "armgap"
#: Modules and folders of the package in the order of the data, after what all use.
ORDER = (
    *(
        "_native",
        "_renamed",
        "errors",
        "literals",
        "options",
        "files",
        "progress",
        "workers",
        "several_joints",
        "remainder",
    ),
    *("log", "arm", "simulation", "check", "estimation", "evidence", "diagnosis", "export", "report"),
    *("inspection", "planning", "fleet", "reproduction", "trial", "cli", "own", "__main__"),
)
#: What shows itself in a notebook or as text, by reports; and an entry point, which is a command.
ALLOWED = {
    ("arm/arm.py", "report"),
    ("diagnosis/result.py", "report"),
    ("log/log.py", "report"),
    ("trial/__main__.py", "cli"),
}
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


def _imports(tree: ast.AST) -> Iterator[tuple[str, str]]:
    """Modules and names that a source imports from the package, but for those that only types need."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "armgap":
            yield from ((node.module or "", alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names if alias.name.split(".")[0] == "armgap")
        elif not (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)):
            yield from _imports(node)


def _package(path: Path) -> list[tuple[str, str, str]]:
    """What a file of the package imports: the file, the module, the name or submodule."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [(path.relative_to(PACKAGE).as_posix(), *found) for found in _imports(tree)]


IMPORTS = [
    found for path in sorted(PACKAGE.rglob("*.py")) if path != PACKAGE / "__init__.py" for found in _package(path)
]


def test_every_module_has_its_place_in_the_order() -> None:
    found = {path.stem for path in PACKAGE.glob("*.py*")} | {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert found - {"__init__", "py", "_native.abi3"} == set(ORDER)


def test_no_package_uses_a_later_one() -> None:
    assert len(IMPORTS) > 1000
    later = set()
    for file, module, name in IMPORTS:
        place, used = file.split("/")[0].removesuffix(".py"), f"{module}.{name}".split(".")[1]
        if ORDER.index(used) > ORDER.index(place):
            later.add((file, used))
    assert later == ALLOWED


def test_an_init_hands_names_on_and_nothing_imports_them_from_there() -> None:
    def is_init(module: str, name: str) -> bool:
        folder = PACKAGE.joinpath(*module.split(".")[1:])
        return (folder / "__init__.py").is_file() and not any(folder.glob(f"{name}.*")) and not (folder / name).is_dir()

    assert [(file, module, name) for file, module, name in IMPORTS if is_init(module, name)] == []
