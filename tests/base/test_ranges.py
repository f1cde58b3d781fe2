"""Ranges of a parameter's values, written as text."""

from __future__ import annotations

import re

import pytest

from hybridsep.base.errors import ParameterError
from hybridsep.base.ranges import parse_range
from hybridsep.base.settings import PARAMETERS


@pytest.mark.parametrize(
    ("name", "text", "values"),
    [
        ("p", "7", (7,)),
        ("p", "50, 5,10,5", (5, 10, 50)),
        ("p", "5:100:5", tuple(range(5, 101, 5))),
        ("p", "5:22:5", (5, 10, 15, 20)),
        ("q", "0:3", (0, 1, 2, 3)),
        ("p", "8:64:x2", (8, 16, 32, 64)),
        ("p", "5:20:5,100", (5, 10, 15, 20, 100)),
        ("lambda", "1e-14:1e-11:x10", (1e-14, 1e-13, 1e-12, 1e-11)),
        ("effect", "0,1e-6:1e-5:x10", (0.0, 1e-6, 1e-5)),
        ("forgetting", "0.1:0.3:0.1", (0.1, 0.2, 0.3)),
        ("p", "9:9:1", (9,)),
    ],
)
def test_ranges_include_their_ends(name: str, text: str, values: tuple[float, ...]) -> None:
    found = parse_range(text, PARAMETERS[name])
    assert found == values
    assert {type(value) for value in found} == {PARAMETERS[name].kind}


EXAMPLES = "5,10,50 or 5:100:5 (steps) or 1e-14:1e-6:x10 (factors)"


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("p", "many", f"--p must be a value or a range such as {EXAMPLES}, got 'many'"),
        ("p", "", f"--p must be a value or a range such as {EXAMPLES}, got ''"),
        ("p", "5,,6", f"--p must be a value or a range such as {EXAMPLES}, got ''"),
        ("p", "1:2:3:4", f"--p must be a value or a range such as {EXAMPLES}, got '1:2:3:4'"),
        ("lambda", "1e-14:1e-6", f"--lambda must be a value or a range such as {EXAMPLES}, got '1e-14:1e-6'"),
        ("p", "1:inf:1", f"--p must be a value or a range such as {EXAMPLES}, got '1:inf:1'"),
        ("p", "9:5:1", "--p must have ranges that ascend, got 9:5:1"),
        ("p", "5:9:0", "--p must have steps above 0, got 5:9:0"),
        ("lambda", "1e-9:1e-6:x1", "--lambda must have factors above 1 and begin above 0, got 1e-9:1e-6:x1"),
        ("effect", "0:1e-6:x10", "--effect must have factors above 1 and begin above 0, got 0:1e-6:x10"),
        ("lambda", "1e-14:1:1e-14", "--lambda must have at most 10000 values, got 1e-14:1:1e-14"),
        ("p", "0:5:1", "--p must be 1 … 5000, got 0"),
        ("p", "2.5", "--p must be a whole number, got 2.5"),
        ("lambda", "0", "--lambda must be 1e-40 … 1e+12 m2, got 0"),
        ("forgetting", "0,-1", "--forgetting must be 0 or 0.001 … 1000000000 s, got -1"),
    ],
)
def test_bad_ranges_are_refused_by_the_name_of_the_option(name: str, text: str, words: str) -> None:
    with pytest.raises(ParameterError, match=f"^{re.escape(words)}$"):
        parse_range(text, PARAMETERS[name])
