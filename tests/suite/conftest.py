"""The fixture behind the tests that every implementation runs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from built_once import BuiltFmus
from streams import StreamMaker


@pytest.fixture
def new_stream(request: pytest.FixtureRequest, fmus: BuiltFmus, tmp_path: Path) -> Iterator[StreamMaker]:
    """Make streams of the ``(implementation, model)`` that a test is parametrised with."""
    implementation, model = request.param
    maker = StreamMaker(implementation, model, fmus, tmp_path)
    yield maker
    maker.close()
