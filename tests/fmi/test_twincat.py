"""Sources for Beckhoff's TwinCAT: the configuration file, and C as Microsoft's compiler takes it.

Neither that compiler nor TE1420 is at hand: Clang compiles for its system with only the headers in tests/c/msvc.
"""

from pathlib import Path
from xml.etree import ElementTree

import fmpy
import pytest
from built_once import BuiltFmus
from c_compiler import FMI_HEADERS, run_compiler, zig
from command_line import Run
from library_stream import trained_state
from places import ROOT

from hybridsep.fmi.controllers import CONFIGURATION_FILE, DEFINITIONS

MICROSOFT = zig(
    *("-target", "x86_64-windows-msvc", "-fms-compatibility", "-Wmicrosoft"),
    *("-Wvla", "-nostdlibinc", f"-isystem{ROOT / 'tests' / 'c' / 'msvc'}"),
)


def unpacked(fmu: Path, folder: Path) -> Path:
    fmpy.extract(str(fmu), unzipdir=str(folder))
    return folder / "sources"


def built(hybridsep: Run, out: Path, *arguments: object) -> list[Path]:
    text = hybridsep.done(
        "build", *arguments, "-m", "spring_mass_damper", "--target", "host", "--for", "twincat", "--out", out
    )
    return [Path(line.rpartition("  ")[0]) for line in text.splitlines()]


@pytest.mark.slow
def test_the_configuration_lies_beside_the_fmus(hybridsep: Run, tmp_path: Path) -> None:
    """All FMUs of the machine but the one that plays files; what the file leaves out is what all.c includes."""
    *archives, configuration = built(hybridsep, tmp_path)
    assert configuration == tmp_path / CONFIGURATION_FILE
    assert {path.stem for path in archives} == {"HybridPredictor", "SepCompensator", "FeedDrive"}
    tool = ElementTree.parse(configuration).getroot().find("FmuConfiguration")
    assert tool is not None
    assert tool.findtext("ToolName") == fmpy.read_model_description(str(archives[0])).generationTool
    assert tool.findtext("PreprocessorDefinitions") == ";".join(DEFINITIONS)
    sources = unpacked(archives[0], tmp_path / "fmu")
    excluded = (tool.findtext("ExcludedFromBuild") or "").split(";")
    assert sorted([*excluded, "all.c"]) == sorted(path.name for path in sources.glob("*.c"))


@pytest.mark.slow
def test_weights_are_compiled_in(hybridsep: Run, tmp_path: Path) -> None:
    fmu, _ = built(hybridsep, tmp_path / "out", "SepCompensator", "--weights", trained_state("SepCompensator"))
    header = unpacked(fmu, tmp_path / "fmu") / "hsep_fmu.h"
    assert "hsep_embedded_weights" in header.read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("model", ["SepCompensator", "HybridPredictorFmi3"])
def test_a_compiler_for_windows_takes_the_sources(fmus: BuiltFmus, model: str, tmp_path: Path) -> None:
    """In these two are all functions of the core and of both versions of FMI."""
    sources = unpacked(fmus(model), tmp_path)
    given = [*(f"-D{name}" for name in DEFINITIONS), f"-I{sources}", f"-isystem{FMI_HEADERS}"]
    signed = "-Wno-sign-conversion"  # of enumerations, which are there
    run_compiler([*given, signed, "-c", sources / "all.c", "-o", tmp_path / "all.o"], command=MICROSOFT)
