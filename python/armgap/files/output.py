"""Atomic writing of results to files, complete or not at all; streams and devices are written to directly.

A regular file is written in its target's folder under a temporary name and renamed when it is complete and on the disk, so that neither an
interrupt nor a full disk leaves half of it, and two programs that write one file do not mix. It takes over mode, owner, group and
extended attributes of the file it replaces. Symbolic links stay and are followed. See docs/decisions/032-nothing-lost.md.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeAlias

from armgap.errors import ResultError
from armgap.files.reading import is_text

__all__ = [
    "STANDARD_STREAM",
    "Content",
    "check_writable",
    "descriptor",
    "is_stdout",
    "status_of",
    "write",
    "write_folder",
]

STANDARD_STREAM = "-"
Content: TypeAlias = str | bytes | Callable[[Path], Any]
_PLACE = "choose another place"
#: File descriptors of standard output and standard error.
_STDOUT, _STDERR = 1, 2
_OS_ERROR = re.compile(r"\(os error ([0-9]+)\)")
"""Pattern of an operating system's error number in error messages of libraries written in Rust."""
_NEW_FILE = 0o666  # permissions of a new file, less the umask


def write(path: str | os.PathLike[str], content: Content) -> None:
    """Write a result to a file, atomically, or to a stream.

    Parameters
    ----------
    path : path-like
        Path of the file; ``-`` is standard output.
    content : str, bytes or callable
        Text, written as UTF-8; bytes; or a function that is given the path of an empty file to fill.

    Raises
    ------
    ResultError
        If the result cannot be written; an existing regular file is then unchanged.
    """
    try:
        if os.fspath(path) == STANDARD_STREAM:
            _to_stdout(content)
        elif (number := descriptor(path)) is not None:
            _to_descriptor(number, content)
        elif _is_special(path):
            with open(path, "wb", buffering=0) as stream:
                _pour(stream.fileno(), _bytes(content))
        else:
            _replace(Path(os.path.realpath(path)), content)
    except ResultError:
        raise
    except (OSError, ValueError) as error:
        raise _refused(path, error) from None


def write_folder(path: str | os.PathLike[str], fill: Callable[[Path], Any]) -> Path:
    """Make a folder that appears only when `fill` has put everything into it.

    Parameters
    ----------
    path : path-like
        New or empty folder; its parent exists.
    fill : callable
        Function that fills an empty folder, given by its path.

    Raises
    ------
    ResultError
        If the folder cannot be written, or exists and is not empty.
    """
    target = Path(path)
    partial = _beside(target)
    try:
        partial.mkdir()
        fill(partial)
        partial.rename(target)
    except ResultError:
        raise
    except OSError as error:
        raise _refused(path, error) from None
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return target


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raise if a result could not be written to a path, without writing anything.

    Raises
    ------
    ResultError
        If the path cannot be written to; the message names the reason.
    """
    if os.fspath(path) == STANDARD_STREAM:
        return
    if (number := descriptor(path)) is not None:
        _check_open(number, path)
        return
    if os.path.isdir(path):
        raise ResultError("is a folder", remedy="name a file", file=path)
    if _is_special(path):
        if not os.access(path, os.W_OK):
            raise ResultError("cannot be written to", remedy=_PLACE, file=path)
        return
    target = Path(os.path.realpath(path))
    try:
        os.stat(target)
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        pass  # the checks below give a clearer message
    except (OSError, ValueError) as error:  # such as a name that is too long, or a loop of symbolic links
        raise _refused(path, error) from None
    if not os.path.isdir(target.parent):
        raise ResultError("its folder does not exist", remedy="make the folder first", file=path)
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise ResultError("its folder cannot be written to", remedy=_PLACE, file=path)
    if (old := status_of(target)) is not None:
        _check_replaceable(target, old)


def descriptor(path: str | os.PathLike[str]) -> int | None:
    """Return the file descriptor that a path such as ``/dev/stdout`` or ``/dev/fd/3`` stands for; None for other paths.

    A file to which standard output or standard error is redirected counts as the stream: replacing the file would detach it from the shell.
    """
    word = os.path.abspath(path)
    for _ in range(40):  # largest number of symbolic links that Linux follows
        parent, name = os.path.realpath(os.path.dirname(word)), os.path.basename(word)
        if parent in (f"/proc/{os.getpid()}/fd", "/dev/fd") and name.isdecimal():
            return int(name)
        word = os.path.join(parent, name)
        if not os.path.islink(word):
            break
        word = os.path.join(parent, os.readlink(word))
    there = status_of(word)
    if there is None or not stat.S_ISREG(there.st_mode):
        return None
    return next((number for number in (_STDOUT, _STDERR) if _is_open(number, there)), None)


def is_stdout(*paths: str | os.PathLike[str] | None) -> bool:
    """Return whether one of the output paths is standard output, so that no other text may be printed to it."""
    return any(p is not None and (os.fspath(p) == STANDARD_STREAM or _leads_to_stdout(p)) for p in paths)


def _leads_to_stdout(path: str | os.PathLike[str]) -> bool:
    there = status_of(path)
    null = status_of(os.devnull)
    if there is None or (null is not None and os.path.samestat(there, null)):
        return False
    return _is_open(_STDOUT, there)


def _is_open(number: int, there: os.stat_result) -> bool:
    try:
        return os.path.samestat(os.fstat(number), there)
    except OSError:
        return False


def status_of(path: str | os.PathLike[str]) -> os.stat_result | None:
    """Return the status of a file; None for a missing or unreachable file."""
    try:
        return os.stat(path)
    except OSError:
        return None


def _is_special(path: str | os.PathLike[str]) -> bool:
    """Whether a path is a device, a pipe or a socket, which has no content to replace."""
    there = status_of(path)
    return there is not None and not (stat.S_ISREG(there.st_mode) or stat.S_ISDIR(there.st_mode))


def _refused(path: str | os.PathLike[str], error: Exception) -> ResultError:
    reason = getattr(error, "strerror", None) or str(error)
    place = "standard output" if os.fspath(path) == STANDARD_STREAM else path
    return ResultError(f"cannot be written ({reason})", remedy=_PLACE, file=place)


def _beside(target: Path) -> Path:
    """Return an unused name in the folder of `target`, independent of the target's name, which may have the largest possible length."""
    return target.with_name(f".armgap-{secrets.token_hex(8)}.partial")


def _replace(target: Path, content: Content) -> None:
    old = status_of(target)
    mode = _NEW_FILE
    if old is not None:
        _check_replaceable(target, old)
        mode = stat.S_IMODE(old.st_mode)
    if callable(content) and not is_text(target):
        content = _bytes(content)  # libraries accept only names that are valid text
    temporary = _beside(target)
    try:
        os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode))
        if callable(content):
            _fill(temporary, content)
        with open(temporary, "rb+" if callable(content) else "wb") as stream:
            if not callable(content):
                stream.write(_bytes(content))
                stream.flush()
            if old is not None:
                _keep(stream.fileno(), target, old)
            os.fsync(stream.fileno())  # a full disk or quota may raise an error only here
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def _fill(file: Path, content: Callable[[Path], Any]) -> None:
    """Let a function fill a file; operating system errors that a library wraps in its own are raised as `OSError`."""
    try:
        content(file)
    except Exception as error:
        said = _OS_ERROR.search(str(error))
        if said is None or getattr(error, "errno", None) is not None:
            raise
        number = int(said[1])
        raise OSError(number, os.strerror(number)) from error


def _check_open(number: int, path: str | os.PathLike[str]) -> None:
    try:
        os.fstat(number)
    except OSError as error:
        raise _refused(path, error) from None


def _check_replaceable(target: Path, old: os.stat_result) -> None:
    """Raise if a file may not be overwritten, or its owner could not be kept."""
    if not os.access(target, os.W_OK):
        raise ResultError("is write-protected", remedy="name another file", file=target)
    if not hasattr(os, "geteuid") or os.geteuid() == 0:
        return
    if old.st_uid != os.geteuid() or old.st_gid not in (os.getegid(), *os.getgroups()):
        raise ResultError(
            "belongs to another user or group, which could not be kept",
            remedy="name another file, or remove this one",
            file=target,
        )


def _keep(number: int, target: Path, old: os.stat_result) -> None:
    """Give an open file mode, owner and extended attributes of the file that it will replace."""
    new = os.fstat(number)
    if hasattr(os, "fchown") and (new.st_uid, new.st_gid) != (old.st_uid, old.st_gid):
        os.fchown(number, old.st_uid, old.st_gid)
    if hasattr(os, "listxattr"):
        with suppress(OSError):  # not every file system has extended attributes
            for name in os.listxattr(target):
                os.setxattr(number, name, os.getxattr(target, name))
    if hasattr(os, "fchmod"):
        os.fchmod(number, stat.S_IMODE(old.st_mode))  # after fchown, which clears bits of the mode


def _bytes(content: Content) -> bytes:
    """Return the content as bytes; a function is given a temporary file to fill."""
    if isinstance(content, str):
        return content.encode("utf-8", "backslashreplace")
    if isinstance(content, bytes):
        return content
    with tempfile.TemporaryDirectory(prefix="armgap-") as folder:
        file = Path(folder) / "result"
        file.touch()
        _fill(file, content)
        return file.read_bytes()


def _pour(number: int, data: bytes) -> None:
    """Write all bytes to a file descriptor."""
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(number, rest) :]


def _to_descriptor(number: int, content: Content) -> None:
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
    _pour(number, _bytes(content))


def _to_stdout(content: Content) -> None:
    """Write a result to standard output, with a line break at the end of a text."""
    data = _bytes(content)
    if isinstance(content, str) and not content.endswith("\n"):
        data += b"\n"
    sys.stdout.flush()
    if hasattr(sys.stdout, "buffer"):
        sys.stdout.buffer.write(data)
    else:
        sys.stdout.write(data.decode("utf-8", "backslashreplace"))  # a notebook's stream accepts only text
    sys.stdout.flush()
