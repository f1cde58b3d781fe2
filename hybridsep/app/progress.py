"""Progress on standard error: a bar in a terminal, elsewhere a line for each stage."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from .failures import errors_console

__all__ = ["progress_bar"]

_SILENT = 2.0
"""Time for which no line is printed, s: what is done by then needs no progress."""

_PAUSE = 5.0
"""Time without a line after which one says how far the stage is, s."""


@contextmanager
def progress_bar(quiet: bool) -> Iterator[Callable[[str, float], None]]:
    """Show progress on stderr; yield a function of a message, which names the stage, and the fraction done."""
    if quiet or not errors_console.is_terminal:
        yield _nothing if quiet else _Lines()
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Progress(*columns, console=errors_console, transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda message, fraction: bar.update(task, description=message, completed=fraction)


def _nothing(_message: str, _fraction: float) -> None:
    """Show nothing."""


class _Lines:
    """Prints a line where a stage begins, and while it lasts one after each pause."""

    def __init__(self) -> None:
        self._begun = monotonic()
        self._stage, self._printed = "", 0.0

    def __call__(self, message: str, fraction: float) -> None:
        now = monotonic()
        if now - self._begun < _SILENT or fraction >= 1.0:
            return
        if message != self._stage or now - self._printed >= _PAUSE:
            self._stage, self._printed = message, now
            errors_console.print(f"[{fraction:4.0%}] {message}", soft_wrap=True)
