"""Files that appear whole: whatever ends the writing, the old file is as it was."""

import os
import stat
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from hybridsep import HybridPredictor, ModalModel, build_fmu, load_machine
from hybridsep.base.files import atomic_open
from hybridsep.cosim.run import save_columns
from hybridsep.evaluate.figures import save_figure

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="POSIX only")
OLD = b"what was there before"


def test_new_content_appears_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "result.csv"
    path.write_bytes(OLD)
    with atomic_open(path) as file:
        file.write(b"new\r\n")
        file.flush()
        assert path.read_bytes() == OLD
    assert path.read_bytes() == b"new\r\n"
    assert list(tmp_path.iterdir()) == [path]


def fail_half_way(path: Path, error: type[BaseException]) -> None:
    with atomic_open(path) as file:
        file.write(b"half")
        raise error


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, MemoryError])
def test_an_exception_leaves_the_old_file(tmp_path: Path, error: type[BaseException]) -> None:
    path = tmp_path / "result.csv"
    path.write_bytes(OLD)
    for name in ("result.csv", "new.csv"):
        with pytest.raises(error):
            fail_half_way(tmp_path / name, error)
    assert path.read_bytes() == OLD
    assert list(tmp_path.iterdir()) == [path]


@POSIX
def test_permissions_links_and_umask(tmp_path: Path) -> None:
    path, link, hard = tmp_path / "result.csv", tmp_path / "link.csv", tmp_path / "hard.csv"
    path.write_bytes(OLD)
    path.chmod(0o640)
    link.symlink_to(path.name)
    hard.hardlink_to(path)
    with atomic_open(link) as file:
        file.write(b"new")
    assert link.is_symlink()
    assert path.read_bytes() == b"new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert hard.read_bytes() == OLD
    mask = os.umask(0o027)
    try:
        with atomic_open(tmp_path / "made.csv"):
            pass
    finally:
        os.umask(mask)
    assert stat.S_IMODE((tmp_path / "made.csv").stat().st_mode) == 0o640


@POSIX
def test_a_pipe_is_written_directly(tmp_path: Path) -> None:
    read, write = os.pipe()
    with atomic_open(f"/dev/fd/{write}") as file:
        file.write(b"through")
    os.close(write)
    assert os.read(read, 100) == b"through"
    os.close(read)


def test_what_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(OSError, match=r"Is a directory") as caught, atomic_open(tmp_path):
        pass
    assert caught.value.filename == str(tmp_path)
    assert list(tmp_path.iterdir()) == []


@POSIX
@pytest.mark.skipif(sys.platform != "win32" and os.geteuid() == 0, reason="root may write what is write-protected")
def test_a_write_protected_file_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "result.csv"
    path.write_bytes(OLD)
    path.chmod(0o444)
    with pytest.raises(PermissionError), atomic_open(path) as file:
        file.write(b"new")
    assert path.read_bytes() == OLD


# Every writer of the library, on a full disk -----------------------------------------------------------------------


def write_table(path: Path) -> None:
    save_columns({"t": np.arange(1000.0), "active": np.arange(1000) > 3}, path)


def write_figure(path: Path) -> None:
    figure = Figure()
    figure.subplots().plot(np.sin(np.arange(1000)))
    save_figure(figure, path)


WRITERS: dict[str, Callable[[Path], object]] = {
    "run.csv": write_table,
    "run.npz": write_table,
    "run.png": write_figure,
    "trained.state": lambda path: HybridPredictor(ModalModel.spring_mass_damper(1.0, 15.7, 24674.0)).save(path),
    "FeedDrivePy.fmu": lambda path: build_fmu(load_machine("spring_mass_damper"), path.stem, path.parent, "python"),
}


@pytest.fixture
def full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let no file become longer than 500 bytes: the next write fails with EFBIG, as it does with ENOSPC when full."""
    resource = pytest.importorskip("resource")
    monkeypatch.setattr("sys.dont_write_bytecode", True)  # a module's cut code would be imported ever after
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (500, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.usefixtures("full_disk")
def test_a_full_disk_costs_the_new_file_only(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(OLD)
    with pytest.raises(OSError, match="File too large") as caught:
        WRITERS[name](path)
    assert caught.value.filename == str(path)
    assert path.read_bytes() == OLD
    assert list(tmp_path.iterdir()) == [path]
