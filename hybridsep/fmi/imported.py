"""Static search for the modules of this package that a pythonfmu slave imports."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

__all__ = ["imported_modules"]

_PACKAGE = Path(__file__).resolve().parents[1]


def imported_modules(script: Path) -> dict[str, bytes]:
    """Return the modules that a script needs when it is loaded: path within the package → source.

    Followed are the imports at the top level of a module; one inside a function is not needed to load it. The
    ``__init__.py`` of the folders are among them, empty: the top level's public names would import the whole library.

    Parameters
    ----------
    script : Path
        It names this package ``hybridsep``.
    """
    found: dict[str, bytes] = {}
    waiting = list(_imports(script.read_bytes(), ()))
    while waiting:
        module = waiting.pop()
        if module.as_posix() in found:
            continue
        source = (_PACKAGE / module).read_bytes()
        found[module.as_posix()] = source
        waiting += _imports(source, module.parent.parts)
    folders = {parent / "__init__.py" for module in found for parent in Path(module).parents}
    return dict(sorted({**found, **{folder.as_posix(): b"" for folder in folders}}.items()))


@cache
def _imports(source: bytes, place: tuple[str, ...]) -> tuple[Path, ...]:
    """Return the modules of this package that a module in the folder ``place`` names at its top level."""
    found: list[Path] = []
    for statement in ast.parse(source).body:
        if not isinstance(statement, ast.ImportFrom):
            continue
        parts = tuple(statement.module.split(".")) if statement.module else ()
        if statement.level:
            parts = (*place[: len(place) + 1 - statement.level], *parts)
        elif parts[:1] == ("hybridsep",):
            parts = parts[1:]
        else:
            continue
        if (_PACKAGE / Path(*parts)).with_suffix(".py").is_file():
            found.append(Path(*parts).with_suffix(".py"))
        else:
            found += [Path(*parts, alias.name).with_suffix(".py") for alias in statement.names]
    return tuple(found)
