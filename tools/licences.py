"""List the licences of everything that the wheel and the C library are built from, and of what the wheel installs.

Usage: python tools/licences.py [docs/licences.md]
"""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib.metadata import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HEAD = """\
# Licences

armgap is under the MIT licence. What the wheel and the C library are built from, by `cargo tree`, and what the wheel installs, from the packages' own
metadata; written by `tools/licences.py`.
"""


def main(words: list[str]) -> None:
    """Print the page of licences, or write it to the file that `words` name."""
    text = f"{HEAD}\n## Crates\n\n{_table(crates())}\n\n## Python packages\n\n{_table(packages())}\n"
    if words:
        Path(words[0]).write_text(text, encoding="utf-8")
    else:
        print(text, end="")


def crates() -> list[tuple[str, str, str]]:
    """Return name, version and licence of every crate that is linked into the wheel or the C library."""
    command = [
        "cargo",
        "tree",
        "-p",
        "armgap-py",
        "-p",
        "armgap-capi",
        "-e",
        "normal,build",
        "--prefix",
        "none",
        "--target",
        "all",
    ]
    out = subprocess.run([*command, "--format", "{p}|{l}"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    found = set()
    for line in filter(None, out.splitlines()):
        package, _, licence = line.removesuffix(" (*)").partition("|")
        name, version = package.split()[:2]
        if not name.startswith("armgap"):
            found.add((name, version.removeprefix("v"), licence.replace("/", " OR ")))
    return sorted(found)


def packages() -> list[tuple[str, str, str]]:
    """Return name, least version and licence of every Python package that the wheel requires."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    found = []
    for requirement in project["dependencies"]:
        name, version = re.split(r"(?=>=)", requirement)
        about = metadata(name)
        classifiers = [c.rpartition(" :: ")[2] for c in about.get_all("Classifier") or [] if c.startswith("License")]
        licence = (
            about.get("License-Expression") or ", ".join(classifiers) or (about.get("License") or "").splitlines()[0]
        )
        found.append((name, version, licence))
    return found


def _table(rows: list[tuple[str, str, str]]) -> str:
    return "\n".join(
        ["| name | version | licence |", "| --- | --- | --- |", *(f"| {a} | {b} | {c} |" for a, b, c in rows)]
    )


if __name__ == "__main__":
    main(sys.argv[1:])
