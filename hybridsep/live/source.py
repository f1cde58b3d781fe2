"""Sources of samples: a log that is replayed, UDP, standard input, MQTT."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import TypeVar

from .sample import Sample

__all__ = ["IDLE", "LiveSource"]

IDLE = 0.05
"""Longest time for which a source waits before it says that nothing came, s."""

Opened = TypeVar("Opened", bound="LiveSource")


class LiveSource(ABC):
    """Source of samples, open as long as the context.

    Attributes
    ----------
    name : str
        What it is, for messages.
    file_unit : str
        Unit in which positions are shown, empty for the machine's.
    """

    name: str
    file_unit: str = ""

    @abstractmethod
    def samples(self) -> Iterator[Sample | None]:
        """Yield samples as they come; None where none has come for :data:`IDLE`; end where the source does."""

    def __enter__(self: Opened) -> Opened:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:  # noqa: B027 - a log holds nothing between its samples
        """Release what it holds."""
