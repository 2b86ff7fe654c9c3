"""Progress of long work, reported to a callback.

Long computations call `report_progress`; `use_callback` sets the function that receives the reports inside a block. The callback is
kept in a context variable, so that a reader of files deep inside a diagnosis reports without a callback parameter in every calling function.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from typing import TYPE_CHECKING

from armgap._renamed import old_names

__all__ = ["ProgressCallback", "part_callback", "report_progress", "use_callback"]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__)

#: Callback for progress, called with a task in words and the fraction of it that is done, from 0 to 1, which never falls while the task is the same.
ProgressCallback = Callable[[str, float], object]

_callback: ContextVar[ProgressCallback | None] = ContextVar("armgap_progress", default=None)


@contextmanager
def use_callback(callback: ProgressCallback | None) -> Iterator[None]:
    """Report progress of work inside the block to `callback`; None keeps the callback that is set.

    Examples
    --------
    >>> with use_callback(lambda work, fraction: print(f"{work}: {fraction:.0%}")):
    ...     report_progress("reading", 0.5)
    reading: 50%
    """
    if callback is None:
        yield
        return
    token = _callback.set(callback)
    try:
        yield
    finally:
        _callback.reset(token)


def report_progress(work: str, fraction: float) -> None:
    """Report a task in words and its fraction done, from 0 to 1, to the current callback."""
    callback = _callback.get()
    if callback is not None:
        callback(work, fraction)


def part_callback(work: str, number: int, count: int) -> ProgressCallback:
    """Return a callback that counts a part's progress as progress of the whole.

    Parameters
    ----------
    work : str
        Name of the whole task, reported in place of the part's own.
    number, count : int
        Number of the part, from 0, and number of parts.

    Examples
    --------
    >>> with use_callback(lambda work, fraction: print(f"{work}: {fraction:.0%}")):
    ...     part_callback("two cases", 1, 2)("reading", 0.5)
    two cases: 75%
    """
    return partial(_part, _callback.get(), work, number, count)


def _part(callback: ProgressCallback | None, work: str, number: int, count: int, _: str, fraction: float) -> None:
    if callback is not None:
        callback(work, (number + fraction) / count)
