"""Several source FMUs in one program: the FMI functions' names begin with the model identifier (FMI 2.0 and 3.0)."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import elf
import fmpy
import pytest
from c_compiler import FMI_HEADERS, run_compiler
from fmi_library import OK, Library, library_of, steps
from library_stream import trained_state

from hybridsep import build_fmu, paper_machine
from hybridsep.fmi.compile import FLAGS

MODELS = ("HybridPredictor", "FeedDrive", "ReferenceTrajectory")
WITHOUT_PREFIX = "#define fmi2FullName(name) name\n"
WITH_PREFIX = """#define fmi2Paste(a, b) a##b
#define fmi2PasteB(a, b) fmi2Paste(a, b)
#define fmi2FullName(name) fmi2PasteB(FMI2_FUNCTION_PREFIX, name)
"""

Folders = Callable[[str], Path]


@pytest.fixture(scope="module")
def headers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The standard's headers: fmpy's, with the prefix that fmpy took out of them."""
    folder = tmp_path_factory.mktemp("headers")
    for name in ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"):
        text = (FMI_HEADERS / name).read_text()
        assert WITHOUT_PREFIX in text or name != "fmi2Functions.h"
        (folder / name).write_text(text.replace(WITHOUT_PREFIX, WITH_PREFIX))
    return folder


def compiled(fmu: Path, headers: Path, out: Path, *flags: str) -> Path:
    """Return the object file of an unpacked FMU's sources."""
    built = out / f"{fmu.name}.o"
    given: list[str | Path] = [f"-I{fmu / 'sources'}", f"-I{headers}", "-c", fmu / "sources" / "all.c", "-o", built]
    run_compiler([*FLAGS, "-O0", "-fPIC", *flags, *given])
    return built


def shown(path: Path) -> list[str]:
    return [symbol.name for symbol in elf.symbols(path) if symbol.defined and symbol.exported]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "flags", "prefix", "n"),
    [
        ("ReferenceTrajectory", ("-DFMI2_FUNCTION_PREFIX=", "-O1"), "fmi2", 34),  # an importer may choose it
        ("FeedDriveFmi3", (), "FeedDriveFmi3_fmi3", 75),
        ("FeedDriveFmi3", ("-DFMI3_OVERRIDE_FUNCTION_PREFIX", "-O1"), "fmi3", 75),
    ],
)
def test_nothing_but_the_fmi_functions_has_external_linkage(
    folders: Folders, headers: Path, tmp_path: Path, name: str, flags: tuple[str, ...], prefix: str, n: int
) -> None:
    """And nothing is warned of, optimised, too: what gcc warns of it finds while it optimises."""
    names = shown(compiled(folders(name), FMI_HEADERS if "3" in name else headers, tmp_path, *flags))
    assert len(names) == n
    assert all(one.startswith(prefix) for one in names), names


@pytest.mark.slow
def test_three_fmus_in_one_program_compute_as_their_libraries(folders: Folders, headers: Path, tmp_path: Path) -> None:
    """Bit for bit, though with another optimisation, and the tables of their headers instead of files."""
    objects = [compiled(folders(model), headers, tmp_path) for model in MODELS]
    for model, path in zip(MODELS, objects, strict=True):
        names = shown(path)
        assert len(names) == 34
        assert all(name.startswith(f"{model}_fmi2") for name in names), names
    run_compiler(["-shared", *objects, "-lm", "-o", tmp_path / "three.so"])
    for model in MODELS:
        library, linked = library_of(folders(model)), library_of(folders(model))
        linked._dll = Linked(tmp_path / "three.so", model, library)
        resources = (folders(model) / "resources").as_uri() if model == "ReferenceTrajectory" else None
        assert trace(linked, resources) == trace(library, resources)


BARE = ("-DHSEP_NO_FILES", "-DHSEP_NO_STDIO", "-DHSEP_NO_MALLOC")
OF_A_SYSTEM = {"fopen", "fread", "strtod", "vsnprintf", "snprintf", "malloc", "calloc", "realloc", "free"}
MEMORY = """#include <stdlib.h>
void *hsep_target_calloc(size_t count, size_t size);
void hsep_target_free(void *block);
void *hsep_target_calloc(size_t count, size_t size) { return calloc(count, size); }
void hsep_target_free(void *block) { free(block); }
"""


@pytest.mark.slow
def test_a_source_fmu_starts_warm_without_a_system(headers: Path, tmp_path: Path) -> None:
    """Without files, printf and malloc, with the weights in its sources: as its library does with them in a file."""
    model, folder, machine = "HybridPredictor", tmp_path / "HybridPredictor", paper_machine("spring_mass_damper")
    weights = trained_state(model)
    fmu = build_fmu(machine, model, tmp_path / "built", targets=("host",), weights=weights, embed_weights=True)
    fmpy.extract(str(fmu), unzipdir=str(folder))
    built = compiled(folder, headers, tmp_path, *BARE)
    needed = {symbol.name for symbol in elf.symbols(built) if not symbol.defined}
    assert needed.isdisjoint(OF_A_SYSTEM)
    assert "hsep_target_calloc" in needed
    (tmp_path / "memory.c").write_text(MEMORY)
    run_compiler(["-shared", "-fPIC", built, tmp_path / "memory.c", "-lm", "-o", tmp_path / "bare.so"])
    library, linked = library_of(folder), library_of(folder)
    linked._dll = Linked(tmp_path / "bare.so", model, library)
    assert trace(linked, None) == trace(library, (folder / "resources").as_uri())


class Linked:
    """The functions of one of the FMUs in a program, declared as another library's."""

    def __init__(self, path: Path, model: str, declared: Library) -> None:
        self.program, self.model, self.declared = declared._dll.__class__(str(path)), model, declared

    def __getattr__(self, name: str) -> Any:
        function, like = getattr(self.program, f"{self.model}_{name}"), getattr(self.declared._dll, name)
        function.argtypes, function.restype = like.argtypes, like.restype
        return function


def trace(fmu: Library, resources: str | None) -> list[bytes]:
    """Return all Reals of an instance while it steps, and its state at the end."""
    instance = fmu.instantiate(resources=resources)
    assert fmu.begin(instance) == fmu.ExitInitializationMode(instance) == OK
    found = [fmu.reals(instance)]
    for k in range(0, 700, 50):
        if "x_d_ahead" in fmu.references:
            steps(fmu, instance, k, k + 50)
        for i in range(k, k + 50 if "x_d_ahead" not in fmu.references else k):
            if "x_d" in fmu.references:
                assert fmu.set(instance, "x_d", 1e-3 * (i % 100)) == OK
            assert fmu.do_step(instance, i * 1e-3, 1e-3) == OK
        found.append(fmu.reals(instance))
    assert len(set(found)) > 3
    found.append(fmu.save(instance))
    fmu.FreeInstance(instance)
    return found
