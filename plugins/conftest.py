"""Set up what the plug-ins' tests share with the core's."""

import os

# Before NumPy is loaded; tests/conftest.py says why.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("HYBRIDSEP_TARGETS", "host")

import pytest
from built_once import BuiltFmus
from command_line import Run
from quick_fits import without_other_settings


@pytest.fixture
def hybridsep(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    return Run(monkeypatch, capsys)


@pytest.fixture
def quick_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let ``fit`` try the default settings only."""
    without_other_settings(monkeypatch)


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> BuiltFmus:
    """Any FMU of any machine by name, built once a session."""
    return BuiltFmus(tmp_path_factory.mktemp("fmus"))
