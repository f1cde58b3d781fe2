"""Constants of the model with averaging: few, all in one place; names of library and C core correspond."""

import ast
import itertools
import re
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from hybridsep.predict.averaging.experts import ExpertErrors, ResidualScale
from hybridsep.predict.averaging.gate import InnovationGate
from hybridsep.predict.averaging.model import Learned
from hybridsep.predict.averaging.stacking import Stack

ROOT = Path(__file__).parents[2]
LIBRARY = sorted((ROOT / "hybridsep/predict/averaging").glob("*.py"))
CORE = sorted((ROOT / "fmu_src/c/core/predict/averaging").glob("*.[ch]"))

PLAIN = {0.0, 0.5, 1.0, 2.0}  # magnitudes that need no reason

LIBRARY_ALONE = {"__init__", "constants", "regression", "predictor"}
"""Constants are generated for C; its regression is below ``numeric``, its predictor below ``online``."""

CORE_ALONE = {"predict_constants", "averaged_forecast", "averaged_learn"}
"""Generated header; parts of the model, which the library has in one file."""

AVERAGED = {"model": "averaged_model"}
"""Names of C's files that are not the library's: C's own `hsep_model.h` is what an adapter sees."""


def reasoned(text: str, tree: ast.Module) -> set[int]:
    """Return the nodes of assignments with a comment or a docstring after them."""
    lines = text.splitlines()
    bodies = [tree.body, *(node.body for node in ast.walk(tree) if isinstance(node, ast.ClassDef))]
    return {
        id(node)
        for body in bodies
        for statement, after in itertools.pairwise([*body, None])
        if isinstance(statement, ast.Assign | ast.AnnAssign)
        and ("  # " in lines[(statement.end_lineno or 0) - 1] or isinstance(after, ast.Expr))
        for node in ast.walk(statement)
    }


def literals_of_library(text: str) -> Iterator[float]:
    tree = ast.parse(text)
    known = reasoned(text, tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and id(node) not in known:
            yield float(node.value)


def literals_of_core(text: str) -> Iterator[float]:
    text = re.sub(r"/\*.*?\*/|\"[^\"]*\"|HSEP_ASSERT_WORDS\([^;]*;", "", text, flags=re.DOTALL)
    for line in text.splitlines():
        if not re.match(r"\s*(static const|#define)", line):
            yield from (float(found) for found in re.findall(r"(?<![\w.])\d+\.?\d*(?:e[-+]?\d+)?(?![\w.])", line))


@pytest.mark.parametrize(
    "path", [path for path in (*LIBRARY, *CORE) if "constants" not in path.name], ids=lambda path: path.name
)
def test_no_number_is_without_a_name_and_a_reason(path: Path) -> None:
    literals = literals_of_library if path.suffix == ".py" else literals_of_core
    assert set(literals(path.read_text(encoding="utf-8"))) <= PLAIN


def members(header: str, struct: str) -> list[str]:
    """Return the names of a struct's members."""
    text = next(path for path in CORE if path.name == header).read_text(encoding="utf-8")
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    found = re.search(r"typedef struct \{([^}]*)\} " + struct + ";", text)
    assert found is not None
    return re.findall(r"(\w+)(?:\[[^\]]*\])?(?=[,;])", found[1])


def names(record: type[Any]) -> list[str]:
    """Return the names of a record's fields."""
    return [one.name for one in fields(record)]


def test_what_is_learned_has_the_same_names_in_the_same_order() -> None:
    assert members("hsep_stacking.h", "hsep_stack") == names(Stack)
    assert members("hsep_experts.h", "hsep_expert_errors") == names(ExpertErrors)
    assert members("hsep_experts.h", "hsep_residual_scale") == names(ResidualScale)
    assert members("hsep_gate.h", "hsep_gate")[:3] == names(InnovationGate)
    *struct, largest = names(Learned)  # the last, whose number the settings decide, is after the struct
    assert members("hsep_averaged_model.h", "hsep_learned") == struct
    assert largest == members("hsep_averaged_model.h", "hsep_averaged")[-2]


@pytest.mark.parametrize("package", ["predict", "predict/averaging"])
def test_both_have_the_same_files(package: str) -> None:
    """But for what only one language needs."""
    of_library = {path.stem for path in (ROOT / "hybridsep" / package).glob("*.py")} - LIBRARY_ALONE
    of_core = {path.stem.removeprefix("hsep_") for path in (ROOT / "fmu_src/c/core" / package).glob("*.[ch]")}
    assert {AVERAGED.get(name, name) for name in of_library} == of_core - CORE_ALONE
