"""XML of robot descriptions, read without namespaces: undeclared prefixes are part of the name, line numbers are kept for error messages."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from armgap.errors import ModelFileError
from armgap.files.reading import read_bounded

__all__ = ["Element", "parse", "read_text"]

_MAX_DESCRIPTION_BYTES = 64 * 2**20
"""Largest accepted size of a description's file, bytes: tens of times the size of descriptions that contain collision shapes."""


@dataclass
class Element:
    """One XML element: name with prefix, attributes, child elements, text, line, and the byte offsets of its start and of its end tag."""

    tag: str
    attributes: dict[str, str]
    row: int
    children: list[Element] = field(default_factory=list)
    text: str = ""
    begins: int = 0
    ends: int = 0

    def first(self, tag: str) -> Element | None:
        """Return the first child element with the name `tag`; None if there is none."""
        return next(self.all(tag), None)

    def all(self, tag: str) -> Iterator[Element]:
        """Return all child elements with the name `tag`."""
        return (child for child in self.children if child.tag == tag)


def read_text(path: Path) -> bytes:
    """Return the bytes of a description's file.

    Raises
    ------
    ModelFileError
        If the file cannot be read.
    """
    try:
        return read_bounded(path, _MAX_DESCRIPTION_BYTES)
    except OSError as error:
        reason = error.strerror or str(error)
        raise ModelFileError(
            f"cannot be read ({reason})", remedy="give the path of a URDF or MJCF file", file=path
        ) from None
    except ValueError:
        raise ModelFileError("is no name of a file", remedy="give the path of a URDF or MJCF file", file=path) from None


def parse(data: bytes, path: Path) -> Element:
    """Parse XML and return the root element.

    Raises
    ------
    ModelFileError
        If the data are not XML, or declare entities; the message names the line.
    """
    top = Element("", {}, 0)
    stack = [top]
    parser = expat.ParserCreate()

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, attributes, parser.CurrentLineNumber, begins=parser.CurrentByteIndex)
        stack[-1].children.append(element)
        stack.append(element)

    def end(_: str) -> None:
        stack.pop().ends = parser.CurrentByteIndex

    def text(data: str) -> None:
        stack[-1].text += data

    def entity(*_: object) -> None:
        remedy = "write entities out, for example with xmllint --noent --dropdtd"
        raise ModelFileError("declares an entity", remedy=remedy, file=path, row=parser.CurrentLineNumber)

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.EntityDeclHandler = text, entity
    parser.buffer_text = True
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        problem = f"is not valid XML: {expat.ErrorString(error.code)}"
        raise ModelFileError(problem, remedy="correct that line", file=path, row=error.lineno) from None
    except ModelFileError:
        raise
    except (LookupError, ValueError) as error:  # an unknown encoding
        raise ModelFileError(f"cannot be read as text ({error})", remedy="store it as UTF-8", file=path) from None
    return top.children[0]
