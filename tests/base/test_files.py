"""Files that appear whole: whatever ends the writing, the old file is as it was."""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from hybridsep import HybridPredictor, ModalModel, build_fmu, load_machine
from hybridsep.base import files
from hybridsep.base.files import written_text, written_whole
from hybridsep.cosim.run import save_columns
from hybridsep.evaluate.figures import save_figure

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="POSIX only")
OLD = b"what was there before"


def left_over(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if path.name.startswith(".hybridsep")]


def test_new_content_appears_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "result.csv"
    path.write_bytes(OLD)
    with written_text(path) as file:
        file.write("µ\r\n")
        file.flush()
        assert path.read_bytes() == OLD
    assert path.read_bytes() == "µ\r\n".encode()
    assert list(tmp_path.iterdir()) == [path]


def fail_half_way(path: Path, error: type[BaseException]) -> None:
    with written_text(path) as file:
        file.write("half")
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
    with written_whole(link) as file:
        file.write(b"new")
    assert link.is_symlink()
    assert path.read_bytes() == b"new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert hard.read_bytes() == OLD
    mask = os.umask(0o027)
    try:
        with written_whole(tmp_path / "made.csv"):
            pass
    finally:
        os.umask(mask)
    assert stat.S_IMODE((tmp_path / "made.csv").stat().st_mode) == 0o640


@POSIX
def test_a_pipe_is_written_directly(tmp_path: Path) -> None:
    read, write = os.pipe()
    with written_whole(f"/dev/fd/{write}") as file:
        file.write(b"through")
    os.close(write)
    assert os.read(read, 100) == b"through"
    os.close(read)


def test_what_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(OSError, match=r"Is a directory") as caught, written_whole(tmp_path):
        pass
    assert caught.value.filename == str(tmp_path)
    assert list(tmp_path.iterdir()) == []


@POSIX
@pytest.mark.skipif(sys.platform != "win32" and os.geteuid() == 0, reason="root may write what is write-protected")
def test_a_write_protected_file_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "result.csv"
    path.write_bytes(OLD)
    path.chmod(0o444)
    with pytest.raises(PermissionError), written_whole(path) as file:
        file.write(b"new")
    assert path.read_bytes() == OLD


# Every writer of the library, on a full disk -----------------------------------------------------------------------


def write_table(path: Path) -> None:
    save_columns({"t": np.arange(1000.0), "active": np.arange(1000) > 3}, path)


def write_figure(path: Path) -> None:
    figure = Figure()
    figure.subplots().plot(np.sin(np.arange(1000)))
    save_figure(figure, path)


def write_state(path: Path) -> None:
    HybridPredictor(ModalModel.spring_mass_damper(1.0, 15.7, 24674.0)).save(path)


def write_fmu(path: Path) -> None:
    build_fmu(load_machine("spring_mass_damper"), path.stem, path.parent, "python")


WRITERS = {
    "run.csv": write_table,
    "run.npz": write_table,
    "run.png": write_figure,
    "trained.state": write_state,
    "FeedDrivePy.fmu": write_fmu,
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


def in_a_namespace(*command: object) -> SimpleNamespace:
    """Run a command with its own mounts, or skip where that is not allowed."""
    unshare = ["unshare", "--user", "--map-root-user", "--mount", "--", *map(str, command)]
    try:
        return SimpleNamespace(**vars(subprocess.run(unshare, capture_output=True, text=True, check=False)))
    except OSError:
        pytest.skip("there is no unshare")


@pytest.mark.slow
def test_a_full_tmpfs_costs_the_new_file_only(tmp_path: Path) -> None:
    if in_a_namespace("mount", "-t", "tmpfs", "none", tmp_path).returncode:
        pytest.skip("a user may not mount a tmpfs here")
    disk = tmp_path / "disk"
    disk.mkdir()
    script = textwrap.dedent(f"""\
        import sys
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        import errno, pathlib
        from test_files import OLD, WRITERS, left_over
        disk = pathlib.Path({str(disk)!r})
        for name, write in WRITERS.items():
            (disk / name).write_bytes(OLD)
        try:
            (disk / "filler").write_bytes(bytes(1000000))
        except OSError:
            pass
        for name, write in WRITERS.items():
            try:
                write(disk / name)
            except OSError as error:
                assert error.errno == errno.ENOSPC, error
                assert error.filename == str(disk / name)
            else:
                raise SystemExit(name + " fits on the disk")
            assert (disk / name).read_bytes() == OLD, name
        assert not left_over(disk)
        """)
    shell = 'mount -t tmpfs -o size=32k none "$1" && exec "$2" -c "$3"'
    done = in_a_namespace("sh", "-c", shell, "sh", disk, sys.executable, script)
    assert done.returncode == 0, done.stderr


WRITE_FOR_EVER = """
import runpy, sys
written_whole = runpy.run_path(sys.argv[1])["written_whole"]
print("ready", flush=True)
while True:
    with written_whole(sys.argv[2]) as file:
        for _ in range(200):
            file.write(bytes([65]) * 5000)
            file.flush()
"""


@pytest.mark.slow
@POSIX
def test_a_killed_process_leaves_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "result.csv"
    path.write_bytes(OLD)
    whole = {OLD, b"A" * 1_000_000}
    assert files.__file__ is not None
    for moment in np.random.default_rng(0).uniform(0.0, 0.05, 12):
        process = subprocess.Popen([sys.executable, "-c", WRITE_FOR_EVER, files.__file__, path], stdout=subprocess.PIPE)
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(moment)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        assert path.read_bytes() in whole
    assert set(left_over(tmp_path)) == {other.name for other in tmp_path.iterdir()} - {path.name}
