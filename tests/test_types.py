"""Types of the whole repository, as pyproject.toml has mypy check them: strictly."""

import sys

import pytest
from places import ROOT
from programs import output_of


@pytest.mark.slow
def test_mypy_finds_nothing() -> None:
    """Beside the other tests, as mypy keeps one core busy for most of a minute."""
    output_of(sys.executable, "-m", "mypy", cwd=ROOT)
