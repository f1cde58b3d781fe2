"""Reader of TOML files, with or without a byte-order mark."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["read_toml"]

_KEY_DOTS_MAX = 100
"""Most dots in a key: the time to read one grows with their square, 8 s for 100 000; a machine file's have two."""

_QUOTED = re.compile(r"\"[^\"]*\"|'[^']*'")


def read_toml(path: Path) -> dict[str, Any]:
    """Return the content of a file in UTF-8.

    Raises
    ------
    ValueError, RecursionError
        If it is no TOML, or nested too deeply.
    """
    text = path.read_text(encoding="utf-8-sig")
    for number, line in enumerate(text.splitlines(), 1):
        if line.count(".") > _KEY_DOTS_MAX and _key(line).count(".") > _KEY_DOTS_MAX:
            raise ValueError(f"a key must have at most {_KEY_DOTS_MAX} dots (at line {number})")
    content: dict[str, Any] = tomllib.loads(text)
    return content


def _key(line: str) -> str:
    """Return what may be a key in a line, without what is quoted in it."""
    return _QUOTED.sub("", line).partition("=")[0].partition("#")[0]
