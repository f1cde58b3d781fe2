"""Native FMUs as their FMI functions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fmi2_driving import library_of
from fmi2_library import Library


@pytest.fixture(scope="module")
def loaded(folders: Callable[[str], Path]) -> Library:
    return library_of(folders("HybridPredictor"))


@pytest.fixture
def fmu(loaded: Library) -> Iterator[Library]:
    loaded.messages.clear()
    yield loaded
    assert not loaded.blocks, "memory was not given back"
