"""Messages of the C core: what is refused, and texts without printf."""

import ctypes
import math
import random
from pathlib import Path

import c_core
import numpy as np
import pytest
from c_compiler import C_SOURCES, include_flags, run_compiler
from c_core import CModel, refusal, write_trajectory
from places import ROOT
from stream import COMPENSATOR, PLANTS, PREDICTOR, STAGE_PREDICTOR, TRAJECTORY, table_of_model


def test_many_problems_are_cut_off_within_the_message() -> None:
    parameters = table_of_model(STAGE_PREDICTOR).parameters
    wrong = {key: math.nan for key in CModel(STAGE_PREDICTOR).place if key.startswith("mode[") or key in parameters}
    message = refusal(CModel(STAGE_PREDICTOR, wrong).size)
    assert message.startswith("Np must be finite, got nan; p must be finite, got nan; ")
    message = refusal(CModel(STAGE_PREDICTOR, dict.fromkeys(wrong, -1.2345678901234567e-5)).size)
    assert 450 < len(message.encode()) < c_core.MESSAGE_SIZE


def test_resources_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "trajectory_0.bin"
    assert refusal(CModel(TRAJECTORY).size) == "trajectory_0.bin must be in the resources (none) and readable"
    assert "must be in the resources" in refusal(CModel(TRAJECTORY, resources=tmp_path).size)
    write_trajectory(tmp_path, np.arange(5.0), 2e-3)
    model = CModel(TRAJECTORY, resources=tmp_path)
    assert refusal(model.size) == "T_s must be 0.002 s, the interval of trajectory_0.bin, got 0.001"
    model.start_values()
    assert model["r"] == 0.0
    write_trajectory(tmp_path, np.array([1.0, math.nan]))
    assert refusal(model.initialise) == "trajectory_0.bin must be finite, got nan at sample 1"
    write_trajectory(tmp_path, np.arange(5.0))
    good = file.read_bytes()
    for bad in (b"", good[:20], good[:-1], good[:24], b"X" + good[1:], good + b"\0" * 8):
        file.write_bytes(bad)
        assert "it is damaged or truncated" in refusal(model.size)


@pytest.mark.parametrize("name", [PREDICTOR, COMPENSATOR, *PLANTS, TRAJECTORY])
def test_memory_of_another_size_is_refused(name: str, tmp_path: Path) -> None:
    write_trajectory(tmp_path, np.arange(5.0))
    model = CModel(name, resources=tmp_path)
    size = model.size()
    for other in (size - 8, size + 8):
        assert refusal(lambda other=other: model.initialise(size=other)) == (  # type: ignore[misc]
            f"the state must have {size} bytes, got memory for {other}; its file in the resources has changed "
            "meanwhile: initialise again"
        )


SIZE = 512


@pytest.fixture(scope="module")
def texts(tmp_path_factory: pytest.TempPathFactory) -> tuple[ctypes.CDLL, ctypes.CDLL]:
    """Libraries of the text functions, with and without the C library's."""
    folder = tmp_path_factory.mktemp("texts")
    sources = [ROOT / "tests" / "c" / "texts.c", C_SOURCES / "model" / "hsep_text.c"]
    paths: list[Path] = []
    for name, define in (("with", []), ("without", ["-DHSEP_NO_STDIO"])):
        paths.append(folder / f"{name}.so")
        run_compiler(["-O1", "-fPIC", "-shared", *define, *include_flags(), *sources, "-lm", "-o", paths[-1]])
    first, second = map(ctypes.CDLL, map(str, paths))
    return first, second


def written(library: ctypes.CDLL, form: str, precision: int, value: float, size: int = SIZE) -> tuple[int, bytes]:
    text = ctypes.create_string_buffer(SIZE)
    n = library.text_real(text, ctypes.c_size_t(size), form.encode(), precision, ctypes.c_double(value))
    return n, text.value


def values() -> list[float]:
    rng = random.Random(0)
    given = [f"{rng.randrange(1, 10 ** rng.randrange(1, 17))}e{rng.randrange(-30, 25)}" for _ in range(400)]
    some = (0.0, -0.0, 1.0, -2.3e-7, 9.99999996, 1e22, 1e300, 5e-324, 1.7976931348623157e308, math.inf, -math.inf)
    return [*map(float, given), *some]


@pytest.mark.parametrize("form", ["%.*g", "%.*f", "%.*e"])
def test_numbers_have_seven_digits(form: str, texts: tuple[ctypes.CDLL, ctypes.CDLL]) -> None:
    for value in values():
        text = written(texts[1], form, 9, value)[1].decode()
        assert math.isclose(float(text), value, rel_tol=5.1e-7), text
        assert abs(value) >= 1e15 or value != math.floor(value) or float(text) == value


def test_texts_are_cut_off_alike(texts: tuple[ctypes.CDLL, ctypes.CDLL]) -> None:
    for size in (0, 1, 5, 12, SIZE):
        assert written(texts[0], "%.*g and more", 9, 12.0, size) == written(texts[1], "%.*g and more", 9, 12.0, size)
    for number in (0, -7, 2**31 - 1, -(2**31)):
        found = []
        for library in texts:
            text = ctypes.create_string_buffer(SIZE)
            library.text_others(
                text, ctypes.c_size_t(SIZE), "a \u2265 b".encode(), number, ctypes.c_ulong(number & 0xFFFF)
            )
            found.append(text.value)
        assert found[0] == found[1]
        assert str(number).encode() in found[0]
