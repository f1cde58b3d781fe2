"""Libraries that come as extras, imported when they are needed."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from ..base.errors import LogError

__all__ = ["library"]


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
