"""Entry point of environments that were installed before ``hybridsep/__main__.py``."""

from hybridsep.__main__ import main

__all__ = ["main"]
