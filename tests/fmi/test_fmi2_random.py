"""The native FMUs' sources: random calls under sanitizers, and each file compiled alone."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import fuzz_fmi2
import fuzz_fmi3
import pytest
from c_compiler import C_SOURCES, FMI_HEADERS, address_sanitizer, needs_sanitisers, run_compiler, sanitising_compiler
from c_core import STAGE_DRIVE
from places import ROOT

from hybridsep.fmi.native import sources
from hybridsep.fmi.variables import FmuTable
from hybridsep.machines.machine import load_machine

FUZZED = {
    "HybridPredictor": 3,
    "SepCompensator": 3,
    "FeedDrive": 1,
    "FeedDrive_als25010_x": 1,
    "ReferenceTrajectory": 1,
    "HybridPredictorFmi3": 2,
}
"""Duration of the random calls of each model, s; of FMI 3.0's that with arrays, as what they compute is the same."""
EACH_SOURCE = ("SepCompensator", "FeedDrive_als25010_x", "HybridPredictorFmi3")
"""Among them are all functions of both versions, all of the core but a player's, and each kind of state."""

COUNTED = ROOT / "tests" / "c" / "counted.h"
SANITIZERS = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")


@needs_sanitisers
@pytest.mark.slow
@pytest.mark.parametrize(
    ("models", "share"), [(EACH_SOURCE, 0.3), pytest.param(tuple(FUZZED), 3.0, marks=pytest.mark.nightly)]
)
def test_random_calls_under_sanitizers(
    folders: Callable[[str], Path], tmp_path: Path, models: tuple[str, ...], share: float
) -> None:
    """All models at the same time, so that it takes no longer than one."""
    compiler = sanitising_compiler()
    environment = {
        **os.environ,
        "LD_PRELOAD": address_sanitizer(compiler),
        "ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1",  # Python's own leaks; ours are counted
        "UBSAN_OPTIONS": "print_stacktrace=1",
    }

    def findings(name: str) -> str:
        folder = folders(name) / "sources"
        library, resources = tmp_path / f"{name}.so", folders(name) / "resources"
        files: list[str | Path] = [f"-I{folder}", f"-I{FMI_HEADERS}", folder / "all.c", "-lm", "-o", library]
        fmi3 = "Fmi3" in name
        flags = ["-DFMI3_OVERRIDE_FUNCTION_PREFIX", "-include", str(COUNTED)] if fmi3 else []
        # Optimised, they would take four times as long to compile, and run no faster beside Python
        run_compiler(["-O0", "-g", *flags, *SANITIZERS, "-fPIC", "-shared", *files], command=compiler)
        fuzzer, place = (fuzz_fmi3, f"{resources}/") if fmi3 else (fuzz_fmi2, resources.as_uri())
        command = [sys.executable, str(fuzzer.__file__), str(library), str(folders(name) / "modelDescription.xml")]
        command += [place, "--seconds", str(share * FUZZED[name]), "--seed", "1"]
        result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        held = result.returncode == 0 and "no finding" in result.stdout
        return "" if held else f"{name}: {result.stdout}{result.stderr}"

    with ThreadPoolExecutor(len(models)) as pool:
        assert not "".join(pool.map(findings, models))


GCC, CLANG = ["gcc"], [sys.executable, "-m", "ziglang", "cc"]


def compiled_by(compiler: list[str], model: str, fmi: str, *, at_night: bool = False) -> Any:
    marks = [pytest.mark.nightly] if at_night else []
    if compiler == GCC:
        marks.append(pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc"))
    return pytest.param(compiler, model, fmi, marks=marks, id=f"{model}-{fmi}-{'gcc' if compiler == GCC else 'clang'}")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("compiler", "model", "fmi"),
    [
        # The core by clang once; by gcc the other tests of the C core compile it file by file
        compiled_by(CLANG, "HybridPredictor", "2"),
        compiled_by(GCC, "SepCompensator", "2"),
        compiled_by(GCC, "FeedDrive", "2"),
        compiled_by(GCC, "HybridPredictor", "3"),
        compiled_by(GCC, "HybridPredictor", "2", at_night=True),
        compiled_by(CLANG, "SepCompensator", "2", at_night=True),
        compiled_by(CLANG, "FeedDrive", "2", at_night=True),
        compiled_by(CLANG, "HybridPredictor", "3", at_night=True),
    ],
)
def test_each_source_compiles_alone_without_warnings(tmp_path: Path, compiler: list[str], model: str, fmi: str) -> None:
    mode = {"f_n": 25.0, "zeta": 0.05, "alpha": 1.0, "beta": 0.0}
    table = FmuTable("FeedDrive", "Stage", STAGE_DRIVE, (mode,))
    if model != "FeedDrive":
        machine = load_machine("spring_mass_damper")
        values = machine.fmi_parameters() if model == "HybridPredictor" else machine.fmi_compensator_parameters()
        table = FmuTable(model, model, values, (mode,))
    for file, content in sources(table, "{}", fmi).items():
        (tmp_path / file).write_bytes(content)
    # The core knows nothing of the model, and what is not an adapter nothing of FMI: compiled with the first of them
    core = {path.name for path in (C_SOURCES / "core").rglob("*.c")} if model != "HybridPredictor" else set()
    adapter = {path.name for path in (C_SOURCES / f"fmi{fmi}").glob("*.c")}
    files = sorted(path for path in tmp_path.glob("*.c") if path.name not in core)
    if fmi == "3":
        files = [path for path in files if path.name in adapter]
        assert len(files) >= 4

    # What gcc warns of it finds while it optimises; clang finds it before, and would take twice the time
    optimised = "-O1" if compiler == ["gcc"] else "-O0"

    def compile_alone(path: Path) -> None:
        # FMI 3.0's own header has two declarations that clang warns of
        run_compiler([optimised, "-isystem", FMI_HEADERS, "-c", path, "-o", path.with_suffix(".o")], command=compiler)

    with ThreadPoolExecutor() as pool:
        list(pool.map(compile_alone, files))
