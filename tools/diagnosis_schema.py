"""Write the JSON Schema of a diagnosis from its types: python tools/diagnosis_schema.py docs/reference/diagnosis.schema.json."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from armgap.diagnosis import diagnosis_schema


def text() -> str:
    """Return the JSON Schema of a diagnosis as the text of its file."""
    return json.dumps(diagnosis_schema(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(text(), encoding="utf-8")
