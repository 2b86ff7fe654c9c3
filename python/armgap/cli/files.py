"""Types of command-line parameters for files that a command reads or writes, and the check that no two of the files clash.

Every parameter that takes text has one of these types, so that a command cannot have an unchecked output. Before a command runs,
`check_files` compares all of its files: by device and inode, or by folder and name for a file that does not exist yet.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import click

from armgap.errors import ArmgapError, OptionError, ResultError
from armgap.files.output import STANDARD_STREAM, check_writable, status_of

__all__ = [
    "Command",
    "Group",
    "InputFile",
    "InputFolder",
    "OutputFile",
    "OutputFolder",
    "Words",
    "check_files",
]

Key = tuple[int | str, ...]
_REMEDY = "name another file"
_REMEDY_FOLDER = "name another folder"


class Words(click.types.StringParamType):
    """Type of a command-line parameter whose text names no file."""


class _Place(click.Path):
    """Type of a command-line parameter for a file or folder; text that cannot be a file name is refused."""

    def __init__(self, **options: Any) -> None:
        super().__init__(readable=False, **options)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path given on the command line, or fail if it cannot be a file name."""
        text = os.fspath(value)
        if not text or "\0" in text:
            raise OptionError(f"{_label(param)}: {text!r} is no name of a file or folder", remedy="name one")
        return super().convert(value, param, ctx)


class InputFile(_Place):
    """Type of a command-line parameter for an input file, a pattern of input files, or ``-``.

    Parameters
    ----------
    words : tuple of str, default none
        Values of the parameter that name no file.
    """

    def __init__(self, words: tuple[str, ...] = ()) -> None:
        super().__init__()
        self.words = words


class InputFolder(_Place):
    """Type of a command-line parameter for a folder that is read.

    Parameters
    ----------
    holds : callable, optional
        Function of an entry's path: whether the entry of the folder is read; by default all are.
    exists : bool, default False
        Whether a missing folder is refused as wrong usage of the command.
    """

    def __init__(self, holds: Callable[[Path], bool] | None = None, *, exists: bool = False) -> None:
        super().__init__(exists=exists, file_okay=not exists, path_type=Path)
        self.holds = holds


class OutputFile(_Place):
    """Type of a command-line parameter for an output file, or ``-``."""


class OutputFolder(_Place):
    """Type of a command-line parameter for a folder that the command fills.

    Parameters
    ----------
    holds : callable, optional
        Function of an entry's path: whether the command writes the entry; by default all entries.
    """

    def __init__(self, holds: Callable[[Path], bool] | None = None) -> None:
        super().__init__(path_type=Path)
        self.holds = holds


class Command(click.Command):
    """A click command that checks its files for clashes before it runs.

    Parameters
    ----------
    reads : tuple of Path, default none
        Folders that the command always reads.
    """

    def __init__(self, *args: Any, reads: tuple[Path, ...] = (), **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.reads = reads

    def invoke(self, ctx: click.Context) -> Any:
        """Check the command's files for clashes, then run the command."""
        check_files(ctx, self.reads)
        return super().invoke(ctx)


class Group(click.Group):
    """A group of commands with options of its own, whose files are checked for clashes like those of a command."""

    command_class = Command

    def invoke(self, ctx: click.Context) -> Any:
        """Check the group's files for clashes, then run the group."""
        check_files(ctx)
        return super().invoke(ctx)


@dataclass(frozen=True)
class _Named:
    """A file or folder given to a command, with its identity and label."""

    label: str
    path: str
    chain: tuple[Key, ...]
    """Keys (device and inode) of the file itself and of the folders around it, innermost first."""
    mode: int | None
    names: tuple[str, ...]
    """Names of the file and of the folders around it, innermost first."""
    folder: bool
    holds: Callable[[Path], bool] | None = None


def check_files(ctx: click.Context, reads: tuple[Path, ...] = ()) -> None:
    """Raise if an output of a command cannot be written, or is also an input or another output.

    Parameters
    ----------
    ctx : click.Context
        Context of the command, with its parameters.
    reads : tuple of Path, default none
        Further folders that the command reads.

    Raises
    ------
    ResultError
        If two files clash or an output cannot be written; the message names them.
    """
    inputs = [_named("the sample case", os.fspath(folder), 0, folder=True) for folder in reads]
    outputs: list[_Named] = []
    for parameter in ctx.command.get_params(ctx):
        for value in _values(ctx.params.get(parameter.name or "")):
            inputs += _read_by(parameter, value)
            outputs += _written_by(parameter, value)
    for output in outputs:
        for given in inputs:
            _compare(output, given, f"is read as {given.label}", _same_input)
    for first, second in combinations(outputs, 2):
        _compare(second, first, f"is written by {first.label} too", _same_output)
    for output in outputs:
        if not output.folder:
            check_writable(output.path)
        elif os.path.lexists(output.path) and not os.path.isdir(output.path):
            raise ResultError("is no folder", remedy=_REMEDY_FOLDER, file=output.path)


def _values(value: Any) -> Iterator[str]:
    if value is None:
        return
    for one in value if isinstance(value, tuple | list) else (value,):
        if isinstance(one, str | os.PathLike):
            yield os.fspath(one)


def _read_by(parameter: click.Parameter, value: str) -> list[_Named]:
    from armgap.log.gather import paths

    kind = parameter.type
    if isinstance(kind, InputFolder):
        return [_named(_label(parameter), value, 0, folder=True, holds=kind.holds)]
    if not isinstance(kind, InputFile) or value in kind.words:
        return []
    try:
        files = [os.fspath(path) for path in paths([value])]
    except ArmgapError:
        return []  # the function that reads the files reports that none matches the pattern
    return [_named(_label(parameter), file, 0, folder=os.path.isdir(file)) for file in files]


def _written_by(parameter: click.Parameter, value: str) -> list[_Named]:
    kind = parameter.type
    if isinstance(kind, OutputFolder):
        return [_named(_label(parameter), value, 1, folder=True, holds=kind.holds)]
    return [_named(_label(parameter), value, 1, folder=False)] if isinstance(kind, OutputFile) else []


def _label(parameter: click.Parameter | None) -> str:
    """Return the user's name of a parameter: its long option, or the argument's name."""
    if parameter is None:
        return "a file"
    if isinstance(parameter, click.Argument):
        return (parameter.metavar or parameter.human_readable_name).strip("[]…")
    return max(parameter.opts, key=len)


def _named(label: str, path: str, stream: int, *, folder: bool, holds: Callable[[Path], bool] | None = None) -> _Named:
    if path == STANDARD_STREAM and not folder:
        try:
            there = os.fstat(stream)
        except OSError:
            return _Named(label, path, ((path, stream),), None, (), False)
        return _Named(label, path, ((there.st_dev, there.st_ino),), there.st_mode, (), False)
    status = status_of(path)
    if status is not None and not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        return _Named(label, path, ((status.st_dev, status.st_ino),), status.st_mode, (), folder)
    real = Path(os.path.realpath(path))
    places = [real, *real.parents]
    keys = tuple(_key(place) for place in places)
    if status is not None:  # the identity also of files that realpath cannot name, such as one that is open but removed
        keys = ((status.st_dev, status.st_ino), *keys[1:])
    return _Named(
        label, path, keys, None if status is None else status.st_mode, tuple(p.name for p in places), folder, holds
    )


def _key(place: Path) -> Key:
    """Return a file's device and inode; for a missing file, device and inode of its folder, and its name."""
    status = status_of(place)
    if status is not None:
        return status.st_dev, status.st_ino
    parent = status_of(place.parent)
    return (os.fspath(place),) if parent is None else (parent.st_dev, parent.st_ino, place.name)


def _compare(output: _Named, other: _Named, what: str, same: Callable[[_Named, _Named], bool]) -> None:
    """Raise if an output is the same file as another file or folder, or if one lies in the other."""
    if output.chain[0] == other.chain[0] and same(output, other):
        raise ResultError(
            f"{output.label} would overwrite what {what} ({other.path})", remedy=_REMEDY, file=output.path
        )
    if other.folder and not output.folder and _belongs(output, other):
        raise ResultError(
            f"{output.label} would write into what {what} ({other.path})", remedy=_REMEDY, file=output.path
        )
    if output.folder and not other.folder and _belongs(other, output):
        raise ResultError(
            f"{output.label} would write around what {what} ({other.path})", remedy=_REMEDY_FOLDER, file=output.path
        )
    if output.folder and other.folder and (output.chain[0] in other.chain or other.chain[0] in output.chain):
        raise ResultError(
            f"{output.label} and what {what} lie in each other ({other.path})", remedy=_REMEDY_FOLDER, file=output.path
        )


def _same_input(output: _Named, given: _Named) -> bool:
    """Whether an output is an input that must not be overwritten; a terminal or a socket may be both."""
    return output.mode is None or not (stat.S_ISCHR(output.mode) or stat.S_ISSOCK(output.mode))


def _same_output(output: _Named, other: _Named) -> bool:
    """Whether two outputs at one path clash; outputs to the null device do not."""
    if output.path == other.path == STANDARD_STREAM:
        return True
    null = status_of(os.devnull)
    return null is None or output.chain[0] != (null.st_dev, null.st_ino)


def _belongs(file: _Named, folder: _Named) -> bool:
    """Whether a file is, or would become, one of the files that a folder holds, by path or by link."""
    if folder.chain[0] in file.chain[1:]:
        entry = file.names[file.chain.index(folder.chain[0]) - 1]
        if folder.holds is None or folder.holds(Path(folder.path) / entry):
            return True
    if file.mode is None or not stat.S_ISREG(file.mode) or not os.path.isdir(folder.path):
        return False
    return file.chain[0] in _files_in(folder)


def _files_in(folder: _Named) -> Iterator[Key]:
    """Yield the keys of all files that belong to a folder, links followed."""
    seen: set[Key] = set()
    for place, folders, files in os.walk(folder.path, followlinks=True):
        top = os.path.samefile(place, folder.path)
        if top and folder.holds is not None:
            folders[:] = [name for name in folders if folder.holds(Path(place) / name)]
            files = [name for name in files if folder.holds(Path(place) / name)]
        folders[:] = [name for name in folders if not _known(os.path.join(place, name), seen)]
        yield from (_key(Path(place) / name) for name in files)


def _known(place: str, seen: set[Key]) -> bool:
    """Whether a folder was seen before, perhaps by another link."""
    key = _key(Path(place))
    known = key in seen
    seen.add(key)
    return known
