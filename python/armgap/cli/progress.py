"""Progress bar on standard error: current work, fraction done, and estimated remaining time."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from armgap.cli.common import console
from armgap.progress import use_callback

if TYPE_CHECKING:
    from rich.progress import Progress, Task
    from rich.text import Text

__all__ = ["left", "working"]

# Elapsed time and fraction done before which no remaining time is shown.
_GUESS_AFTER_S = 1.0
_GUESS_AFTER_PART = 0.03


@contextmanager
def working(message: str, *, quiet: bool) -> Iterator[None]:
    """Show the progress of the work inside the ``with`` block on standard error, unless quiet, not at a terminal, or with ``NO_COLOR`` set.

    Texts reported by `armgap.progress.report_progress` replace `message`.
    """
    if quiet or os.environ.get("NO_COLOR") or not sys.stderr.isatty():
        yield
        return
    with _bar() as bar, use_callback(_Line(bar, message).show):
        yield


def left(elapsed_s: float, fraction: float) -> float | None:
    """Return the estimated remaining time [s] at the mean speed so far; None while it is too early for an estimate.

    Examples
    --------
    >>> left(6.0, 0.25), left(0.2, 0.5)
    (18.0, None)
    """
    if elapsed_s < _GUESS_AFTER_S or fraction < _GUESS_AFTER_PART:
        return None
    return elapsed_s * (1 - fraction) / fraction


def _bar() -> Progress:
    from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, TextColumn
    from rich.text import Text

    class TimeLeft(ProgressColumn):
        """Column of a progress bar with the remaining time, or with the elapsed time if no estimate exists."""

        max_refresh = 0.5

        def render(self, task: Task) -> Text:
            return Text(_time(task.elapsed or 0.0, None if task.total is None else task.completed))

    class Percentage(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text("" if task.total is None else f"{task.completed:4.0%}")

    words = TextColumn("{task.description:28.28}", markup=False)
    columns = (SpinnerColumn(), words, BarColumn(24), Percentage(), TimeLeft())
    return Progress(*columns, console=console(error=True), transient=True)


def _time(elapsed_s: float, fraction: float | None) -> str:
    remaining = None if fraction is None else left(elapsed_s, fraction)
    return f"{_clock(elapsed_s)} so far" if remaining is None else f"about {_clock(remaining)} left"


def _clock(seconds: float) -> str:
    """Return a time, rounded to whole seconds, in words.

    Examples
    --------
    >>> _clock(7.4), _clock(95)
    ('7 s', '1 min 35 s')
    """
    whole = round(seconds)
    return f"{whole} s" if whole < 60 else f"{whole // 60} min {whole % 60} s"


class _Line:
    """State of the progress bar's one line; work that restarts from a smaller fraction restarts the clock."""

    def __init__(self, bar: Progress, message: str) -> None:
        self.bar = bar
        self.task = bar.add_task(message, total=None)
        self.done = 0.0

    def show(self, work: str, fraction: float) -> None:
        if fraction < self.done:
            self.bar.reset(self.task, total=1.0)
        self.done = fraction
        self.bar.update(self.task, description=work, total=1.0, completed=fraction)
