"""Flavours of FMUs."""

from __future__ import annotations

__all__ = ["BACKENDS"]

BACKENDS = ("native", "python")
"""The default first."""
