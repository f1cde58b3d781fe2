"""The pythonfmu FMUs: modules that they share in one process, wiring, what is refused, as fmpy tells it."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from built_once import BuiltFmus
from driving import T_S, steps
from streams import FmuStream

from hybridsep import FmuInstance, build_fmu, load_machine
from hybridsep.base.errors import FmuError
from hybridsep.compensate.compensator import SepState


@pytest.fixture
def predictor(fmus: BuiltFmus) -> Iterator[FmuInstance]:
    with FmuInstance(fmus("HybridPredictorPy")) as instance:
        yield instance


@pytest.mark.slow
def test_different_fmus_of_one_name_in_one_process(fmus: BuiltFmus, tmp_path: Path) -> None:
    smaller = load_machine("spring_mass_damper").changed("predictor", {"Np": 60, "p": 20})
    paths = [fmus("HybridPredictorPy"), build_fmu(smaller, "HybridPredictorPy", tmp_path, "python")]

    def run(together: list[Path]) -> list[list[list[float]]]:
        streams = [FmuStream(path, "HybridPredictor") for path in together]
        for stream in streams:
            stream.initialise({})
        rows: list[list[list[float]]] = [[] for _ in streams]
        for k in range(250):
            for stream, row in zip(streams, rows, strict=True):
                row += steps(stream, k, k + 1)
        for stream in streams:
            stream.close()
        return rows

    expected = [*run(paths[:1]), *run(paths[1:])]
    assert run([*paths, paths[0]]) == [*expected, expected[0]]
    assert expected[0] != expected[1]


def test_parameters_may_be_set_one_after_the_other_and_the_page_shows_the_wiring(fmus: BuiltFmus) -> None:
    path = fmus("SepCompensatorPy")
    with zipfile.ZipFile(path) as archive:
        page = archive.read("documentation/index.html").decode()
    for text in ("SepCompensator</text>", "x_dm → x_d", "FeedDrive.x_d = SepCompensator.x_dm"):
        assert text in page
    assert "HybridPredictor.x_d" not in page
    with FmuInstance(path) as compensator:
        compensator.begin({"x_d_ahead": 0.1, "Np": 75})  # which spacing = 2 does not divide
        assert [compensator.get(name) for name in ("x_dm", "x_d", "x_pb", "x_h", "x_h_std")] == [0.1] * 4 + [0.0]
        compensator.set("spacing", 3)
        assert compensator.get("sep_state") == SepState.PHYSICS
        compensator.finish()
        compensator.step(0.0, T_S)


def test_calls_that_are_not_allowed_now(predictor: FmuInstance) -> None:
    with pytest.raises(FmuError, match=r"doStep is not allowed before the initialization has ended"):
        predictor.step(0.0, T_S)
    predictor.initialise()
    with pytest.raises(FmuError, match=r"p is a fixed parameter and cannot be set after initialization, got 3"):
        predictor.set("p", 3)
    with pytest.raises(FmuError, match=r"x_h is an output variable and cannot be set"):
        predictor.set("x_h", 0.0)
    with pytest.raises(FmuError, match=r"has no variable 'speed'"):
        predictor.set("speed", 0.0)
    with pytest.raises(FmuError):
        predictor.step(0.0, -T_S)
    status, said = predictor.log[-1]
    assert (status, "the communication step size must be" in said) == (3, True)
    predictor.step(0.0, T_S)
    assert predictor.get("p") == 50
