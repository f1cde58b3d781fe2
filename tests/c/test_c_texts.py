"""Messages without the C library's printf (HSEP_NO_STDIO) are those with it, numbers to seven digits."""

import ctypes
import math
import random
from pathlib import Path

import pytest
from c_compiler import C_SOURCES, include_flags, run_compiler
from places import ROOT

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
