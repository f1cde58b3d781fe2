"""``model.png``: a small picture of what an FMU does, drawn by a few lines so that its bytes never change."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable

__all__ = ["icon"]

_SIZE = 96
_PAPER, _INK, _GREY, _RED = (255, 255, 255), (31, 78, 121), (160, 160, 160), (192, 57, 43)
_BLACK = (40, 40, 40)

Colour = tuple[int, int, int]
Curve = Callable[[float], float]


def icon(model: str) -> bytes:
    """Return the PNG of a model.

    Parameters
    ----------
    model : {"HybridPredictor", "SepCompensator", "FeedDrive", "ReferenceTrajectory"}
    """
    pixels = [[_PAPER] * _SIZE for _ in range(_SIZE)]
    for i in range(_SIZE):
        for edge in (0, 1, _SIZE - 2, _SIZE - 1):
            pixels[edge][i] = pixels[i][edge] = _INK
    for curve, colour in _curves(model):
        _draw(pixels, curve, colour)
    return _png(pixels)


def _step(u: float) -> float:
    """Rise smoothly from 0 to 1 between u = 0.15 and 0.45."""
    s = min(max((u - 0.15) / 0.3, 0.0), 1.0)
    return s * s * (3 - 2 * s)


def _ringing(u: float) -> float:
    """Follow the step as a badly damped drive does."""
    return _step(u - 0.05) + (0.22 * math.exp(-5 * (u - 0.4)) * math.sin(32 * (u - 0.4)) if u > 0.4 else 0.0)


def _modified(u: float) -> float:
    """Precede the step and counteract the ringing."""
    return _step(u + 0.06) - (0.16 * math.sin(20.94 * (u - 0.09)) if 0.09 < u < 0.39 else 0.0)


def _curves(model: str) -> list[tuple[Curve, Colour]]:
    if model == "FeedDrive":
        return [(_step, _GREY), (_ringing, _INK)]
    if model == "SepCompensator":
        return [(_modified, _RED), (_step, _BLACK)]
    if model == "ReferenceTrajectory":
        return [(lambda u: (_step(2.2 * u) + _step(2.2 * u - 0.5) + _step(2.2 * u - 1.0)) / 3, _INK)]
    return [(_step, _GREY), (lambda u: _step(u - 0.05), _BLACK), (_ringing, _RED)]


def _draw(pixels: list[list[Colour]], curve: Curve, colour: Colour) -> None:
    """Draw a curve over u = 0 … 1 with a pen of 3 pixels."""
    margin, steps = 12, 8 * _SIZE
    for i in range(steps):
        u = i / (steps - 1)
        column = margin + round(u * (_SIZE - 2 * margin))
        row = _SIZE - margin - 10 - round(curve(u) * (_SIZE - 2 * margin - 20))
        for y in range(row - 1, row + 2):
            for x in range(column - 1, column + 2):
                pixels[y][x] = colour


def _png(pixels: list[list[Colour]]) -> bytes:
    """Return an 8-bit RGB image; stored, not deflated, as zlib's versions compress differently."""
    rows = b"".join(b"\0" + bytes(part for pixel in row for part in pixel) for row in pixels)
    header = struct.pack(">2I5B", len(pixels[0]), len(pixels), 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", header) + _chunk(b"IDAT", zlib.compress(rows, 0)) + _chunk(b"IEND", b"")
    )


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
