"""Write docs/conventions.svg: sketch of zero position, positive direction, elbow angle, sign of torque and gravity for each kind of arm."""

from __future__ import annotations

from pathlib import Path

from armgap.report.sketch import sheet

if __name__ == "__main__":
    (Path(__file__).resolve().parents[1] / "docs" / "conventions.svg").write_text(sheet(), encoding="utf-8")
