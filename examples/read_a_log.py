"""Read a log with its own names and units, and see what armgap noticed."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from armgap import Log

t_ms = np.arange(0, 4000, 4)
angle_deg = 30 * np.sin(0.002 * t_ms)
torque = 0.4 * np.cos(0.002 * t_ms)

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "bench.csv"
    rows = np.column_stack([t_ms, angle_deg, torque])
    np.savetxt(path, np.delete(rows, slice(500, 510), axis=0), delimiter=",", header="stamp,angle,torque", comments="")
    log = Log.read(path, {"t": "stamp", "q1": "angle", "tau1": "torque"}, units={"t": "ms", "q": "deg"})

print(f"{log.name}: {len(log)} samples, {log.duration:.2f} s, every {1e3 * log.sample_period:g} ms")
for finding in log.findings:
    print(f"{finding.kind}: {finding.message}")
