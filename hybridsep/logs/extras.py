"""Libraries that read formats: those that come as extras, and what they raise of a damaged file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from ..base.errors import LogError, first_line

__all__ = ["library", "reading"]

_OWN = (TypeError, AttributeError, LookupError)
"""Errors whose messages tell of the library's own names."""


def library(asked: Path | str, module: str, extra: str, format_: str) -> Any:
    """Return a module that comes with an extra; LogError, which names the extra, if it is not installed.

    Parameters
    ----------
    asked : Path or str
        What needs it, for the message: a file, an address or an option.
    module : str
    extra : str
        The extra that installs it.
    format_ : str
        The format's name.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise LogError(
            f"{asked}: is {format_}, which needs the extra {extra}: pip install 'hybridsep[{extra}]'"
        ) from error


@contextmanager
def reading(path: Path, format_: str, what: str = "") -> Iterator[None]:
    """Turn what a library raises into a LogError on ``what`` of a file, all of it if left out, and why.

    A damaged file may fail in every way there is.
    """
    try:
        yield
    except (MemoryError, LogError):
        raise
    except Exception as error:
        name = type(error).__name__ if type(error).__module__ == "builtins" else _qualified(type(error))
        why = name if isinstance(error, _OWN) else first_line(f"{name}: {error}")
        subject = f"{what} is" if what else "is"
        raise LogError(f"{path}: {subject} truncated, damaged or not {format_}: {why}") from error


def _qualified(kind: type) -> str:
    """Return an exception's name, with its module where it is called error, as zlib's and struct's are."""
    return f"{kind.__module__}.{kind.__name__}" if kind.__name__ == "error" else kind.__name__
