"""Flavours of FMUs."""

from __future__ import annotations

__all__ = ["FLAVOURS"]

FLAVOURS = ("native", "python")
"""The default first."""
