"""Write docs/conventions.svg: the sketch of each kind's zero, positive direction, elbow angle, sign of the torque and gravity."""

from __future__ import annotations

from pathlib import Path

from armgap.report.sketch import sheet

if __name__ == "__main__":
    (Path(__file__).resolve().parents[1] / "docs" / "conventions.svg").write_text(sheet(), encoding="utf-8")
