"""Set up what every test shares."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import zipfile

# Threads make the small factorisations of these tests slower by two orders of magnitude on a busy machine. The
# variable must be set before NumPy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# A process that a test starts says where it crashed, as pytest's own does.
os.environ.setdefault("PYTHONFAULTHANDLER", "1")
# Without byte code each of the hundreds of processes that tests start would compile all that it imports, for seconds.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# Where the checkout has kept no libraries, those for other platforms take a minute.
os.environ.setdefault("HYBRIDSEP_TARGETS", "host")

# A shell's background jobs ignore Ctrl-C, and so would the processes of the tests about it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from built_once import SHARED_BUILDS, BuiltFmus, built_once
from command_line import Run
from hypothesis import HealthCheck, settings
from quick_fits import without_other_windows
from slow_tests import is_slow, runs_before

sys.dont_write_bytecode = False  # of this process too

# No test fails because something else keeps the cores busy.
settings.register_profile("patient", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("patient")


def pytest_configure(config: pytest.Config) -> None:
    """Give all processes of the session a folder for what they build; xdist's workers inherit it."""
    if SHARED_BUILDS not in os.environ:
        folder = tempfile.TemporaryDirectory(prefix="hsep_builds_")
        os.environ[SHARED_BUILDS] = folder.name
        config.add_cleanup(folder.cleanup)


@pytest.hookimpl(tryfirst=True)  # before pytest deselects by marker
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if is_slow(item.nodeid):
            item.add_marker("slow")
    items.sort(key=lambda item: runs_before(item.nodeid))


@pytest.fixture
def quick_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let ``fit`` judge one look-ahead alone."""
    without_other_windows(monkeypatch)


@pytest.fixture(autouse=True)
def _working_directory_kept() -> Iterator[None]:
    """Fail the test that leaves the process in another folder, and spare those after it."""
    before = Path.cwd()
    yield
    try:
        after: Path | str = Path.cwd()
    except FileNotFoundError:
        after = "a removed folder"
    os.chdir(before)
    assert after == before


@pytest.fixture(scope="session")
def session_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the test session, which all of xdist's workers share."""
    own = tmp_path_factory.getbasetemp()
    return own.parent if "PYTEST_XDIST_WORKER" in os.environ else own


@pytest.fixture(scope="session")
def fmus(session_folder: Path) -> BuiltFmus:
    """Any FMU of any machine by name, built once a session."""
    return BuiltFmus(session_folder / "fmus")


@pytest.fixture(scope="session")
def python_fmu(fmus: BuiltFmus) -> Callable[[str], Path]:
    """Return a function that gives the path of a pythonfmu FMU by name."""
    return fmus


@pytest.fixture(scope="session")
def folders(fmus: BuiltFmus) -> Callable[[str], Path]:
    """Return a function that gives the folder of an unpacked FMU by name, unpacked once a session."""

    def unpacked(name: str) -> Path:
        def unpack(folder: Path) -> None:
            with zipfile.ZipFile(fmus(name)) as archive:
                archive.extractall(folder)

        return built_once(fmus.folder.parent / "unpacked" / name, unpack)

    return unpacked


@pytest.fixture
def hybridsep(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    return Run(monkeypatch, capsys)
