"""Several source FMUs linked into one program: the FMI functions' names begin with the model identifier (FMI 2.0)."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from pathlib import Path

import elf
import fmpy
import numpy as np
import pytest
from built_once import BuiltFmus
from c_compiler import FMI_HEADERS, run_compiler
from places import ROOT

from hybridsep.base.signals import Array
from hybridsep.cosim.fmu import FmuInstance
from hybridsep.fmi.compile import FLAGS

ROLES = {"REFERENCE": "ReferenceTrajectory", "PREDICTOR": "HybridPredictor", "PLANT": "FeedDrive"}
MODELS = (*ROLES.values(), "SepCompensator")
STEPS = 800
WITHOUT_PREFIX = "#define fmi2FullName(name) name\n"
WITH_PREFIX = """#define fmi2Paste(a, b) a##b
#define fmi2PasteB(a, b) fmi2Paste(a, b)
#define fmi2FullName(name) fmi2PasteB(FMI2_FUNCTION_PREFIX, name)
"""


@pytest.fixture(scope="module")
def archives(fmus: BuiltFmus, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The FMUs of one machine, each with its unpacked archive beside it."""
    out = tmp_path_factory.mktemp("static")
    copies = {model: Path(shutil.copy(fmus(model), out)) for model in MODELS}
    for path in copies.values():
        with zipfile.ZipFile(path) as archive:
            archive.extractall(path.with_suffix(""))
    return copies


@pytest.fixture(scope="module")
def headers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The standard's headers: fmpy's, with the prefix that fmpy took out of them."""
    folder = tmp_path_factory.mktemp("headers")
    for name in ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"):
        text = (FMI_HEADERS / name).read_text()
        if name == "fmi2Functions.h":
            assert WITHOUT_PREFIX in text
            text = text.replace(WITHOUT_PREFIX, WITH_PREFIX)
        (folder / name).write_text(text)
    return folder


def compile_all(fmu: Path, headers: Path, out: Path, *flags: str) -> Path:
    """Return the object file of an FMU's sources."""
    built = out / f"{fmu.stem}.o"
    sources = fmu.with_suffix("") / "sources"
    run_compiler(
        [
            *FLAGS,
            *flags,
            f"-I{sources}",
            f"-I{headers}",
            "-c",
            sources / "all.c",
            "-o",
            built,
        ]
    )
    return built


def wiring(archives: dict[str, Path]) -> str:
    """Return wiring.h: GUIDs and value references."""
    lines = []
    for role, model in ROLES.items():
        description = fmpy.read_model_description(str(archives[model]))
        lines.append(f'#define {role}_GUID "{description.guid}"')
        ports = [v for v in description.modelVariables if v.causality in ("input", "output")]
        lines += [f"#define {role}_{port.name} {port.valueReference}" for port in ports]
    return "\n".join(lines) + "\n"


def run_shared(archives: dict[str, Path]) -> Array:
    """Return what three_fmus.c prints, ``(STEPS, 4)``, from the shared libraries."""
    rows, h = [], 1e-3
    with (
        FmuInstance(archives["ReferenceTrajectory"]) as reference,
        FmuInstance(archives["HybridPredictor"]) as predictor,
        FmuInstance(archives["FeedDrive"]) as plant,
    ):
        for instance in (reference, predictor, plant):
            instance.initialise()
        for k in range(STEPS):
            r, x_d, x_meas = reference.get("r"), predictor.get("x_d"), plant.get("x_meas")
            rows.append((r, x_d, predictor.get("x_h"), x_meas))
            predictor.set("x_d_ahead", r)
            predictor.set("x_meas", x_meas)
            plant.set("x_d", x_d)
            for instance in (reference, predictor, plant):
                instance.step(k * h, h)
    return np.array(rows)


@pytest.mark.slow
@pytest.mark.parametrize(
    "model", ["SepCompensator", *(pytest.param(model, marks=pytest.mark.nightly) for model in ROLES.values())]
)
def test_nothing_but_the_fmi_functions_has_external_linkage(
    archives: dict[str, Path], headers: Path, tmp_path: Path, model: str
) -> None:
    symbols = elf.symbols(compile_all(archives[model], headers, tmp_path, "-O0"))
    shown = [symbol.name for symbol in symbols if symbol.defined and symbol.exported]
    assert len(shown) == 34
    assert all(name.startswith(f"{model}_fmi2") for name in shown), shown


@pytest.mark.slow
@pytest.mark.parametrize(("flags", "prefix"), [((), "FeedDriveFmi3_"), (("-DFMI3_OVERRIDE_FUNCTION_PREFIX",), "")])
def test_fmi_3_has_the_prefix_of_its_own_headers(
    fmus: BuiltFmus, tmp_path: Path, flags: tuple[str, ...], prefix: str
) -> None:
    path = Path(shutil.copy(fmus("FeedDriveFmi3"), tmp_path))
    with zipfile.ZipFile(path) as archive:
        archive.extractall(path.with_suffix(""))
    symbols = elf.symbols(compile_all(path, FMI_HEADERS, tmp_path, "-O0", *flags))
    shown = [symbol.name for symbol in symbols if symbol.defined and symbol.exported]
    assert len(shown) == 75
    assert all(name.startswith(f"{prefix}fmi3") for name in shown), shown


@pytest.mark.slow
def test_an_importer_may_choose_the_prefix(archives: dict[str, Path], headers: Path, tmp_path: Path) -> None:
    built = compile_all(archives["ReferenceTrajectory"], headers, tmp_path, "-DFMI2_FUNCTION_PREFIX=")
    shown = [symbol.name for symbol in elf.symbols(built) if symbol.defined and symbol.exported]
    assert len(shown) == 34
    assert all(name.startswith("fmi2") for name in shown)


@pytest.mark.slow
def test_three_fmus_run_in_one_program(archives: dict[str, Path], headers: Path, tmp_path: Path) -> None:
    # Another optimisation than the libraries', to whose bits it comes all the same
    objects = [compile_all(archives[model], headers, tmp_path, "-O0") for model in MODELS]
    (tmp_path / "wiring.h").write_text(wiring(archives))
    program = tmp_path / "three_fmus"
    host = ROOT / "tests" / "c" / "three_fmus.c"
    run_compiler([f"-I{tmp_path}", f"-I{headers}", host, *objects, "-lm", "-o", program])
    resources = (archives["ReferenceTrajectory"].with_suffix("") / "resources").as_uri()
    done = subprocess.run([program, str(STEPS), resources], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    printed = [[float.fromhex(number) for number in line.split()] for line in done.stdout.splitlines()]
    shared = run_shared(archives)
    assert np.ptp(shared, axis=0).min() > 1e-3  # m: the trajectory, and the plant behind it, have moved
    np.testing.assert_array_equal(np.array(printed), shared)
