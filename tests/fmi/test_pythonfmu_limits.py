"""Calls that pythonfmu's binary does not check and the slave refuses, and what the FMU's page says of the others."""

from __future__ import annotations

import os
import re
import struct
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

import fmpy
import pytest
import pythonfmu_calls
from c_compiler import run_compiler
from elf import symbols
from places import ROOT
from pythonfmu_calls import CAUGHT

from hybridsep import FmuInstance, build_fmu, load_machine
from hybridsep.base.errors import FmuError
from hybridsep.fmi.python import checked_version

Fmu = Callable[[str], Path]

HOST = ROOT / "tests" / "c" / "host.c"


@pytest.fixture
def folder(python_fmu: Fmu, tmp_path: Path) -> Path:
    with zipfile.ZipFile(python_fmu("FeedDrivePy")) as archive:
        archive.extractall(tmp_path / "unpacked")
    return tmp_path / "unpacked"


needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="the calls are made to pythonfmu's binary for Linux")


@needs_linux
@pytest.mark.parametrize("case", CAUGHT)
def test_what_the_slave_catches(folder: Path, case: str) -> None:
    """Each call in a process of its own; where there is no logging the text of a refusal goes to stderr."""
    command = [sys.executable, pythonfmu_calls.__file__, str(folder), case]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stdout.strip()) == (0, "survived"), done.stderr
    if case == "refusals_with_logging_off":
        assert re.search(r": the communication step size must be .*, got nan$", done.stderr, re.MULTILINE)
        assert re.search(r": the start time must be finite, got nan s$", done.stderr, re.MULTILINE)


@needs_linux
@pytest.mark.skipif(not sysconfig.get_config_var("Py_ENABLE_SHARED"), reason="this Python has no shared libpython")
def test_an_importer_without_python_can_be_given_one(python_fmu: Fmu, folder: Path, tmp_path: Path) -> None:
    """As docs/howto/run-fmus.md says: a C program plays the FMU, and cannot without."""
    host, headers = tmp_path / "host", Path(fmpy.__file__).with_name("c-code")
    run_compiler([f"-I{headers}", "-D_GNU_SOURCE", HOST, "-ldl", "-o", host])
    signals = tmp_path / "signals"
    signals.write_bytes(struct.pack("<20d", *(1e-4 * k for k in range(20))))
    (binary,) = (folder / "binaries" / "linux64").iterdir()
    guid = ET.parse(folder / "modelDescription.xml").getroot().get("guid")
    command = [host, binary, guid, f"file://{folder / 'resources'}", "0.001", "1", "0", "1", signals]
    alone = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert "cannot load" in alone.stderr
    given = {
        "LD_PRELOAD": str(Path(sysconfig.get_config_var("LIBDIR")) / sysconfig.get_config_var("LDLIBRARY")),
        "PYTHONHOME": sys.base_prefix,
        "PYTHONPATH": ":".join(path for path in sys.path if path.endswith("site-packages")),
    }
    played = subprocess.run(list(map(str, command)), capture_output=True, text=True, env=os.environ | given)
    assert played.returncode == 0, played.stderr
    shown = [float.fromhex(line) for line in played.stdout.split()]
    with FmuInstance(python_fmu("FeedDrivePy")) as fmu:
        fmu.initialise()
        expected = []
        for k in range(20):
            fmu.set("x_d", 1e-4 * k)
            fmu.step(k * 1e-3, 1e-3)
            expected.append(fmu.get("x"))
    assert shown == expected, played.stderr


@needs_linux
def test_the_interpreter_is_given_up_before_the_process_ends(folder: Path) -> None:
    """Else two destructors of pythonfmu's binary do, the second one in memory that is free."""
    (binary,) = (folder / "binaries" / "linux64").iterdir()
    places = {symbol.name: symbol.value for symbol in symbols(binary)}
    state = places["_ZN12_GLOBAL__N_17pyStateE"] - places["finalizePythonInterpreter"]
    program = f"""
import atexit, ctypes, fmpy
library = ctypes.CDLL({str(binary)!r})
place = ctypes.cast(library.finalizePythonInterpreter, ctypes.c_void_p).value + {state}
held = lambda: any(ctypes.string_at(place, 16))
atexit.register(lambda: print("held at the end:", held()))
fmpy.simulate_fmu({str(folder)!r}, stop_time=0.01, output_interval=1e-3)
print("held before:", held())
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n")[:2] == ["held before: True", "held at the end: False"], done.stderr


def test_the_page_names_the_version(folder: Path) -> None:
    page = (folder / "documentation" / "index.html").read_text(encoding="utf-8")
    assert f"Limits of pythonfmu {checked_version()}" in page
    assert "the GUID and the type" in page
    assert "whether a state has been freed already" in page
    assert "the bytes that <code>fmi2DeSerializeFMUstate</code> gets" in page


def test_only_the_pythonfmu_that_the_slave_was_made_for_is_packed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.metadata.version", lambda name: "0.8.0")
    with pytest.raises(FmuError, match=r"pythonfmu must be 0\.7\.x, .*, got 0\.8\.0; pip install 'pythonfmu~=0\.7\.0'"):
        build_fmu(load_machine("spring_mass_damper"), "FeedDrivePy", tmp_path, "python")
    assert not list(tmp_path.iterdir())


# Our own importer --------------------------------------------------------------------------------------------------


def test_a_blank_in_a_folder_is_read(python_fmu: Fmu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "two words"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    with FmuInstance(python_fmu("FeedDrivePy")) as instance:
        instance.initialise()


def test_our_importer_says_a_refusal_once(python_fmu: Fmu, capfd: pytest.CaptureFixture[str]) -> None:
    with FmuInstance(python_fmu("FeedDrivePy")) as instance:
        instance.initialise()
        with pytest.raises(FmuError, match="the communication step size must be"):
            instance.step(0.0, float("nan"))
    assert capfd.readouterr().err == ""


def test_our_importer_leaves_no_removed_folder_in_the_path(python_fmu: Fmu) -> None:
    before = list(sys.path)
    for _ in range(2):
        with FmuInstance(python_fmu("FeedDrivePy")) as instance:
            instance.initialise()
            assert sys.path != before
        assert sys.path == before
