"""The C core as a library: its package, its interface (hsep.h) and the examples beside it."""

import ctypes
import math
import re
import shutil
import subprocess
from dataclasses import asdict
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import staircase_data as staircase
from c_compiler import C_SOURCES, compiler, include_flags, zig
from c_core import CModel
from c_library import Library, configured, installed
from library_stream import trained_state
from places import ROOT
from programs import output_of
from spoiled_weights import spoiled
from stream import STAGE_COMPENSATOR, machine_of

from hybridsep.base.settings import PARAMETERS, PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.fmi.variables import AVERAGING_SETTINGS, COMPENSATOR_SETTINGS, PREDICTOR_SETTINGS
from hybridsep.fmi.weights import restore_weights, weights_file
from hybridsep.machines.machine import load_machine
from hybridsep.plants.plant import simulate
from hybridsep.predict.predictor import HybridPredictor

MODE = asdict(load_machine("spring_mass_damper").model.modes[0])
CONSUMER = ROOT / "tests" / "c" / "consumer"
KINDS = {"predictor": {**PREDICTOR_SETTINGS, **AVERAGING_SETTINGS}}
KINDS["compensator"] = {**KINDS["predictor"], **COMPENSATOR_SETTINGS}


def library(kind: str = "predictor", /, **settings: float) -> Library:
    return Library(kind, settings, [MODE])


@pytest.mark.slow
def test_other_projects_find_the_package(tmp_path: Path) -> None:
    configured(
        CONSUMER, tmp_path, f"CMAKE_PREFIX_PATH={installed()}", "CMAKE_CXX_FLAGS=-Wall -Wextra -pedantic -Werror"
    )
    assert [output_of(tmp_path / name) for name in ("in_c", "in_cpp")] == ["9 1\n", "9 1\n"]
    cache = (tmp_path / "CMakeCache.txt").read_text(encoding="utf-8")
    assert f"hsep_DIR:PATH={installed()}/" in cache  # and no other one


@pytest.mark.slow
def test_pkg_config_tells_where_it_is(tmp_path: Path) -> None:
    (file,) = installed().rglob("lib*/pkgconfig/hsep.pc")
    fields = dict(re.findall(r"^(Cflags|Libs): (.*)$", file.read_text(encoding="utf-8"), re.MULTILINE))
    prefix = str(file.parent / ".." / "..")
    cflags, libs = (fields[name].replace("${prefix}", prefix).split() for name in ("Cflags", "Libs"))
    output_of(*compiler(), *cflags, CONSUMER / "main.c", *libs, "-o", tmp_path / "main")
    assert output_of(tmp_path / "main") == "9 1\n"


@pytest.mark.parametrize("kind", KINDS)
def test_parameters_out_of_their_ranges_are_refused(kind: str) -> None:
    """One by one, at either end and as no number, and only then."""
    for averaging in (0, 1):
        assert not library(kind, averaging=averaging).refused()
    least = {"p": 1, "q": 0}
    for name, parameter in KINDS[kind].items():
        most, whole = parameter.maximum, parameter.kind is not float
        wrong = [most + 1 if whole else math.nextafter(most, math.inf)]
        if whole:
            wrong += [parameter.minimum - 1] if parameter.minimum else [2**64 - 1]
        else:
            beneath = math.nextafter(parameter.minimum, -math.inf)
            wrong += [math.nan, math.inf, -math.inf, beneath, *([0.5 * parameter.nonzero] if parameter.nonzero else [])]
        refused = [library(kind, **{**least, name: value}).refused() for value in wrong]
        assert refused == [name] * len(wrong)
        if parameter.automatic is not None:
            assert not library(kind, **{name: parameter.automatic}).refused(), name


def test_parameters_that_do_not_fit_together_are_refused() -> None:
    assert not library(Np=20, p=20, q=19).refused()
    assert [library(Np=20, p=21, q=0).refused(), library(Np=20, p=20, q=20).refused()] == ["p", "q"]
    fits = {"Np": 20, "p": 20, "spacing": 2, "preview": 31}
    assert not library("compensator", **fits).refused()
    wrong: dict[str, dict[str, float]] = {
        "spacing": {"spacing": 3, "preview": 200},
        "preview": {"preview": 30},
        "measurement_delay": {"averaging": 0, "measurement_delay": 1},
    }
    for name, one in wrong.items():
        assert library("compensator", **{**fits, **one}).refused() == name
    assert not library("compensator", **{**fits, "measurement_delay": 1}).refused()
    assert Library("predictor", {"Np": 20, "p": 20}, []).refused() == "modes"
    for name in ("f_n", "zeta", "alpha", "beta"):
        for value in (math.nan, 2 * PARAMETERS[name].maximum):
            assert Library("predictor", {}, [MODE, {**MODE, name: value}]).refused() == name


def test_defaults_are_the_declared_ones() -> None:
    given = library("compensator").parameters
    parts = (
        (given.predictor, PREDICTOR_SETTINGS),
        (given.averaging, AVERAGING_SETTINGS),
        (given.compensator, COMPENSATOR_SETTINGS),
    )
    for part, settings in parts:
        found = {name: getattr(part, name) for name in settings}
        assert found == {name: parameter.to_fmi(parameter.default) for name, parameter in settings.items()}


@pytest.mark.slow
@pytest.mark.parametrize("averaging", [0, 1])
def test_outputs_are_the_models(averaging: int) -> None:
    """The interface without FMI computes what an FMU does, to the last bit."""
    x_d = staircase.commanded()[:700]
    settings, machine = {"p": 10, "preview": 100, "averaging": averaging}, machine_of(STAGE_COMPENSATOR)
    modes = [asdict(mode) for mode in machine.model.modes]
    compensator = Library("compensator", {**machine.fmi_compensator_parameters(), **settings}, modes)
    assert compensator.begin(float(x_d[0])) == 0
    model = CModel(STAGE_COMPENSATOR, {**settings, "x_d_ahead": x_d[0], "x_meas": x_d[0]}).initialise()
    for k, x_d_ahead in enumerate(x_d):
        x_meas, x_load = x_d[max(0, k - 101)] + 1e-5 * math.sin(0.1 * k), 1e-4 * math.cos(0.03 * k)
        model["x_d_ahead"], model["x_meas"], model["x_load"] = x_d_ahead, x_meas, x_load
        model.step(k * 1e-3)
        compensator.load(x_load)
        outputs = compensator.sample(x_d_ahead, x_meas)
        found = (outputs.x_dm, outputs.predicted.x_h, outputs.predicted.x_h_std, outputs.state)
        assert found == tuple(model[name] for name in ("x_dm", "x_h", "x_h_std", "sep_state")), k


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_weights_from_memory(kind: str) -> None:
    trained = HybridPredictor.load(trained_state("HybridPredictor"))
    content = weights_file(trained)
    modes = [{name: getattr(mode, name) for name in ("f_n", "zeta", "alpha", "beta")} for mode in trained.model.modes]
    settings = {name: float(value) for name, value in trained.settings.to_fmi().items()}
    given = Library(kind, {}, modes)
    for name, value in settings.items():
        given.parameters[name] = value if KINDS[kind][name].kind is float else int(value)
    assert given.begin(0.0, content) == 0
    warm = bytes(given.block)
    assert given.begin(0.0) == 0
    cold = bytes(given.block)
    assert warm != cold
    damaged, other = spoiled(content)
    for what, refused in ((1, damaged), (2, other)):
        for name, changed in refused.items():
            assert given.begin(0.0, changed) == what, name
            assert bytes(given.block) == cold, name
    assert given.begin(0.0, content) == 0
    given.parameters["q"] = int(settings["q"]) + 1
    elsewhere = given.begin(0.0, content), bytes(given.block)
    assert given.begin(0.0) == 0
    assert elsewhere == (2, bytes(given.block))


@pytest.mark.slow
@pytest.mark.parametrize("averaging", [0, 1])
@pytest.mark.parametrize("kind", KINDS)
def test_what_was_learned_is_written_as_a_weights_file(kind: str, averaging: int) -> None:
    """In C, read and written again by the library, it is what another run in C begins with."""
    more = {"preview": 100} if kind == "compensator" else {}
    x_d = staircase.commanded()[:600]
    x_meas = 1e-6 * np.round(1e6 * simulate(load_machine("spring_mass_damper").new_plant(), x_d, 1e-3))

    def run(samples: slice, weights: bytes | None = None, *, looked_at: bool = False) -> tuple[Library, Array]:
        one, found = library(kind, Np=50, p=10, t_init=0.0, averaging=averaging, **more), []
        assert one.begin(float(x_d[samples][0]), weights) == 0
        for k, (ahead, measured) in enumerate(zip(x_d[samples], x_meas[samples], strict=True)):
            outputs = one.sample(ahead, measured)
            found.append((outputs.x_dm, outputs.predicted.x_h, outputs.predicted.x_h_std))
            if looked_at and k % 37 == 0:
                assert one.weights()
        return one, np.array(found)

    first, undisturbed = run(slice(0, 600))
    np.testing.assert_array_equal(run(slice(0, 600), looked_at=True)[1], undisturbed)
    assert first.weights(room=len(first.weights()) - 1) == b""
    content = first.weights()
    settings = PredictorSettings(Np=50, p=10, averaging=bool(averaging))
    predictor = HybridPredictor(load_machine("spring_mass_damper").model, settings)
    restore_weights(predictor, content)
    assert predictor.regression.n_rows > 300
    _, warm = run(slice(0, 300), content)
    _, again = run(slice(0, 300), weights_file(predictor))
    _, cold = run(slice(0, 300))
    np.testing.assert_array_equal(again, warm)
    assert np.abs(cold - warm).max() > 1e-6


def test_a_limit_of_the_following_error_is_checked_and_a_trip_ends_with_a_rising_reset() -> None:
    """What becomes of a trip: tests/suite/test_tunable.py."""
    given = library("compensator", following_error_max=1e-3)
    assert given.begin(0.0) == 0
    for allowed, taken in ((-1e-3, 0), (math.nan, 0), (math.inf, 0), (2e-3, 1)):
        numbers = ctypes.c_double(1e-3), ctypes.c_double(allowed)
        assert given.core.hsep_compensator_change(given.block, 2, *numbers) == taken
    alarms = []
    for level in (0, 0, 0, 0, 1, 1, 0, 1):
        given.core.hsep_compensator_reset(given.block, level)
        alarms.append(given.sample(0.0, 2.5e-3).alarm)
    assert alarms == [0, 0, 1, 1, 0, 0, 1, 0]


def test_fast_math_is_refused(tmp_path: Path) -> None:
    command = [*compiler(), "-ffast-math", *include_flags(), "-fsyntax-only", "-xc", str(C_SOURCES / "hsep.h")]
    refused = subprocess.run(command, capture_output=True, text=True, check=False)
    assert refused.returncode != 0
    assert "hsep needs IEEE 754 arithmetic" in refused.stderr


COMPILERS = {"gcc": ["gcc"], "clang": ["clang"], "zig": zig()}


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize(("name", "standard"), list(product(COMPILERS, ("c99", "c11", "c17", "c2x", "gnu17"))))
def test_compilers_take_it_without_a_warning(name: str, standard: str, tmp_path: Path) -> None:
    """Also where a system's headers define the short names that some of them do (complex.h, termios.h, sys/param.h)."""
    command = COMPILERS[name]
    if not shutil.which(command[0]):
        pytest.skip(f"{name} is not installed here")
    (tmp_path / "short_names.h").write_text("#define I short names\n#define N short names\n#define B0 short names\n")
    flags = [f"-std={standard}", "-Wall", "-Wextra", "-pedantic", "-Werror", "-ffp-contract=off", "-c"]
    sources = sorted(C_SOURCES.glob("core/**/*.c"))
    included = ["-include", str(tmp_path / "short_names.h"), *include_flags()]
    output_of(*command, *flags, *included, *sources, cwd=tmp_path)
