"""Libraries of formats that come as extras, imported when a file of theirs is opened."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from ..base.errors import LogError, first_line

__all__ = ["library", "quiet", "reading", "refusal"]

_OWN = (TypeError, AttributeError, LookupError)
"""Errors whose messages tell of the library's own names."""


def library(asked: Path | str, module: str, extra: str, format_: str) -> Any:
    """Return a module that reads a format.

    Parameters
    ----------
    asked : Path or str
        What needs it, for the message: a file, an address or an option.
    module : str
    extra : str
        The extra that installs it.
    format_ : str
        The format's name.

    Raises
    ------
    LogError
        If it is not installed; the message names the extra.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise LogError(
            f"{asked}: is {format_}, which needs the extra {extra}: pip install 'hybridsep[{extra}]'"
        ) from error


def refusal(path: Path, format_: str, error: Exception, what: str = "") -> LogError:
    """Return that ``what`` of a file, all of it if left out, is damaged or of another format, and why.

    The reason is the type of the library's error, and its first line where that says something.
    """
    why = type(error).__name__ if isinstance(error, _OWN) else first_line(f"{type(error).__name__}: {error}")
    subject = f"{what} is" if what else "is"
    return LogError(f"{path}: {subject} truncated, damaged or not {format_}: {why}")


@contextmanager
def reading(
    path: Path, format_: str, what: str = "", errors: tuple[type[Exception], ...] = (Exception,)
) -> Iterator[None]:
    """Turn what a library raises into the :func:`refusal` of a file: a damaged one may fail in every way there is."""
    try:
        yield
    except (MemoryError, LogError):
        raise
    except errors as error:
        raise refusal(path, format_, error, what) from error


@contextmanager
def quiet(name: str) -> Iterator[None]:
    """Keep a library from logging to standard error: what counts is in the error that it raises.

    Parameters
    ----------
    name : str
        With which the names of its loggers begin.
    """
    loggers = [logging.getLogger(one) for one in [*logging.root.manager.loggerDict] if one.startswith(name)]
    before = [logger.disabled for logger in loggers]
    for logger in loggers:
        logger.disabled = True
    try:
        yield
    finally:
        for logger, disabled in zip(loggers, before, strict=True):
            logger.disabled = disabled
