"""The native FMUs' sources under sanitizers: random calls and tables."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fuzz_fmi
import pytest
from c_compiler import C_SOURCES, SANITISED, address_sanitizer, needs_sanitisers, run_compiler, sanitising_compiler
from c_core import object_files
from places import ROOT

from hybridsep.fmi.compile import _sources

FUZZED = {
    "SepCompensator": 0.9,
    "FeedDrive_als25010_x": 0.3,
    "HybridPredictorFmi3": 0.6,
    "ReferenceTrajectory": 0.3,
    "HybridPredictor": 0.9,
    "FeedDrive": 0.3,
    "FeedDriveFmi3": 0.3,
}
"""Duration of the random calls of each FMU, s. The first four, which a contributor's run has, have all functions of
both versions, all of the core, and each kind of state."""

COUNTED = ROOT / "tests" / "c" / "counted.h"


@needs_sanitisers
@pytest.mark.slow
@pytest.mark.parametrize(
    ("models", "factor"), [(list(FUZZED)[:4], 1), pytest.param(list(FUZZED), 20, marks=pytest.mark.nightly)]
)
def test_random_calls_under_sanitizers(
    folders: Callable[[str], Path], tmp_path: Path, models: list[str], factor: float
) -> None:
    """One process for all FMUs: under sanitizers it takes a second to begin."""
    compiler = sanitising_compiler()
    core = object_files(SANITISED, tuple(compiler))
    environment = {
        **os.environ,
        "LD_PRELOAD": address_sanitizer(compiler),
        "ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1",  # Python's own leaks; ours are counted
        "UBSAN_OPTIONS": "print_stacktrace=1",
    }

    def built(name: str) -> Path:
        folder, source = tmp_path / name, tmp_path / f"{name}_sources"
        shutil.copytree(folders(name), folder, ignore=shutil.ignore_patterns("sources", "documentation"))
        (library,) = (folder / "binaries").glob("*linux*/*.so")
        source.mkdir()
        kind = name.replace("Fmi3", "") if "als25010" not in name else "StageDrive"
        for file, content in _sources(kind).items():
            (source / file).write_bytes(content)
        # All that depends on the kind, as one file, with the core that the C tests have under sanitizers too
        rest = source / "rest.c"
        own = {path.name for path in C_SOURCES.rglob("*.c")} - {f"{Path(built).stem}.c" for built in core}
        rest.write_text("".join(f'#include "{path.name}"\n' for path in sorted(source.glob("*.c")) if path.name in own))
        files: list[str | Path] = ["-include", COUNTED, f"-I{source}", rest, *core, "-lm", "-ldl", "-o", library]
        run_compiler([*SANITISED, "-D_GNU_SOURCE", "-shared", *files], command=compiler)
        return folder

    with ThreadPoolExecutor(len(models)) as pool:
        command = [sys.executable, fuzz_fmi.__file__, *map(str, pool.map(built, models)), "--seed", "1", "--seconds"]
    command += [str(factor * FUZZED[name]) for name in models]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stdout.count("no finding") == len(models)
