"""How far long work is, told to whoever wants to know.

Whoever works says so with `tell`; whoever wants to know says so with `following`. Neither needs to know the other, so that a reader of
files deep inside a diagnosis can be followed without handing a callback through everything above it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial

__all__ = ["Told", "following", "of_many", "tell"]

#: Called with what is being done, and the fraction of it that is done: from 0 to 1, never falling while the words stay the same task.
Told = Callable[[str, float], object]

_told: ContextVar[Told | None] = ContextVar("armgap_progress", default=None)


@contextmanager
def following(told: Told | None) -> Iterator[None]:
    """Have `told` called as work goes on inside the block; None leaves things as they are.

    Examples
    --------
    >>> with following(lambda work, fraction: print(f"{work}: {fraction:.0%}")):
    ...     tell("reading", 0.5)
    reading: 50%
    """
    if told is None:
        yield
        return
    token = _told.set(told)
    try:
        yield
    finally:
        _told.reset(token)


def tell(work: str, fraction: float) -> None:
    """Say what is being done and which fraction of it is done."""
    told = _told.get()
    if told is not None:
        told(work, fraction)


def of_many(work: str, number: int, count: int) -> Told:
    """Return a callback for part `number` (from 0) of `count` parts of `work`, whatever that part calls itself.

    Examples
    --------
    >>> with following(lambda work, fraction: print(f"{work}: {fraction:.0%}")):
    ...     of_many("two cases", 1, 2)("reading", 0.5)
    two cases: 75%
    """
    return partial(_part, _told.get(), work, number, count)


def _part(told: Told | None, work: str, number: int, count: int, _: str, fraction: float) -> None:
    if told is not None:
        told(work, (number + fraction) / count)
