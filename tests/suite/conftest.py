"""The fixture behind the tests that every implementation runs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from built_once import BuiltFmus
from library_models import runaway
from streams import StreamMaker

from hybridsep import load_machine


@pytest.fixture
def new_stream(request: pytest.FixtureRequest, fmus: BuiltFmus, tmp_path: Path) -> Iterator[StreamMaker]:
    """Make streams of the ``(implementation, model)`` that a test is parametrised with."""
    maker = StreamMaker(*request.param, fmus, tmp_path)
    yield maker
    maker.close()


@pytest.fixture(scope="session")
def runaway_weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A saved predictor of the default machine whose recursion has a pole at 1e5."""
    path = tmp_path_factory.mktemp("runaway") / "runaway.state"
    runaway(load_machine("spring_mass_damper").new_predictor()).save(path)
    return path
