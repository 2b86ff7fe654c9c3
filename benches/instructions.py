"""Instructions per sample of online estimators: median, extremes, and the share of samples within 10 % of the median.

In code for any processor instructions are counted by valgrind, which does not know every instruction of newer processors. In code for
this machine's processor they are counted by single steps, as in a debugger, from the first call of ``one_sample`` on.
"""

from __future__ import annotations

import ctypes
import itertools
import os
import platform
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

VALGRIND_SAMPLES, STEP_SAMPLES = 600, 200
# Number of first samples that are left out, as the estimator does not update in each of these.
START = 3
SCHEMES = ("filtered-dynamic", "supplied-energy", "filtered-power")
FORMS = ("plain", "factorized")
# Arm, scheme, filters and form of the covariance of each measured estimator.
CASES = [
    *itertools.product(["two-link"], SCHEMES, ["paper", "exact"], FORMS),
    *itertools.product(["serial"], SCHEMES, ["exact"], FORMS),
]
TRACE_ME, PEEK, PEEK_USER, POKE, POKE_USER, CONTINUE, STEP = 0, 1, 3, 4, 6, 7, 9
# Offsets of the registers RIP and RSP in the structure of <sys/user.h>, x86-64, bytes.
RIP, RSP = 16 * 8, 19 * 8
BREAKPOINT = 0xCC

_ptrace = ctypes.CDLL(None, use_errno=True).ptrace
_ptrace.restype = ctypes.c_long
_ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]


def ask(request: int, pid: int, address: int = 0, data: int = 0) -> int:
    """Make one ptrace request to the kernel; an error if it refuses."""
    ctypes.set_errno(0)
    answer = int(_ptrace(request, pid, address, data))
    if ctypes.get_errno():
        raise OSError(ctypes.get_errno(), f"ptrace {request}: {os.strerror(ctypes.get_errno())}")
    return answer & (2**64 - 1)


def wait(pid: int) -> None:
    """Wait for the next stop of the traced program, which must be a trap."""
    _, status = os.waitpid(pid, 0)
    if not os.WIFSTOPPED(status) or os.WSTOPSIG(status) != signal.SIGTRAP:
        raise RuntimeError(f"the program ended or stopped by itself: status {status:#x}")


def offset(program: str) -> int:
    """Offset of the function ``one_sample`` in the program's file [bytes]."""
    for line in subprocess.run(["nm", program], check=True, capture_output=True, text=True).stdout.splitlines():
        if re.search(r"instructions.*one_sample", line):
            return int(line.split()[0], 16)
    raise RuntimeError(f"{program} has no function one_sample")


def by_valgrind(program: str, *case: str) -> list[int]:
    """Instructions of each call of ``one_sample`` in code for any processor, by valgrind."""
    with tempfile.TemporaryDirectory() as folder:
        tool = [
            "valgrind",
            "--tool=callgrind",
            "--toggle-collect=instructions::one_sample",
            "--dump-after=instructions::one_sample",
        ]
        out, samples = Path(folder) / "out", str(VALGRIND_SAMPLES)
        *settings, arm = case
        run = [*tool, f"--callgrind-out-file={out}", program, *settings, samples, "portable", arm]
        subprocess.run(run, check=True, capture_output=True)
        dumps = [Path(f"{out}.{number}").read_text() for number in range(1, VALGRIND_SAMPLES + 1)]
    return [int(re.findall(r"^(?:summary|totals): (\d+)", text, re.MULTILINE)[-1]) for text in dumps]


def by_steps(program: str, *case: str) -> list[int]:
    """Instructions of each call of ``one_sample`` in code for this processor, by single steps."""
    pid = os.fork()
    if pid == 0:
        ask(TRACE_ME, 0)
        *settings, arm = case
        os.execv(program, [program, *settings, str(STEP_SAMPLES), "best", arm])
    try:
        wait(pid)
        with open(f"/proc/{pid}/maps") as maps:
            base = int(maps.readline().split("-")[0], 16)
        entry = base + offset(program)
        run_to(pid, entry)
        return [one_call(pid, entry) for _ in range(STEP_SAMPLES - 1)]
    finally:
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)


def run_to(pid: int, address: int) -> None:
    """Run the traced program at full speed to an address."""
    word = ask(PEEK, pid, address)
    ask(POKE, pid, address, (word & ~0xFF) | BREAKPOINT)
    ask(CONTINUE, pid)
    wait(pid)
    ask(POKE, pid, address, word)
    ask(POKE_USER, pid, RIP, address)


def one_call(pid: int, entry: int) -> int:
    """Number of instructions of a call from its entry to its return; runs on to the next entry."""
    back, stack = ask(PEEK, pid, ask(PEEK_USER, pid, RSP)), ask(PEEK_USER, pid, RSP)
    count = 0
    while True:
        ask(STEP, pid)
        wait(pid)
        count += 1
        if ask(PEEK_USER, pid, RIP) == back and ask(PEEK_USER, pid, RSP) > stack:
            break
    while ask(PEEK_USER, pid, RIP) != entry:
        ask(STEP, pid)
        wait(pid)
    return count


def tools() -> dict[str, Callable[..., list[int]]]:
    """Methods of counting that work on this machine, by the code they count."""
    found: dict[str, Callable[..., list[int]]] = {}
    if sys.platform == "linux" and platform.machine() == "x86_64" and shutil.which("nm"):
        found["this processor's"] = by_steps
    else:
        print("skipped: single steps are counted on Linux on x86-64 only, with nm", file=sys.stderr)
    if shutil.which("valgrind"):
        found["any processor's"] = by_valgrind
    else:
        print("skipped: valgrind is not installed", file=sys.stderr)
    return found


def main() -> None:
    print("| code | arm | scheme | filters | form | median | least | most | within 10 % |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    steady = True
    for code, counted in tools().items():
        for arm, scheme, filters, form in CASES:
            n = counted(sys.argv[1], scheme, filters, form, arm)[START:]
            middle = statistics.median(n)
            within = sum(abs(x / middle - 1) <= 0.1 for x in n) / len(n)
            steady &= within == 1
            cells = (code, arm, scheme, filters, form, f"{middle:.0f}", min(n), max(n), f"{within:.1%}")
            print("| " + " | ".join(map(str, cells)) + " |", flush=True)
    sys.exit(not steady)


if __name__ == "__main__":
    main()
