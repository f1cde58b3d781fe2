"""Ports of network addresses."""

from __future__ import annotations

from ..base.errors import ParameterError

__all__ = ["check_port"]

_PORT_MAX = 65535


def check_port(text: str, address: str) -> int:
    """Return a port; ParameterError, which names its address, if it is none."""
    if not (text.isascii() and text.isdecimal() and len(text) < 6 and 0 < int(text) <= _PORT_MAX):
        raise ParameterError(f"a port must be 1 … {_PORT_MAX}, got {text!r} in {address}")
    return int(text)
