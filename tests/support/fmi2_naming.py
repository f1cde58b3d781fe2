"""Structured names of FMI 2.0, section 2.2.9."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import groupby

_QUOTED = r"'(?:[A-Za-z0-9_!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]|\\['\"?\\abfnrtv])+'"
_PART = rf"(?:[A-Za-z_][A-Za-z0-9_]*|{_QUOTED})(?:\[[0-9]+(?:,[0-9]+)*\])?"
_IDENTIFIER = rf"{_PART}(?:\.{_PART})*"
_NAME = re.compile(rf"{_IDENTIFIER}|der\({_IDENTIFIER}(?:,[0-9]+)?\)")
_INDEXED = re.compile(r"([^\[\]]+)\[([0-9]+)\](.*)")


def is_structured(name: str) -> bool:
    """Return whether a name follows the grammar."""
    return _NAME.fullmatch(name) is not None


def array_gaps(names: Sequence[str]) -> Iterator[str]:
    """Yield what is wrong with arrays of one dimension: elements must be 1, 2, … n and stand together."""
    matches = [_INDEXED.fullmatch(name) for name in names]
    seen: set[str] = set()
    for array, group in groupby(matches, lambda match: match[1] if match else ""):
        if not array:
            continue
        if array in seen:
            yield f"the elements of {array} do not stand together"
        seen.add(array)
        indices = [int(match[2]) for match in group if match]
        members = [index for index, _ in groupby(indices)]
        if members != list(range(1, len(members) + 1)):
            yield f"the elements of {array} must be 1 … {len(members)}, got {members}"
