"""The C sources themselves: what they need, that they compile, what the sanitisers say."""

import shutil
import subprocess
import sys
from pathlib import Path

import c_core
import elf
import pytest
import staircase_data as staircase
from c_compiler import (
    C_SOURCES,
    SANITISED,
    build_folder,
    include_flags,
    needs_sanitisers,
    run_compiler,
    sanitising_compiler,
)
from c_core import write_trajectory
from places import ROOT

from hybridsep.fmi.c_header import all_c

SUFFIXES = (".c", ".h", ".cpp")


@pytest.mark.slow
def test_the_c_files_are_formatted() -> None:
    command = shutil.which("clang-format", path=str(Path(sys.executable).parent))
    assert command, "clang-format is missing: pip install -e '.[test]'"
    files = [
        path
        for folder in ("fmu_src", "tests", "benchmarks", "integrations", "docs")
        for path in (ROOT / folder).rglob("*.*")
        if path.suffix in SUFFIXES
    ]
    assert len(files) > 60
    done = subprocess.run([command, "--dry-run", "--Werror", *files], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert [path for path in files if max(map(len, path.read_text(encoding="utf-8").splitlines())) > 120] == []


@pytest.mark.slow
def test_the_core_needs_libm_alone() -> None:
    # No allocation, no file, no global: nothing but these is undefined in it, and nothing in it is writable.
    allowed = {"memcpy", "memmove", "memset", "memcmp", "strcmp", "strncmp", "bcmp"}  # bcmp: compilers' for memcmp
    allowed |= {"sqrt", "log", "exp", "pow", "sin", "cos", "sincos", "tanh", "ldexp", "frexp", "floor", "nextafter"}
    allowed |= {"ceil", "fmax", "fmin"}
    core = {path.stem for path in (C_SOURCES / "core").rglob("*.c")}
    for built in c_core.object_files():
        if Path(built).stem not in core:
            continue
        for symbol in elf.symbols(Path(built)):
            known = symbol.name in allowed or symbol.name.startswith(("hsep_", "_GLOBAL_OFFSET_TABLE_", "__stack_chk"))
            assert symbol.defined or known, f"{built} uses {symbol.name}"
            assert not symbol.writable, f"{built} has the writable {symbol.name}"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["compensator_2", "trajectory"])
def test_everything_compiles_as_one_file(name: str) -> None:
    """Optimised once: the models differ in a table and in which of the core's functions they call."""
    folder = build_folder() / f"all_{name}"
    c_core.write_header(name, folder)
    everything = folder / "all.c"
    everything.write_text(all_c(c_core.sources()))
    level = "-O3" if name == "compensator_2" else "-O0"
    run_compiler([level, f"-I{folder}", *include_flags(), "-c", everything, "-o", folder / "all.o"])


@needs_sanitisers
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        (
            "predictor_2",
            [
                *(["input_hold=1", "t_init=0"], ["Np=1", "p=1", "q=0"], ["p=100", "q=99", "lambda=1e-20"]),
                *(["averaging=1", "Np=7", "p=7", "q=6"], ["averaging=1", "Np=150", "p=2", "q=0", "dead_time=13"]),
            ],
        ),
        (
            "compensator",
            [
                ["Np=12", "p=7", "q=5", "spacing=3", "preview=77", "dead_time=13", "t_init=0"],
                ["spacing=50", "preview=303", "compensate=1"],
                ["averaging=1", "Np=50", "p=20", "t_init=-1", "v_max=0.08", "a_max=8", "j_max=1000"],
                ["averaging=1", "Np=12", "p=7", "q=2", "spacing=3", "preview=77", "measurement_delay=7", "t_init=0"],
            ],
        ),
        ("feed_drive", [[]]),
        ("stage_drive", [[]]),
        ("trajectory", [[]]),
    ],
)
def test_the_sanitisers_find_nothing(name: str, arguments: list[list[str]], tmp_path: Path) -> None:
    folder = build_folder() / f"sanitise_{name}"
    c_core.write_header(name, folder)
    program, command = folder / "sanitise", tuple(sanitising_compiler())
    if not program.exists():
        files: list[str | Path] = [
            *c_core.model_sources(),
            ROOT / "tests" / "c" / "sanitise.c",
            *c_core.object_files(SANITISED, command),
        ]
        flags: list[str | Path] = [*SANITISED, f"-I{folder}", *include_flags()]
        run_compiler([*flags, *files, "-lm", "-o", program], command=command)
    write_trajectory(tmp_path, staircase.commanded()[:360])
    for pairs in arguments:
        done = subprocess.run([program, f"{tmp_path}/", *pairs], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
