"""FMU instances: closing, loading in threads, and the working directory of the process."""

import gc
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
import zipfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import fmpy.fmi1
import pytest
from built_once import BuiltFmus, changed

from hybridsep import FmuInstance
from hybridsep.base.errors import FmuError

TS = 1e-3
N_THREADS = 8


@pytest.fixture(scope="module")
def native(fmus: BuiltFmus) -> Path:
    return fmus("FeedDrive")


@pytest.fixture(params=["FeedDrive", "FeedDrivePy"], ids=["native", "python"])
def drive(request: pytest.FixtureRequest, fmus: BuiltFmus) -> Path:
    """The plant in both flavours."""
    return fmus(request.param)


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder in which temporary files are made."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def test_what_no_run_needs_is_not_unpacked(temporary: Path, native: Path) -> None:
    with FmuInstance(native):
        (unpacked,) = temporary.iterdir()
        there = {path.name for path in unpacked.iterdir()}
        assert {"binaries", "modelDescription.xml", "resources"} <= there
        assert not {"sources", "documentation"} & there


@pytest.fixture
def eager_threads() -> Iterator[None]:
    """Let threads give way as often as possible."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


# Closing -----------------------------------------------------------------------------------------------------------


def test_closing_again_does_nothing(drive: Path, temporary: Path) -> None:
    instance = FmuInstance(drive)
    instance.initialise()
    instance.step(0.0, TS)
    assert list(temporary.iterdir())
    for _ in range(3):
        instance.close()
    with instance:
        pass
    assert not list(temporary.iterdir())


def test_a_closed_instance_refuses_every_call(drive: Path) -> None:
    with FmuInstance(drive) as instance:
        instance.initialise()
        write, read = instance.real_stepper(["x_d"]), instance.reader(["x"])
        state = instance.save()
    calls: list[Callable[[], Any]] = [
        instance.initialise,
        lambda: instance.set("x_d", 0.0),
        lambda: instance.get("x"),
        lambda: write([0.0], 0.0, TS),
        read,
        lambda: instance.step(0.0, TS),
        instance.reset,
        instance.save,
        lambda: instance.restore(state),
        lambda: instance.slave,
    ]
    for call in calls:
        with pytest.raises(FmuError, match=r"the instance is closed; make a new FmuInstance"):
            call()
    assert instance.variables["x"].name == "x"


def test_a_forgotten_instance_is_closed(drive: Path, temporary: Path) -> None:
    instance = FmuInstance(drive)
    instance.initialise()
    del instance
    gc.collect()
    assert not list(temporary.iterdir())


def test_an_instance_may_be_open_when_python_exits(drive: Path, temporary: Path) -> None:
    """pythonfmu 0.7 releases its interpreter twice where its library is loaded at that time: the heap was corrupt."""
    script = f"""
from hybridsep import FmuInstance
instances = [FmuInstance({str(drive)!r}) for _ in range(3)]
for instance in instances:
    instance.initialise()
"""
    environment = os.environ | {"TMPDIR": str(temporary)}
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert not list(temporary.iterdir())


# What is no FMU ----------------------------------------------------------------------------------------------------


BINARIES, DESCRIPTION = "binaries/", "modelDescription.xml"


def below(prefix: str, change: Callable[[bytes], bytes | None]) -> Callable[[str, bytes], bytes | None]:
    """Return a change of the files whose names begin so."""
    return lambda name, content: change(content) if name.startswith(prefix) else content


UNREADABLE = r"Odd\.fmu is not a readable FMU: "


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (below(BINARIES, lambda content: b"none"), r"Odd\.fmu cannot be loaded: "),
        (
            below(BINARIES, lambda content: None),
            r"Odd\.fmu cannot be loaded: binaries/.*FeedDrive\S* is missing, there are binaries for none",
        ),
        (
            below(BINARIES, lambda content: content.replace(b"fmi2DoStep\0", b"fmi2DoStop\0")),
            r"Odd\.fmu cannot be loaded: .*undefined symbol: fmi2DoStep",
        ),
        (
            below(DESCRIPTION, lambda xml: re.sub(rb'guid="[^"]*"', b'guid="{0}"', xml)),
            r"Odd\.fmu cannot be instantiated: .*(?i:guid)",
        ),
        (below(DESCRIPTION, lambda xml: xml[:-40]), UNREADABLE),
        (
            below(DESCRIPTION, lambda xml: xml.replace(b'causality="input"', b'causality="exput"')),
            f"{UNREADABLE}.*causality",
        ),
        (
            below(DESCRIPTION, lambda xml: xml.replace(b"CoSimulation", b"ModelExchange")),
            r"is not a readable FMU|must be an FMI 2\.0 or 3\.0 co",
        ),
        (below(DESCRIPTION, lambda xml: None), rf"{UNREADABLE}.*modelDescription\.xml"),
    ],
)
def test_what_is_no_fmu_is_said_in_a_line_and_leaves_nothing_behind(
    native: Path, tmp_path: Path, temporary: Path, change: Callable[[str, bytes], bytes | None], message: str
) -> None:
    path, directory = changed(native, tmp_path / "Odd.fmu", change), Path.cwd()
    with pytest.raises(FmuError, match=message) as caught:
        FmuInstance(path)
    assert len(str(caught.value)) < 400
    assert "\n" not in str(caught.value)
    assert Path.cwd() == directory
    assert not list(temporary.iterdir())


def test_archives_that_are_cut_or_damaged(native: Path, fmus: BuiltFmus, tmp_path: Path, temporary: Path) -> None:
    content, path = bytearray(native.read_bytes()), tmp_path / "Cut.fmu"
    with pytest.raises(FmuError, match=r"no FMU at .*Cut.fmu; build it first"):
        FmuInstance(path)
    for kept in (0, 10, len(content) // 2, len(content) - 30):
        path.write_bytes(content[:kept])
        with pytest.raises(FmuError, match=r"Cut\.fmu is not a readable FMU: "):
            FmuInstance(path)
    # the description can be read, the binary's checksum is wrong
    with zipfile.ZipFile(native) as archive:
        largest = max(archive.infolist(), key=lambda info: info.compress_size)
    content[largest.header_offset + 200 + largest.compress_size // 2] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(FmuError, match=r"Cut\.fmu cannot be loaded: "):
        FmuInstance(path)
    changed(fmus("FeedDrivePy"), path, below("resources/machine.json", lambda data: None))
    with pytest.raises(FmuError, match=r"Cut\.fmu cannot be instantiated: "):
        FmuInstance(path)
    assert not list(temporary.iterdir())


def test_a_removed_working_directory_is_named(native: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gone").mkdir()
    os.chdir("gone")
    (tmp_path / "gone").rmdir()
    with pytest.raises(FmuError, match="the working directory of this process no longer exists"):
        FmuInstance(native)


# Threads -----------------------------------------------------------------------------------------------------------


def test_threads_load_without_moving_the_process(
    native: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, eager_threads: None
) -> None:
    """Relative paths, libraries that take a while to load, and some that cannot be loaded, in 8 threads at a time."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / native.name).write_bytes(native.read_bytes())
    unloadable = changed(native, tmp_path / "Unloadable.fmu", below(BINARIES, lambda content: b"none"))
    load = fmpy.fmi1.cdll.LoadLibrary

    def load_slowly(path: str) -> Any:
        time.sleep(1e-3)
        return load(path)

    monkeypatch.setattr(fmpy.fmi1.cdll, "LoadLibrary", load_slowly)
    together = threading.Barrier(N_THREADS)

    def run(i: int) -> float:
        together.wait()
        if i % 4 == 3:  # in the middle of the others
            with pytest.raises(FmuError, match="cannot be loaded"):
                FmuInstance(unloadable.name)
        with FmuInstance(native.name, f"thread {i}") as plant:
            plant.initialise()
            plant.set("x_d", 1e-3)
            plant.step(0.0, TS)
            return float(plant.get("x"))

    with ThreadPoolExecutor(N_THREADS) as pool:
        for _ in range(3):
            assert len(set(pool.map(run, range(N_THREADS)))) == 1
            assert Path.cwd() == tmp_path


def test_instances_in_threads_run_in_parallel(native: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """While one instance is in the middle of an FMI call, others are loaded, stepped and closed."""
    inside, go_on = threading.Event(), threading.Event()
    calloc = fmpy.calloc

    def wait_once(count: int, size: int) -> Any:
        if threading.current_thread() is thread and not inside.is_set():
            inside.set()
            go_on.wait()
        return calloc(count, size)

    monkeypatch.setattr(fmpy, "calloc", wait_once)
    thread = threading.Thread(target=lambda: FmuInstance(native).close())
    thread.start()
    try:
        while not inside.wait(timeout=0.1):
            assert thread.is_alive()
        with FmuInstance(native) as other:
            other.initialise()
            other.step(0.0, TS)
        assert thread.is_alive()
    finally:
        go_on.set()
        thread.join()
