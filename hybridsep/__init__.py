"""Servo-error prediction for CNC feed drives with the linear hybrid model."""

from __future__ import annotations

__version__ = "0.1.0"
