"""NumPy archives as logs: ``t`` (n,), ``q`` and ``tau`` (n, n_joints), or one array per column."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.log.findings import Finding
from armgap.log.formats import arrays
from armgap.log.formats.format import Format, reading
from armgap.log.recording import Recording, Source

__all__ = ["FORMAT"]


def read(source: Source) -> Recording:
    """Read a NumPy archive as a recording; pickled objects are never loaded."""
    held: dict[str, NDArray[Any]] = {}
    left_out = []
    with reading("NumPy archive", source.path), source.open() as stream, np.load(stream, allow_pickle=False) as archive:
        for name in archive.files:
            try:
                held[name] = np.asarray(archive[name])
            except ValueError as error:
                if "allow_pickle" not in str(error):
                    raise
                left_out.append(f"`{name}`")
    notes = (Finding("columns", f"not read, Python objects: {', '.join(left_out[:8])}"),) if left_out else ()
    return arrays.record(held, source.path, "NumPy archive", notes=notes)


FORMAT = Format("NumPy", (".npz",), read, lambda head: head[:4] == b"PK\x03\x04")
