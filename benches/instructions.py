"""Instructions per sample, counted by valgrind: median, extremes, and the share of samples within 10 % of the median."""

from __future__ import annotations

import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

SAMPLES = 600
SCHEMES = ("filtered-dynamic", "supplied-energy", "filtered-power")


def counts(program: str, *case: str) -> list[int]:
    """Instructions of each call of ``one_sample``; the first three, in which an estimator starts, are left out."""
    with tempfile.TemporaryDirectory() as folder:
        tool = [
            "valgrind",
            "--tool=callgrind",
            "--toggle-collect=instructions::one_sample",
            "--dump-after=instructions::one_sample",
        ]
        out = Path(folder) / "out"
        subprocess.run(
            [*tool, f"--callgrind-out-file={out}", program, *case, str(SAMPLES)], check=True, capture_output=True
        )
        totals = []
        for number in range(1, SAMPLES + 1):
            text = Path(f"{out}.{number}").read_text()
            totals.append(int(re.findall(r"^(?:summary|totals): (\d+)", text, re.MULTILINE)[-1]))
    return totals[3:]


def main() -> None:
    if shutil.which("valgrind") is None:
        print("skipped: valgrind is not installed")
        return
    print(
        "| scheme | filters | form | median | least | most | within 10 % |\n| --- | --- | --- | --- | --- | --- | --- |"
    )
    for scheme in SCHEMES:
        for filters in ("paper", "exact"):
            for form in ("plain", "factorized"):
                n = counts(sys.argv[1], scheme, filters, form)
                middle = statistics.median(n)
                within = sum(abs(x / middle - 1) <= 0.1 for x in n) / len(n)
                print(
                    f"| {scheme} | {filters} | {form} | {middle:.0f} | {min(n)} | {max(n)} | {within:.1%} |", flush=True
                )


if __name__ == "__main__":
    main()
