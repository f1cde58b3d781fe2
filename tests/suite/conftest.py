"""The fixture behind the tests that every implementation runs."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from streams import StreamMaker, archive_of, write_resources


@pytest.fixture(scope="session")
def archives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for FMUs, each built when first asked for, and for the C core's resources."""
    folder = tmp_path_factory.mktemp("suite")
    write_resources(folder)
    return folder


@pytest.fixture
def new_stream(request: pytest.FixtureRequest, archives: Path) -> Iterator[StreamMaker]:
    """Make streams of the ``(implementation, model)`` that a test is parametrised with."""
    implementation, model = request.param
    maker = StreamMaker(implementation, model, partial(archive_of, model, implementation, archives), archives, [])
    yield maker
    maker.close()
