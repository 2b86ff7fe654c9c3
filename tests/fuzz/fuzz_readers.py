"""Coverage-guided fuzzing of the log readers that run in this process; needs `pip install atheris`.

    python tests/fuzz/fuzz_readers.py FOLDER -max_total_time=600

FOLDER holds the corpus; it is filled with one small log per format when it is empty. HDF5 and MATLAB files are read in a process apart,
which coverage does not reach into: `tests/test_log_damaged.py` covers them.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import atheris

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

with atheris.instrument_imports(include=["armgap", "mcap", "mcap_ros2", "rosbags"]):
    from armgap import Log
    from armgap.errors import ArmgapError
    from damaged import small_log
    from log_files import WRITERS

SCRATCH = Path(tempfile.mkdtemp()) / "log"
ENDINGS = {b"PAR1": ".parquet", b"PK\x03\x04": ".npz", b"\x89MCA": ".mcap", b"SQLi": ".db3"}


def one(data: bytes) -> None:
    """Read some bytes as the format that they look like; anything but a log or an error of ours is a finding."""
    if data[:4] == b"\x89HDF" or data.startswith(b"MATLAB"):
        return
    path = SCRATCH.with_suffix(ENDINGS.get(data[:4], ".csv"))
    path.write_bytes(data)
    try:
        Log.read(path)
    except ArmgapError as error:
        if path.name not in str(error) or "\n" in str(error):
            raise AssertionError(str(error)) from error


def corpus(folder: Path) -> None:
    """Write one small log per format into an empty folder."""
    folder.mkdir(parents=True, exist_ok=True)
    if any(folder.iterdir()):
        return
    for name in ("Parquet", "CSV", "NumPy", "MCAP"):
        (folder / name).write_bytes(WRITERS[name](small_log(), SCRATCH.parent / "seed").read_bytes())
    bag = WRITERS["ROS 2 bag"](small_log(), SCRATCH.parent / "bag")
    (folder / "bag").write_bytes(next(bag.glob("*.db3")).read_bytes())


if __name__ == "__main__":
    corpus(Path(sys.argv[1]))
    atheris.Setup(sys.argv, one)
    atheris.Fuzz()
