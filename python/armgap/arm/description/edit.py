"""Edits of the text of an XML file that leave everything outside the changed elements as it is, to the byte."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

from armgap.arm.description.xml import Element
from armgap.errors import ModelFileError

__all__ = ["XmlText"]

_QUOTED = rb"(?:\"[^\"]*\"|'[^']*')"
_TAG = re.compile(rb"<[^\s/>]+(?:\s+[^\s=/>]+\s*=\s*" + _QUOTED + rb")*\s*/?>")

_ATTRIBUTE = re.compile(rb"\s([^\s=/>]+)\s*=\s*(" + _QUOTED + rb")")


class XmlText:
    """The text of an XML file, with changes to its elements.

    Parameters
    ----------
    data : bytes
        The file, as it was given to `armgap.arm.description.xml.parse`.
    path : Path
        Name of the file, for error messages.

    Raises
    ------
    ModelFileError
        If the file is encoded in UTF-16.
    """

    def __init__(self, data: bytes, path: Path) -> None:
        if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
            raise ModelFileError("is UTF-16", remedy="store it as UTF-8", file=path)
        self.data = data
        self._changes: list[tuple[int, int, bytes]] = []
        self._attributes: dict[int, tuple[Element, dict[str, str]]] = {}
        self._inside: dict[int, tuple[Element, list[str]]] = {}

    def set(self, element: Element, values: Mapping[str, str]) -> None:
        """Set attributes of an element; its other attributes stay."""
        self._attributes.setdefault(element.begins, (element, {}))[1].update(values)

    def replace(self, element: Element, text: str) -> None:
        """Replace an XML element of the robot description, from its opening to its closing tag, by lines of XML text."""
        begins, ends = self._span(element)
        self._changes.append((begins, ends, self._indented(text, self._indent(element))))

    def add(self, parent: Element, text: str) -> None:
        """Insert lines of text as the first content of an element."""
        self._inside.setdefault(parent.begins, (parent, []))[1].append(text)

    def render(self) -> bytes:
        """Return the edited file as bytes."""
        changes = list(self._changes)
        for begins in self._attributes.keys() | self._inside.keys():
            element = (self._attributes.get(begins) or self._inside[begins])[0]
            tag = self._tag(element)
            for name, value in self._attributes.get(begins, (element, {}))[1].items():
                tag = _with_attribute(tag, name, value)
            if begins in self._inside:
                indent = self._indent(element)
                inner = indent + b"  "
                lines = b"".join(b"\n" + inner + self._indented(text, inner) for text in self._inside[begins][1])
                closed = tag.endswith(b"/>")
                tag = (tag[:-2].rstrip() + b">" if closed else tag) + lines
                tag += b"\n" + indent + b"</" + element.tag.encode() + b">" if closed else b""
            changes.append((begins, begins + len(self._tag(element)), tag))
        text, at = [], 0
        for begins, ends, new in sorted(changes):
            text += [self.data[at:begins], new]
            at = ends
        return b"".join([*text, self.data[at:]])

    def _tag(self, element: Element) -> bytes:
        match = _TAG.match(self.data, element.begins)
        assert match is not None, "the parser found a tag here"
        return match[0]

    def _span(self, element: Element) -> tuple[int, int]:
        tag = self._tag(element)
        if tag.endswith(b"/>"):
            return element.begins, element.begins + len(tag)
        return element.begins, self.data.index(b">", element.ends) + 1

    def _indent(self, element: Element) -> bytes:
        line = self.data[: element.begins].rpartition(b"\n")[2]
        return line if not line.strip() else b""

    @staticmethod
    def _indented(text: str, indent: bytes) -> bytes:
        return text.encode("ascii", "xmlcharrefreplace").replace(b"\n", b"\n" + indent)


def _with_attribute(tag: bytes, name: str, value: str) -> bytes:
    given = quoteattr(value).encode("ascii", "xmlcharrefreplace")
    for match in _ATTRIBUTE.finditer(tag):
        if match[1] == name.encode():
            return tag[: match.start(2)] + given + tag[match.end(2) :]
    end = len(tag) - (2 if tag.endswith(b"/>") else 1)
    return tag[:end].rstrip() + b" " + name.encode() + b"=" + given + tag[end:]
