"""HDF5 files as logs: any data sets of numbers, in groups or not; MATLAB files of version 7.3 are HDF5 files too."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.log import guard
from armgap.log.conversion.spellings import is_foreign, unit_of
from armgap.log.findings import Finding
from armgap.log.formats import arrays
from armgap.log.formats.format import Format, load, reading
from armgap.log.recording import Recording, Source

__all__ = ["FORMAT", "SIGNATURE", "read"]

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_UNIT_ATTRIBUTES = ("unit", "units", "Unit", "Units")
Held = tuple[dict[str, NDArray[Any]], dict[str, str], list[str]]


def read(source: Source) -> Recording:
    """Read an HDF5 file as a recording."""
    load("h5py", "formats", "HDF5 file", source.path)
    with reading("HDF5 file", source.path):
        held, units, left_out = guard.call("armgap.log.formats.hdf5", "content", source)
    notes = (Finding("columns", f"not read, no numbers: {', '.join(left_out[:8])}"),) if left_out else ()
    return arrays.record(held, source.path, "HDF5 file", units, notes)


def content(source: Source) -> Held:
    """Return an HDF5 file's arrays by path, their units by path, and the data sets that were left out."""
    import h5py

    held: dict[str, NDArray[Any]] = {}
    units: dict[str, str] = {}
    left_out: list[str] = []

    def visit(name: str, item: Any) -> None:
        # MATLAB stores the contents of its cells and objects in groups whose names start with a hash sign.
        if not isinstance(item, h5py.Dataset) or name.startswith("#"):
            return
        matlab = item.attrs.get("MATLAB_class")
        if item.dtype.kind not in "fiubV" or matlab in (b"char", b"cell") or item.shape is None:
            left_out.append(f"`{name}`")
            return
        array = np.asarray(item[()])
        held[name] = array.T if matlab is not None else array  # MATLAB stores arrays in column-major order
        for attribute in _UNIT_ATTRIBUTES:
            text = _text(item.attrs.get(attribute))
            if unit := unit_of(text) or (text if is_foreign(text) else None):
                units[name] = unit

    with source.open() as stream, h5py.File(stream, "r") as file:
        file.visititems(visit)
    return held, units, left_out


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value or "")


FORMAT = Format("HDF5", (".h5", ".hdf5", ".hdf"), read, lambda head: head.startswith(SIGNATURE))
