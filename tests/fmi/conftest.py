"""Native FMUs as their FMI functions."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fmi_library import Library, library_of


@pytest.fixture(scope="module")
def loaded(folders: Callable[[str], Path]) -> dict[int, Library]:
    return {version: library_of(folders(f"HybridPredictor{suffix}")) for version, suffix in ((2, ""), (3, "Fmi3"))}


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def fmu(loaded: dict[int, Library], request: pytest.FixtureRequest) -> Iterator[Library]:
    """A HybridPredictor, of both versions of FMI."""
    fmu = loaded[request.param]
    fmu.messages.clear()
    yield fmu
    assert not fmu.blocks, "memory was not given back"


@pytest.fixture
def fmu2(loaded: dict[int, Library]) -> Iterator[Library]:
    """The same, of FMI 2.0, whose importer has the memory."""
    loaded[2].messages.clear()
    yield loaded[2]
    assert not loaded[2].blocks, "memory was not given back"
