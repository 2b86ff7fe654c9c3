"""Code blocks of documents: they are found, run, and the output that a document shows is compared with the real output."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
from dataclasses import dataclass
from pathlib import Path

from armgap.cli import main

#: Largest relative difference between a number that a document shows and the real one; words must be equal.
RELATIVE = 0.1
NUMBER = r"(?<![\w.])\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w])"


@dataclass(frozen=True)
class Block:
    """One fenced code block of a document."""

    language: str
    title: str | None
    text: str
    line: int


def blocks(document: Path) -> list[Block]:
    """Return all fenced code blocks of a document, in order."""
    text = document.read_text(encoding="utf-8")
    found = []
    for match in re.finditer(r"^```(\w+)([^\n]*)\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        title = re.search(r'title="([^"]+)"', match[2])
        line = text.count("\n", 0, match.start()) + 1
        found.append(Block(match[1], title[1] if title else None, match[3], line))
    return found


def commands(block: Block) -> list[tuple[list[str], str]]:
    """Return the words of each ``armgap`` command of a shell block, with the output that is shown below it."""
    prompt = "$ " if block.language == "console" else ""
    found: list[tuple[list[str], str]] = []
    for line in block.text.replace("\\\n", " ").splitlines():
        if line.startswith(f"{prompt}armgap "):
            found.append((shlex.split(line.removeprefix(prompt), comments=True), ""))
        elif block.language == "console" and found:
            found[-1] = (found[-1][0], found[-1][1] + line + "\n")
    return found


def run(block: Block, names: dict[str, object]) -> None:
    """Run a code block in the working directory; raise if its output is not the one that the document shows."""
    if block.title is not None:
        Path(block.title).write_text(block.text, encoding="utf-8")
    if block.language == "python":
        with contextlib.redirect_stdout(io.StringIO()):
            exec(compile(block.text, f"block in line {block.line}", "exec"), names)
    if block.language in ("sh", "console"):
        for words, shown in commands(block):
            status, out = call(words[1:])
            expected = 2 if shown.startswith("armgap: ") else 0
            assert status == expected, (words, out)
            assert agrees(shown, out), f"shown:\n{shown}\nreal:\n{out}"


def call(words: list[str]) -> tuple[int, str]:
    """Run the command line in this process; return its status and everything it wrote."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        try:
            main(words)
        except SystemExit as stop:
            return int(stop.code or 0), out.getvalue()
    raise AssertionError("the command line did not end")


def agrees(shown: str, real: str) -> bool:
    """Return whether a shown text occurs in the real one, up to white space, parts left out as ``…``, and small changes of numbers."""
    pieces = [" ".join(piece.split()) for piece in shown.split("…")]
    pattern = r".*?".join(_numbers_open(piece) for piece in pieces)
    match = re.search(pattern, " ".join(real.split()), re.DOTALL)
    if match is None:
        return False
    stated = [float(x) for piece in pieces for x in re.findall(NUMBER, piece)]
    return all(abs(a - float(b)) <= RELATIVE * abs(a) + 1e-12 for a, b in zip(stated, match.groups(), strict=True))


def _numbers_open(piece: str) -> str:
    """Return a regular expression for a piece of text in which every number may have another value."""
    words = re.split(NUMBER, piece)
    return f"({NUMBER})".join(re.escape(word) for word in words)
