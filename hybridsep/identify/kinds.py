"""Kinds of files that an axis is identified from."""

from __future__ import annotations

__all__ = ["KINDS"]

KINDS = ("auto", "operation", "response", "sweep", "klipper")
"""What a file may be; ``auto``: told by its columns, a log being one of operation."""
