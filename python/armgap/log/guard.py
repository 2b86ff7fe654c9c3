"""Reading of HDF5 and MATLAB files in a child process, safe from crashes of their libraries.

The C libraries behind HDF5 and MATLAB files can crash on damaged files (about 1 in 1500 to 3000 with a few bytes overwritten), or never
return. They run in a child process, which returns the data; if the child dies, an error that names the file is raised and the program
goes on. One child serves all files that are read, and ends with the program.
"""

from __future__ import annotations

import atexit
import os
import pickle
import subprocess
import sys
import threading
from importlib import import_module
from typing import Any

from armgap.log.recording import Source

__all__ = ["call"]

#: Time limit of a reader in a child process, s, and a data rate below any disk's, bytes/s, by which the limit grows with the file.
_PATIENCE_S = 60.0
_SLOWEST_BYTES_PER_S = 5e6
#: Length of the number before each message between parent and child, which states the message's size, bytes.
_LENGTH = 8


class CrashedError(Exception):
    """Exception: the child process that reads a file died or did not answer in time."""


class _Child:
    """A child process that answers requests until its input ends."""

    def __init__(self) -> None:
        path = os.pathsep.join(p for p in sys.path if p)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "armgap.log.guard"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": path},
        )

    def ask(self, request: Any, patience_s: float) -> Any:
        """Send a request to the child process and return the answer; exceptions of the child are raised again."""
        timer = threading.Timer(patience_s, self.process.kill)
        timer.start()
        try:
            assert self.process.stdin is not None
            assert self.process.stdout is not None
            _send(self.process.stdin, request)
            fine, answer = _receive(self.process.stdout)
        except (OSError, EOFError, pickle.UnpicklingError):
            slow = not timer.is_alive()
            self.close()
            raise CrashedError("reading it took too long" if slow else "the reader crashed over it") from None
        finally:
            timer.cancel()
        if fine:
            return answer
        raise answer

    def close(self) -> None:
        """End the child process."""
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                try:
                    pipe.close()
                except OSError:
                    continue


_child: _Child | None = None
_lock = threading.Lock()


def call(module: str, function: str, source: Source) -> Any:
    """Return ``module.function(source)``, run in a child process.

    Raises
    ------
    CrashedError
        If the child dies, or does not answer in time.
    Exception
        Whatever the function raises.
    """
    global _child
    with _lock:
        if _child is None or _child.process.poll() is not None:
            _child = _Child()
            atexit.register(_child.close)
        return _child.ask((module, function, source), _PATIENCE_S + source.size / _SLOWEST_BYTES_PER_S)


def _send(stream: Any, thing: Any) -> None:
    data = pickle.dumps(thing, protocol=5)
    stream.write(len(data).to_bytes(_LENGTH, "little"))
    stream.write(data)
    stream.flush()


def _receive(stream: Any) -> Any:
    head = stream.read(_LENGTH)
    if len(head) < _LENGTH:
        raise EOFError
    return pickle.loads(stream.read(int.from_bytes(head, "little")))


def _serve() -> None:
    """Answer requests on standard input until the stream ends; this is the main function of the child process."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # text that a library prints must not mix with the answers
    requests = sys.stdin.buffer
    while True:
        try:
            module, function, source = _receive(requests)
        except EOFError:
            return
        try:
            answer = (True, getattr(import_module(module), function)(source))
        except Exception as error:
            answer = (False, _portable(error))
        _send(answers, answer)


def _portable(error: Exception) -> Exception:
    """Return a `ValueError` with the text of an exception, which can be unpickled in any process."""
    return ValueError(str(error) or type(error).__name__)


if __name__ == "__main__":
    _serve()
