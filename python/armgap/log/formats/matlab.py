"""MATLAB files as logs: up to version 7 through SciPy, version 7.3 as HDF5."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.log import guard
from armgap.log.findings import Finding
from armgap.log.formats import arrays, hdf5
from armgap.log.formats.format import Format, load, reading
from armgap.log.recording import Recording, Source

__all__ = ["FORMAT"]

#: Largest number of levels of nested MATLAB structures that are read.
_MAX_STRUCT_DEPTH = 8


def read(source: Source) -> Recording:
    """Read a MATLAB file as a recording."""
    if hdf5.SIGNATURE in source.head(1024):
        return hdf5.read(source)
    load("scipy.io", "formats", "MATLAB file", source.path)
    with reading("MATLAB file", source.path):
        held, left_out = guard.call("armgap.log.formats.matlab", "content", source)
    notes: tuple[Finding, ...] = ()
    if left_out:
        listed = ", ".join(f"`{name}`" for name in left_out[:8])
        notes = (Finding("columns", f"not read, no arrays of numbers: {listed}"),)
    return arrays.record(held, source.path, "MATLAB file", notes=notes)


def content(source: Source) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """Return a MATLAB file's arrays by path, fields of structures as ``name/field``, and the variables that were left out."""
    import scipy.io

    with source.open() as stream:
        loaded = scipy.io.loadmat(
            stream, struct_as_record=False, squeeze_me=False, verify_compressed_data_integrity=True
        )
    held: dict[str, NDArray[Any]] = {}
    left_out: list[str] = []
    for name, value in loaded.items():
        if not name.startswith("__"):
            for path, array in _walk(name, value, 0):
                if array is None:
                    left_out.append(path)
                else:
                    held[path] = array
    return held, left_out


def _walk(path: str, value: Any, depth: int) -> Iterator[tuple[str, NDArray[Any] | None]]:
    """Yield the arrays below a MATLAB value by path, None for values without numbers."""
    if isinstance(value, np.ndarray) and value.dtype == object and value.size == 1:
        value = value.reshape(-1)[0]
    fields = getattr(value, "_fieldnames", None)
    if fields is not None and depth < _MAX_STRUCT_DEPTH:
        for name in fields:
            yield from _walk(f"{path}/{name}", getattr(value, name), depth + 1)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
        yield path, value
    else:
        yield path, None


FORMAT = Format("MATLAB", (".mat",), read, lambda head: head.startswith(b"MATLAB "))
