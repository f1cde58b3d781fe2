"""The fixture of the tests that every implementation runs."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from built_once import BuiltFmus
from streams import StreamMaker


@pytest.hookimpl(tryfirst=True)  # before tests/conftest.py leaves out what runs at night
def pytest_collection_modifyitems(items: list[pytest.Function]) -> None:
    """Leave all but one set of parameters to the night where one will do."""
    seen = set()
    for item in items:
        if item.get_closest_marker("one_set"):
            test = (item.nodeid.partition("[")[0], item.callspec.params["new_stream"])
            if test in seen:
                item.add_marker("nightly")
            seen.add(test)


@pytest.fixture
def new_stream(request: pytest.FixtureRequest, fmus: BuiltFmus, tmp_path: Path) -> Iterator[StreamMaker]:
    """Make streams of the ``(implementation, model)`` that a test is parametrised with."""
    implementation, model = request.param
    maker = StreamMaker(implementation, model, fmus, tmp_path)
    yield maker
    maker.close()
