"""The C sources themselves: what they need, and that they compile."""

import shutil
import sys
from pathlib import Path

import c_core
import elf
import pytest
from c_compiler import C_SOURCES, build_folder, include_flags, run_compiler
from places import ROOT
from programs import output_of
from stream import COMPENSATOR, TRAJECTORY

from hybridsep.fmi.c_header import all_c


@pytest.mark.slow
def test_the_c_files_are_formatted() -> None:
    command = shutil.which("clang-format", path=str(Path(sys.executable).parent))
    assert command, "clang-format is missing: pip install -e '.[test]'"
    files = [
        path
        for folder in ("fmu_src", "tests", "benchmarks", "integrations", "docs")
        for path in (ROOT / folder).rglob("*.*")
        if path.suffix in (".c", ".h", ".cpp")
    ]
    assert len(files) > 60
    output_of(command, "--dry-run", "--Werror", *files)
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
@pytest.mark.parametrize("name", [COMPENSATOR, TRAJECTORY])
def test_everything_compiles_as_one_file(name: str) -> None:
    """Optimised once: the models differ in a table and in which of the core's functions they call."""
    folder = build_folder() / f"all_{name}"
    c_core.write_header(name, folder)
    everything = folder / "all.c"
    everything.write_text(all_c(c_core.sources()))
    level = "-O3" if name == COMPENSATOR else "-O0"
    run_compiler([level, f"-I{folder}", *include_flags(), "-c", everything, "-o", folder / "all.o"])
