"""Check of a wheel in a fresh virtual environment without Rust: the first commands of a user work, and importing is fast.

Usage: python check_wheel.py WHEEL
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

#: Longest time for importing everything that a script needs, s.
LONGEST_IMPORT_S = 0.6
IMPORTS = ("import armgap", "from armgap import Arm, Log, diagnose, identify, simulate", "import armgap.cli")
REPEATS = 5


def main(wheel: str) -> None:
    """Install the wheel, use it, and print the results; end with status 1 at the first failure."""
    with tempfile.TemporaryDirectory(prefix="armgap-wheel-") as scratch:
        home = Path(scratch)
        venv.create(home / "venv", with_pip=True)
        python = home / "venv" / "bin" / "python"
        run(home, python, "-m", "pip", "install", "-q", "--disable-pip-version-check", Path(wheel).resolve())
        check_commands(home, python)
        for statement in IMPORTS:
            check_import(home, python, statement)
    print("wheel: all right")


def run(home: Path, *words: object) -> subprocess.CompletedProcess[str]:
    """Run a command in an environment in which neither Rust nor the source tree is found."""
    environment = {"PATH": f"{home / 'venv' / 'bin'}:/usr/bin:/bin", "HOME": str(home), "NO_COLOR": "1"}
    kept = {k: v for k, v in os.environ.items() if k.lower().endswith("_proxy") or k.startswith(("PIP_", "SSL_"))}
    done = subprocess.run(
        [str(w) for w in words], cwd=home, env=environment | kept, capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(f"{' '.join(map(str, words))}: status {done.returncode}\n{done.stdout}{done.stderr}")
    return done


def check_commands(home: Path, python: Path) -> None:
    """Check that demo, diagnosis and export work with the files that the wheel contains."""
    where = run(home, python, "-c", "import armgap; print(armgap.__file__)").stdout.strip()
    assert where.startswith(str(home)), f"another armgap was imported: {where}"
    armgap, case = home / "venv" / "bin" / "armgap", Path(where).parent / "demo_case"
    demo = run(home, armgap, "demo").stdout
    assert "the answer was right" in " ".join(demo.split()), demo
    logs = (case / "train-1.parquet", "--arm", case / "arm.toml", "--holdout", case / "holdout-1.parquet")
    run(home, armgap, "diagnose", *logs, "--json", "gap.json", "--report", "gap.html")
    assert json.loads((home / "gap.json").read_text())["verdict"] == "effect"
    assert (home / "gap.html").read_text().startswith("<!")
    run(home, armgap, "export", "gap.json", "--arm", case / "arm.toml", "-o", "arm.xml")
    assert "<mujoco" in (home / "arm.xml").read_text()
    print("wheel: demo, diagnose and export work")


def check_import(home: Path, python: Path, statement: str) -> None:
    """Check the shortest of several import times (``-X importtime``) of a statement, so that other load on the machine has less influence."""
    seconds = min(import_time(run(home, python, "-X", "importtime", "-c", statement).stderr) for _ in range(REPEATS))
    assert seconds < LONGEST_IMPORT_S, f"`{statement}` takes {seconds:.2f} s, more than {LONGEST_IMPORT_S} s"
    print(f"wheel: `{statement}` takes {seconds:.3f} s")


def import_time(text: str) -> float:
    """Return the sum of the modules' own import times [s] in the output of ``-X importtime``."""
    return sum(int(own) for own in re.findall(r"^import time: +(\d+) \|", text, re.MULTILINE)) / 1e6


if __name__ == "__main__":
    main(sys.argv[1])
