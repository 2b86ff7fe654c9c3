"""The output-error fit of `fit.rs` by scipy around the plain C rollout: differences of the parameters, and time.

cargo run --release -p armgap-benches --bin fit -- problem.json
python benches/baselines/output_error.py problem.json
"""

from __future__ import annotations

import ctypes
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

HERE = Path(__file__).parent
#: Relative step of forward differences, as in armgap's fit; scipy's default of 1.5e-8 is too short, as events are located to 1e-10 only.
STEP = 1e-6


def library(folder: str) -> Any:
    """Function ``baseline_rollout`` of ``rollout.c``, compiled as a shared library in ``folder``."""
    built = Path(folder) / "rollout.so"
    subprocess.run(["cc", "-O3", "-shared", "-fPIC", "-o", built, HERE / "rollout.c", "-lm"], check=True)
    function = ctypes.CDLL(str(built)).baseline_rollout
    function.restype = None
    return function


def pointer(x: NDArray[np.float64]) -> Any:
    """Address of an array of doubles, for C."""
    return x.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def main(path: str) -> None:
    """Fit the problem of a JSON file by scipy and print the comparison with armgap."""
    problem = json.loads(Path(path).read_text())
    q, tau = (np.array(problem[name]).reshape(-1, 2) for name in ("q", "tau"))
    first, ours = np.array(problem["first"]), np.array(problem["theta"])
    windows = [(int(a), int(b), np.array(x)) for a, b, *x in problem["windows"]]
    measured = np.concatenate([q[a + 1 : b + 1] for a, b, _ in windows])
    with tempfile.TemporaryDirectory() as folder:
        rollout = library(folder)
        predicted = np.empty_like(measured)

        def residual(scaled: NDArray[np.float64]) -> NDArray[np.float64]:
            theta, offset = np.ascontiguousarray(scaled * first), 0
            for a, b, x in windows:
                out = predicted[offset : offset + b - a]
                rollout(
                    pointer(theta),
                    pointer(x),
                    pointer(np.ascontiguousarray(tau[a:b])),
                    ctypes.c_double(problem["h"]),
                    ctypes.c_long(b - a),
                    pointer(out),
                )
                offset += b - a
            return (predicted - measured).ravel()

        times = []
        for _ in range(5):
            start = time.perf_counter()
            fit = least_squares(residual, np.ones_like(first), diff_step=STEP, xtol=1e-10, ftol=1e-14, gtol=1e-14)
            times.append(1e3 * (time.perf_counter() - start))
    theirs = fit.x * first
    sigma = np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)) * 2 * fit.cost / (measured.size - 9)) * first
    took = np.median(times)
    print("| fit | time | times ours | RMS error | parameters differ |")
    print("| --- | --- | --- | --- | --- |")
    rms = np.sqrt(np.mean(residual(ours / first) ** 2))
    print(f"| armgap | {problem['ms']:.1f} ms | 1 | {rms:.6e} rad | |")
    rms = np.sqrt(2 * fit.cost / measured.size)
    apart = f"{np.max(np.abs(ours - theirs) / sigma):.0e} sigma, {np.max(np.abs(ours / theirs - 1)):.0e} relative"
    print(f"| scipy least_squares, C rollouts | {took:.0f} ms | {took / problem['ms']:.0f} | {rms:.6e} rad | {apart} |")


if __name__ == "__main__":
    main(sys.argv[1])
