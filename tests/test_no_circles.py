"""Files of the library and of the C sources that need each other: none may need itself through others."""

import ast
import re
from collections.abc import Callable, Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from places import ROOT

Graph = dict[str, set[str]]


def imported(module: str, is_package: bool, source: str) -> Iterator[str]:
    """Yield what a module may import, in functions and for its types too, with each name as if it were a module."""
    package = module.split(".") if is_package else module.split(".")[:-1]
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) + 1 - node.level] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            yield from (f"{base}.{one.name}" for one in node.names)
            yield base


def library() -> Graph:
    """Return which modules each module imports."""
    paths = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for path in (ROOT / "hybridsep").rglob("*.py")
        if "_data" not in path.parts
    }
    return {
        name: set(imported(name, path.stem == "__init__", path.read_text(encoding="utf-8"))) & set(paths) - {name}
        for name, path in paths.items()
    }


def c_sources() -> Graph:
    """Return which files each file includes; a header and its source are one."""
    graph: Graph = {}
    for path in (ROOT / "fmu_src" / "c").rglob("*.[ch]"):
        included = re.findall(r'^\s*#\s*include\s+"([^"]+)"', path.read_text(encoding="utf-8"), re.MULTILINE)
        graph.setdefault(path.stem, set()).update({Path(one).stem for one in included} - {path.stem})
    return graph


@pytest.mark.slow
@pytest.mark.parametrize(("graph", "some"), [(library, 100), (c_sources, 50)], ids=["hybridsep", "c"])
def test_there_are_no_circles(graph: Callable[[], Graph], some: int) -> None:
    needed = graph()
    assert sum(map(bool, needed.values())) > some
    try:
        TopologicalSorter(needed).prepare()
    except CycleError as error:
        pytest.fail(" → ".join(error.args[1]))


@pytest.mark.slow
def test_packages_import_those_below_them_alone() -> None:
    """Hold the order that ARCHITECTURE.md states against what the packages import."""
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    (stated,) = re.findall(r"^Imports point one way: (.*?);", text, re.MULTILINE | re.DOTALL)
    floor = {name: number for number, one in enumerate(stated.split("<")) for name in re.findall(r"`(\w+)`", one)}
    packages = {path.parent.name for path in (ROOT / "hybridsep").glob("*/__init__.py")}
    assert packages == set(floor)
    upwards = [
        f"{name} → {one}"
        for name, imports in library().items()
        for one in imports
        if len(name.split(".")) > 2
        and len(one.split(".")) > 2
        and (own := name.split(".")[1]) != (other := one.split(".")[1])
        and floor[other] >= floor[own]
    ]
    assert upwards == []
