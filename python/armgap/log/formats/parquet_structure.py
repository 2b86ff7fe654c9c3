"""Check of a Parquet file's structure (footer and page headers) before the file is decoded.

The decoder trusts sizes and counts in page headers; overwritten ones make it ask for more memory than there is, which ends the whole
process before an error can be caught (about 1 in 6000 files with a few random bytes overwritten). So the structure is checked first: the
footer (Thrift compact protocol), and from there every page header. Sizes must lie within the file, values must add up to what the
footer says, and checksums must hold where there are any.

References
----------
Apache Parquet format, ``parquet.thrift``: FileMetaData, RowGroup, ColumnChunk, ColumnMetaData, PageHeader; Thrift compact protocol.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any, BinaryIO

from armgap.errors import LogReadError

__all__ = ["check"]

_TAIL = 8  # bytes at the end of a file: length of the footer, and marker bytes
_HEADER = 1 << 16  # largest size of a page header, bytes: usually tens of bytes, with statistics more
_MAX_THRIFT_DEPTH = 16  # largest depth of structures within structures: headers and footers have less than half of it
_MOST_ENTRIES = 1 << 22
_DATA_PAGE, _DATA_PAGE_V2 = 0, 3
# Field numbers of the Parquet metadata structures in parquet.thrift.
_NUM_ROWS, _ROW_GROUPS = 3, 4
_GROUP_COLUMNS, _GROUP_ROWS = 1, 3
_META = 3
_PATH, _NUM_VALUES, _CHUNK_SIZE, _DATA_OFFSET, _DICTIONARY_OFFSET = 3, 5, 7, 9, 11
_TYPE, _SIZE, _STORED_SIZE, _CRC = 1, 2, 3, 4
_VALUES_IN = {_DATA_PAGE: 5, _DATA_PAGE_V2: 8}


class _BrokenError(Exception):
    """Exception: the bytes do not form a valid Parquet structure."""


class _Thrift:
    """Reader of structures in the Thrift compact protocol, as dictionaries by field number."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def byte(self) -> int:
        if self.at >= len(self.data):
            raise _BrokenError("ends too early")
        self.at += 1
        return self.data[self.at - 1]

    def varint(self) -> int:
        value = shift = 0
        while shift < 70:
            byte = self.byte()
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value
            shift += 7
        raise _BrokenError("holds a number that never ends")

    def integer(self) -> int:
        value = self.varint()
        return (value >> 1) ^ -(value & 1)

    def binary(self) -> bytes:
        return self.fixed(self.varint())

    def fixed(self, size: int) -> bytes:
        if size > len(self.data) - self.at:
            raise _BrokenError("ends too early")
        self.at += size
        return self.data[self.at - size : self.at]

    def entries(self, depth: int) -> list[Any]:
        head = self.byte()
        size, kind = head >> 4, head & 0x0F
        size = self.varint() if size == 15 else size
        if size > _MOST_ENTRIES:
            raise _BrokenError(f"holds a list of {size} entries")
        # In lists, each Boolean value takes one byte.
        return [self.byte() if kind in (1, 2) else self.value(kind, depth + 1) for _ in range(size)]

    def pairs(self, depth: int) -> list[Any]:
        size = self.varint()
        if size > _MOST_ENTRIES:
            raise _BrokenError(f"holds a map of {size} entries")
        kinds = self.byte() if size else 0
        return [(self.value(kinds >> 4, depth + 1), self.value(kinds & 15, depth + 1)) for _ in range(size)]

    def value(self, kind: int, depth: int) -> Any:
        if depth > _MAX_THRIFT_DEPTH:
            raise _BrokenError("is nested too deeply")
        if kind in (1, 2):
            return kind == 1
        if kind == 3:
            return self.byte()
        if kind in (4, 5, 6):
            return self.integer()
        if kind == 7:
            return self.fixed(8)
        if kind == 8:
            return self.binary()
        if kind in (9, 10):
            return self.entries(depth)
        if kind == 11:
            return self.pairs(depth)
        if kind == 12:
            return self.structure(depth + 1)
        raise _BrokenError(f"holds a value of the unknown kind {kind}")

    def structure(self, depth: int = 0) -> dict[int, Any]:
        fields: dict[int, Any] = {}
        number = 0
        while True:
            head = self.byte()
            if head == 0:
                return fields
            number = number + (head >> 4) if head >> 4 else self.integer()
            fields[number] = self.value(head & 0x0F, depth)


def check(stream: BinaryIO, path: Path) -> None:
    """Raise `LogReadError` unless all pages lie within the file and hold as many rows as the footer says."""
    try:
        footer, end = _footer(stream)
        for number, group in enumerate(_list(footer, _ROW_GROUPS), start=1):
            for chunk in _list(group, _GROUP_COLUMNS):
                _chunk(stream, end, chunk, f"row group {number}")
        rows = sum(_count(group, _GROUP_ROWS) for group in _list(footer, _ROW_GROUPS))
        if rows != _count(footer, _NUM_ROWS):
            raise _BrokenError(f"row groups hold {rows} rows, the footer says {footer.get(_NUM_ROWS)}")
    except _BrokenError as broken:
        raise LogReadError(
            f"is a damaged Parquet file ({broken})", remedy="copy or write it again", file=path
        ) from None


def _footer(stream: BinaryIO) -> tuple[dict[int, Any], int]:
    """Return the footer of a Parquet file, and the offset at which the data end."""
    size = stream.seek(0, 2)
    stream.seek(size - _TAIL)
    (length,) = struct.unpack("<I", stream.read(4))
    end = size - _TAIL - length
    if end < 4:
        raise _BrokenError("the footer is longer than the file")
    stream.seek(end)
    try:
        return _Thrift(stream.read(length)).structure(), end
    except _BrokenError as broken:
        raise _BrokenError(f"the footer {broken}") from None


def _chunk(stream: BinaryIO, end: int, chunk: Any, place: str) -> None:
    """Check the pages of one column in one row group of a Parquet file."""
    meta = chunk.get(_META) if isinstance(chunk, dict) else None
    if not isinstance(meta, dict):
        raise _BrokenError(f"{place}: a column has no description")
    names = [part.decode("utf-8", "replace") for part in _list(meta, _PATH) if isinstance(part, bytes)]
    place = f"{place}, column `{'.'.join(names)[:80]}`"
    starts = [_count(meta, key) for key in (_DATA_OFFSET, _DICTIONARY_OFFSET) if meta.get(key)]
    if not starts:
        raise _BrokenError(f"{place}: has no place in the file")
    at, stop = min(starts), min(starts) + _count(meta, _CHUNK_SIZE)
    if stop > end:
        raise _BrokenError(f"{place}: reaches beyond its data")
    expected, found = _count(meta, _NUM_VALUES), 0
    while at < stop and found < expected:
        values, at = _page(stream, at, stop, place)
        found += values
    if found != expected:
        raise _BrokenError(f"{place}: pages hold {found} values, the footer says {expected}")


def _page(stream: BinaryIO, at: int, stop: int, place: str) -> tuple[int, int]:
    """Return the number of values of a Parquet page, and the offset at which the page ends."""
    stream.seek(at)
    thrift = _Thrift(stream.read(min(_HEADER, stop - at)))
    try:
        header = thrift.structure()
        stored = _count(header, _STORED_SIZE)
        _count(header, _SIZE)
        kind = _count(header, _TYPE)
        inner = header.get(_VALUES_IN.get(kind, -1), {})
        values = _count(inner, 1) if kind in _VALUES_IN else 0
    except _BrokenError as broken:
        raise _BrokenError(f"{place}: the page at byte {at} {broken}") from None
    data = at + thrift.at
    if data + stored > stop:
        raise _BrokenError(f"{place}: the page at byte {at} reaches beyond its column")
    if _CRC in header:
        stream.seek(data)
        if zlib.crc32(stream.read(stored)) != header[_CRC] & 0xFFFFFFFF:
            raise _BrokenError(f"{place}: the page at byte {at} does not match its checksum")
    return values, data + stored


def _list(structure: Any, key: int) -> list[Any]:
    value = structure.get(key) if isinstance(structure, dict) else None
    if not isinstance(value, list):
        raise _BrokenError("lacks a list that must be there")
    return value


def _count(structure: Any, key: int) -> int:
    value = structure.get(key) if isinstance(structure, dict) else None
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise _BrokenError("lacks a number that must be there")
    return value
