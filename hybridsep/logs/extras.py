"""Libraries of formats that come as extras, imported when a file of theirs is opened."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from ..base.errors import LogError, first_line

__all__ = ["because", "library", "quiet"]

_OWN = (TypeError, AttributeError, LookupError)
"""Errors whose messages tell of the library's own names."""


def library(path: Path, module: str, extra: str, format_: str) -> Any:
    """Return a module that reads a format.

    Parameters
    ----------
    path : Path
        The file that needs it, for the message.
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
            f"{path}: is {format_}, which needs the extra {extra}: pip install 'hybridsep[{extra}]'"
        ) from error


def because(error: Exception) -> str:
    """Return why a library failed, for a message: the error's type, and its first line where that says something."""
    return type(error).__name__ if isinstance(error, _OWN) else first_line(f"{type(error).__name__}: {error}")


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
