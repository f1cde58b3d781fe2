"""Set up what every test shares."""

import gc
import os
import signal
import sys
import tempfile

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

import fmpy
import pytest
from built_once import SHARED_BUILDS, BuiltFmus, built_once
from command_line import Run
from properties import LEFT_OUT, take_profile
from quick_fits import with_short_references, without_larger_structures, without_other_settings

sys.dont_write_bytecode = False  # of this process too


def pytest_configure(config: pytest.Config) -> None:
    """Give all processes of the session a folder for what they build; xdist's workers inherit it."""
    take_profile(all_of_them=_asked_for(config, "nightly"))
    if SHARED_BUILDS not in os.environ:
        folder = tempfile.TemporaryDirectory(prefix="hsep_builds_")
        os.environ[SHARED_BUILDS] = folder.name
        config.add_cleanup(folder.cleanup)


def _asked_for(config: pytest.Config, mark: str) -> bool:
    """Return whether a mark is named in ``-m``, or tests are named one by one."""
    return mark in config.getoption("markexpr") or any("::" in argument for argument in config.args)


@pytest.hookimpl(tryfirst=True)  # before pytest deselects by marker
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what runs at night or at a release only, where it is not asked for; the longest test is first."""
    others = [mark for mark in LEFT_OUT if not _asked_for(config, mark)]
    left_out = [item for item in items if any(item.get_closest_marker(mark) for mark in others)]
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in set(left_out)]
    items.sort(key=lambda item: item.path.name != "test_types.py")  # mypy takes longest: not alone at the end


def pytest_collection_finish() -> None:
    """Spare the garbage collector the modules and tests, a quarter of a second each time."""
    gc.freeze()


@pytest.fixture
def quick_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let ``fit`` try small structures and the default settings."""
    without_larger_structures(monkeypatch)
    without_other_settings(monkeypatch)


@pytest.fixture
def short_references(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let FMUs that a test builds have short reference runs."""
    with_short_references(monkeypatch)


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
def folders(fmus: BuiltFmus) -> Callable[[str], Path]:
    """Return a function that gives the folder of an unpacked FMU by name, unpacked once a session."""

    def unpacked(name: str) -> Path:
        archive = str(fmus(name))
        return built_once(fmus.folder.parent / "unpacked" / name, lambda folder: fmpy.extract(archive, str(folder)))

    return unpacked


@pytest.fixture
def hybridsep(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    return Run(monkeypatch, capsys)
