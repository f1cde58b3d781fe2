"""Constants of the model with trust: few, all in one place; names of library and C core correspond."""

from __future__ import annotations

import ast
import itertools
import re
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import pytest

from hybridsep.predict.trust.constants import CONSTANTS
from hybridsep.predict.trust.model import COMMAND, DOUBTING, HOLD, LAGGED, STATIC
from hybridsep.predict.trust.reach import Reach

ROOT = Path(__file__).parents[2]
LIBRARY = sorted((ROOT / "hybridsep/predict/trust").glob("*.py"))
CORE = sorted((ROOT / "fmu_src/c/core/predict/trust").glob("*.[ch]"))

PLAIN = {0.0, 0.5, 1.0, 2.0}
"""Magnitudes that need no reason."""

DECLARED = re.compile(r"\s*(static const|#define)")


def test_there_are_at_most_40() -> None:
    assert 10 < len(fields(CONSTANTS)) <= 40


def reasoned(tree: ast.Module) -> set[int]:
    """Return the nodes of assignments with a docstring behind them."""
    bodies = [tree.body, *(node.body for node in ast.walk(tree) if isinstance(node, ast.ClassDef))]
    return {
        id(node)
        for body in bodies
        for statement, reason in itertools.pairwise(body)
        if isinstance(statement, ast.Assign | ast.AnnAssign)
        and isinstance(reason, ast.Expr)
        and isinstance(reason.value, ast.Constant)
        for node in ast.walk(statement)
    }


def literals_of_library(text: str) -> Iterator[float]:
    tree = ast.parse(text)
    known = reasoned(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and id(node) not in known:
            yield float(node.value)


def literals_of_core(text: str) -> Iterator[float]:
    text = re.sub(r"/\*.*?\*/|\"[^\"]*\"|HSEP_ASSERT_WORDS\([^;]*;", "", text, flags=re.DOTALL)
    for line in text.splitlines():
        if not DECLARED.match(line):
            yield from (float(found) for found in re.findall(r"(?<![\w.])\d+\.?\d*(?:e[-+]?\d+)?(?![\w.])", line))


@pytest.mark.parametrize("path", [path for path in LIBRARY if path.name != "constants.py"], ids=lambda path: path.name)
def test_no_number_of_the_library_is_without_a_name_and_a_reason(path: Path) -> None:
    assert set(literals_of_library(path.read_text(encoding="utf-8"))) <= PLAIN


@pytest.mark.parametrize("path", [path for path in CORE if "constants" not in path.name], ids=lambda path: path.name)
def test_no_number_of_the_core_is_without_a_name(path: Path) -> None:
    assert set(literals_of_core(path.read_text(encoding="utf-8"))) <= PLAIN


def test_a_number_without_a_name_is_found() -> None:
    assert list(literals_of_library('LEAST = 3.0\n"""Reason."""\nx = LEAST + 0.25\n')) == [0.25]
    assert list(literals_of_core("static const double least = 3.0;\nx = least + 0.25; /* 7 */\n")) == [0.25]


def members(header: str, struct: str) -> list[str]:
    """Return the names of a struct's members."""
    text = next(path for path in CORE if path.name == header).read_text(encoding="utf-8")
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    found = re.search(r"typedef struct \{([^}]*)\} " + struct + ";", text)
    assert found is not None
    return re.findall(r"(\w+)(?:\[[^\]]*\])?(?=[,;])", found[1])


def test_what_is_known_of_the_reach_has_the_same_names() -> None:
    assert tuple(members("hsep_reach.h", "hsep_reach")) == Reach._fields


def test_stack_expert_and_scale_have_the_same_names() -> None:
    assert {"weights", "gram", "cross", "evidence"} == set(members("hsep_stack.h", "hsep_stack"))
    assert {"noise_variance", "correlation"} <= set(members("hsep_expert.h", "hsep_expert"))
    assert {"largest_square", "largest"} == set(members("hsep_expert.h", "hsep_residual_scale"))


def test_the_experts_have_the_same_names_and_places() -> None:
    text = next(path for path in CORE if path.name == "hsep_stack.h").read_text(encoding="utf-8")
    places = text[text.index("typedef enum") : text.index("hsep_expert_place;")]
    found = re.findall(r"HSEP_(\w+)", places)
    assert found == ["HOLD", "LAGGED", "STATIC", "COMMAND", "DOUBTING"]
    assert (HOLD, LAGGED, STATIC, COMMAND, DOUBTING) == (0, 1, 2, 3, 4)
