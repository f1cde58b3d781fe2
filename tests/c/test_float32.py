"""The C library in single precision, ``HSEP_FLOAT32``, and without vectors, beside itself in double precision."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from c_compiler import C_SOURCES, build_folder, include_flags, run_compiler
from c_core import object_files
from controllers import target_or_skip
from programs import output_of

from benchmarks.targets.cases import KINDS, OUTPUTS, Case, header, recorded
from benchmarks.targets.targets import FLOAT32, HERE, TARGETS, Replay, build, core_sources, replay

AGREES, AGREES_PLANNED = 5e-3, 1e-2
"""Relative difference of the RMS of predictions' errors that the README states for the paper's drive, without a
compensator and with one, whose bounded plans differ."""


DOUBLE = ("-O2",)
# Constants are doubles without gcc's option; optimised, the core would take longer to compile than to run
SINGLE = ("-O0", "-DHSEP_FLOAT32", "-Wno-conversion")
NO_VECTORS = ("-O1", "-DHSEP_NO_VECTORS")
PLANNED = Case("compensator", 20, 20, 60, late=2)


@cache
def core(options: tuple[str, ...]) -> list[Path]:
    """Return the library's object files, the same for all cases; in double precision the other tests'."""
    sources = core_sources()
    if options == DOUBLE:
        names = {source.stem for source in sources}
        return [path for path in map(Path, object_files()) if path.stem in names]
    folder = build_folder() / f"core{options[1]}"
    folder.mkdir()
    for source in sources:
        run_compiler([*options, *include_flags(), "-c", source, "-o", folder / f"{source.stem}.o"])
    return sorted(folder.iterdir())


def played(case: Case, options: tuple[str, ...]) -> Replay:
    """Return a replay with the compiler of this machine, not counted."""
    folder = build_folder() / f"{case.kind}_{case.Np}_{case.windows}_{case.warm}_{options[-1]}"
    folder.mkdir()
    (folder / "case.h").write_text(header(case), encoding="utf-8")
    files = [HERE / "replay.c", HERE / "board_host.c", *core(options)]
    included = [*include_flags(), f"-I{HERE}", f"-I{folder}"]
    run_compiler([*options, *included, *files, "-lm", "-o", folder / "program"])
    return replay(TARGETS["x86-64"], folder / "program", count=False)


def error(case: Case, found: Replay) -> float:
    """Return the RMS of the measured positions minus the predictions for them, m."""
    samples, _ = recorded(case)
    column = [name.rpartition(".")[2] for name in OUTPUTS[case.kind]].index("x_h")
    predicted, measured = found.outputs[:-1, column], samples[1:, 1]
    return float(np.sqrt(np.mean((measured - predicted)[case.Np :] ** 2)))


@cache
def errors(case: Case, options: tuple[str, ...]) -> tuple[float, Replay]:
    """Return the error and the replay."""
    found = played(case, options)
    return error(case, found), found


@pytest.mark.slow
@pytest.mark.parametrize("warm", [pytest.param(False, marks=pytest.mark.nightly), True])
def test_predictions_are_as_good(warm: bool) -> None:
    case = Case("predictor", 20, 20, 60, warm)
    (single, of_single), (double, of_double) = errors(case, SINGLE), errors(case, DOUBLE)
    assert single == pytest.approx(double, rel=AGREES)
    assert of_single.began == of_double.began == 0
    assert 2 * of_single.block == of_double.block
    assert (of_single.outputs != of_double.outputs).any()  # it was another program


@pytest.mark.slow
def test_a_plan_is_that_of_double_precision() -> None:
    (single, of_single), (double, of_double) = errors(PLANNED, SINGLE), errors(PLANNED, DOUBLE)
    assert single == pytest.approx(double, rel=AGREES_PLANNED)
    change = of_double.outputs[:, 0] - np.concatenate(([0.0] * 40, recorded(PLANNED)[0][:-40, 0]))
    assert np.sqrt(np.mean((of_single.outputs[:, 0] - of_double.outputs[:, 0]) ** 2)) < AGREES * np.ptp(change)


@pytest.mark.slow
def test_vectors_change_no_bit() -> None:
    np.testing.assert_array_equal(errors(PLANNED, NO_VECTORS)[1].outputs, errors(PLANNED, DOUBLE)[1].outputs)


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("size", [(20, 20), (100, 50)], ids=str)
@pytest.mark.parametrize("warm", [False, True])
def test_a_processor_without_doubles_predicts_as_well(
    kind: str, size: tuple[int, int], warm: bool, tmp_path: Path
) -> None:
    case = Case(kind, *size, 60, warm)
    machine = target_or_skip("m4f-float32")
    there = replay(machine, build(machine, case, tmp_path / "there"), count=False)
    assert there.began == 0
    agrees = AGREES_PLANNED if kind == "compensator" else AGREES
    assert error(case, there) == pytest.approx(errors(case, DOUBLE)[0], rel=agrees)


@pytest.mark.nightly
@pytest.mark.slow
def test_no_operation_of_a_sample_is_a_call(tmp_path: Path) -> None:
    """Of the library's files only one computes with doubles: the one that reads a weights file."""
    machine = target_or_skip("m4f-float32")
    calls = set()
    for source in core_sources():
        object_file = tmp_path / f"{source.stem}.o"
        flags = ["-O2", "-std=c99", "-ffp-contract=off", *include_flags()]
        output_of(*machine.compiler, *flags, "-c", source, "-o", object_file)
        if re.search(r"__aeabi_d\w+", output_of(machine.nm, object_file)):
            calls.add(source.stem)
    assert calls == {"hsep_learned"}


def test_fmus_are_in_double_precision(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="FMUs compute in double precision"):
        run_compiler([*FLOAT32[:1], *include_flags(), "-c", C_SOURCES / "model" / "hsep_check.c", "-o", tmp_path / "o"])
