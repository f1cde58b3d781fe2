"""Random damage to files."""

from __future__ import annotations

from collections.abc import Mapping
from random import Random
from typing import Any

__all__ = ["broken", "log_text"]


def log_text(log: Mapping[str, Any], delimiter: str = ",") -> bytes:
    """Return a log as text."""
    rows = zip(*log.values(), strict=True)
    lines = [delimiter.join(log), *(delimiter.join(map(repr, map(float, row))) for row in rows)]
    return "\n".join(lines).encode() + b"\n"


def broken(content: bytes, chance: Random) -> bytes:
    """Change bytes anywhere, the first ones more often: headers are there."""
    if not content:
        return bytes([chance.randrange(256)])
    end = len(content) if chance.random() < 0.5 else min(len(content), 512)
    place, length = chance.randrange(end), chance.choice((1, 1, 1, 2, 4, 8, 64, 1000))
    head, rest = content[:place], content[place:]
    match chance.randrange(9):
        case 0:
            return head
        case 1:
            return head + rest[length:]
        case 2:
            return head + rest[:length] * chance.choice((2, 3, 50)) + rest
        case 3:
            return head + chance.randbytes(length) + rest[length:]
        case 4:
            return head + chance.choice((b"\0", b"\xff", b"\x7f", b"\x80")) * length + rest[length:]
        case 5:
            return head + chance.randbytes(length) + rest
        case 6:
            return rest + head
        case _:
            return head + bytes([rest[0] ^ 1 << chance.randrange(8)]) + rest[1:]
