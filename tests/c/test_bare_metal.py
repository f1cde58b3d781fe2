"""A source FMU on a processor without an operating system: no files, no printf, no malloc, a warm start."""

import subprocess
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from c_compiler import FMI_HEADERS
from controllers import target_or_skip
from places import ROOT

from benchmarks.targets.targets import Target, program, run
from hybridsep import backtest, build_fmu, load_machine
from hybridsep.base.signals import Array
from hybridsep.plants.plant import Encoder, simulate
from hybridsep.plants.trajectory import staircase

pytestmark = [pytest.mark.nightly, pytest.mark.slow]

MACHINE = load_machine("spring_mass_damper").changed("predictor", {"Np": 20, "p": 20})
ARX_COMMAND = staircase()[:400]
BARE = ("-DHSEP_NO_FILES", "-DHSEP_NO_STDIO", "-DHSEP_NO_MALLOC")
OF_A_SYSTEM = {"fopen", "fread", "strtod", "vsnprintf", "snprintf", "malloc", "calloc", "realloc", "free"}


def measured() -> Array:
    return Encoder(5e-6, 7).measure_all(simulate(MACHINE.new_plant(), ARX_COMMAND, MACHINE.T_s))


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    predictor = MACHINE.new_predictor()
    backtest(predictor, ARX_COMMAND, measured())
    path = tmp_path_factory.mktemp("trained") / "trained.state"
    predictor.save(path)
    return path


def fmu_program(target: Target, folder: Path, *options: str, weights: Path | None = None, embedded: bool) -> Path:
    """Return a program that plays the command on a source FMU, compiled for a target."""
    fmu = build_fmu(
        MACHINE, "HybridPredictor", folder, targets=("host",), weights=weights, windows=False, embed_weights=embedded
    )
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder / "fmu")
    description = fmpy.read_model_description(str(fmu))
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    location = "NULL" if embedded or weights is None else f'"{(folder / "fmu" / "resources").as_uri()}"'
    x_meas = np.concatenate((np.full(20, ARX_COMMAND[0]), measured()))
    rows = ", ".join(f"{{{x_d!r}, {x!r}}}" for x_d, x in zip(ARX_COMMAND.tolist(), x_meas.tolist(), strict=False))
    lines = [f'#define GUID "{description.guid}"', f"#define RESOURCES {location}"]
    lines += [f"#define VR_{name} {references[name]}" for name in ("x_d_ahead", "x_meas", "x_h")]
    lines += [f"static const double samples[{len(ARX_COMMAND)}][2] = {{{rows}}};"]
    (folder / "wiring.h").write_text("\n".join(lines) + "\n")
    sources = folder / "fmu" / "sources"
    given = [ROOT / "tests" / "c" / "bare_fmu.c", sources / "all.c"]
    flags = (*options, f"-I{sources}", f"-I{FMI_HEADERS}", "-DFMI2_FUNCTION_PREFIX=")
    return program(target, given, folder, plain_math=True, options=flags)


def names(target: Target, path: Path) -> set[str]:
    """Return the names of the functions in a program, newlib's reentrant ones without their prefix."""
    listed = subprocess.run([target.nm, path], capture_output=True, text=True, check=True).stdout
    return {line.split()[-1].strip("_").removesuffix("_r") for line in listed.splitlines()}


def outputs(target: Target, path: Path) -> list[str]:
    """Return the lines with outputs; others are messages of the log."""
    return [line for line in run(target, path).splitlines() if line.startswith(" ")]


def test_a_source_fmu_starts_warm_without_a_system(weights: Path, tmp_path: Path) -> None:
    """With the weights in its sources it computes, on a Cortex-M7, what it does here with files, to the last bit."""
    m7, here = target_or_skip("m7"), target_or_skip("x86-64")
    bare = fmu_program(m7, tmp_path / "bare", *BARE, weights=weights, embedded=True)
    assert names(m7, bare).isdisjoint(OF_A_SYSTEM)
    found = outputs(m7, bare)
    assert len(found) == len(ARX_COMMAND)
    hosted = fmu_program(here, tmp_path / "hosted", "-D_GNU_SOURCE", weights=weights, embedded=False)
    assert found == outputs(here, hosted)
    cold = fmu_program(m7, tmp_path / "cold", *BARE, embedded=False)
    assert found != outputs(m7, cold)


def test_without_the_switches_a_system_is_needed(tmp_path: Path) -> None:
    """What the test above looks for is there otherwise."""
    m7 = target_or_skip("m7")
    whole = fmu_program(m7, tmp_path, "--specs=nosys.specs", "-D_GNU_SOURCE", embedded=False)
    assert names(m7, whole) >= {"fopen", "strtod", "vsnprintf", "malloc"}
