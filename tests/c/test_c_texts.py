"""Messages without the C library's printf (HSEP_NO_STDIO) are those with it."""

from __future__ import annotations

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
    """Numbers of a few digits, none of which ends in 5: C's printf rounds ties to even."""
    rng = random.Random(0)
    given = [f"{rng.randrange(1, 10 ** rng.randrange(1, 9)) * 10 + 3}e{rng.randrange(-30, 25)}" for _ in range(400)]
    some = (0.0, -0.0, 1.0, -2.3e-7, 1e22, 1e300, 5e-324, 1.7976931348623157e308, math.inf, -math.inf)
    return [*map(float, given), *some]


@pytest.mark.parametrize("form", ["%.*g", "%.*f", "%.*e"])
def test_numbers_are_the_same_text(form: str, texts: tuple[ctypes.CDLL, ctypes.CDLL]) -> None:
    for value in values():
        for precision in (0, 1, 2, 4, 6, 9, 10, 13):
            if form == "%.*f" and abs(value) * 10.0**precision > 1e14 and math.isfinite(value):
                continue  # more than 15 digits
            if abs(value) < 1e15 and abs(math.remainder(value * 10.0**precision, 1.0)) == 0.5:
                continue
            found = [written(library, form, precision, value) for library in texts]
            assert found[0] == found[1], (value, precision)


def test_the_shortest_number_that_reads_back(texts: tuple[ctypes.CDLL, ctypes.CDLL]) -> None:
    exponents = [ctypes.c_int(), ctypes.c_int()]
    for value in values()[:-2]:
        found = [
            (library.hsep_text_digits(ctypes.c_double(value), ctypes.byref(place)), place.value)
            for library, place in zip(texts, exponents, strict=True)
        ]
        digits, exponent = found[0]
        if abs(exponent - digits) <= 22:  # powers of ten are exact up to there
            assert found[0] == found[1], value


def test_texts_are_cut_off_alike(texts: tuple[ctypes.CDLL, ctypes.CDLL]) -> None:
    for size in (0, 1, 5, 12, SIZE):
        assert written(texts[0], "%.*g and more", 9, 1 / 3, size) == written(texts[1], "%.*g and more", 9, 1 / 3, size)
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
