"""The public names: the three lists of them agree, each is found, and none costs anything before it is used."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT

import hybridsep

SLOW_MODULES = {"matplotlib", "control", "fmpy", "ruckig", "scipy.spatial"}
SOURCE = Path(hybridsep.__file__).read_text(encoding="utf-8")


def names_for_type_checkers() -> dict[str, str]:
    """Return name → module of the imports under ``TYPE_CHECKING``."""
    (block,) = (
        node
        for node in ast.parse(SOURCE).body
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
    )
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    return {alias.name: str(node.module) for node in imports for alias in node.names}


def test_three_lists_of_names_agree() -> None:
    modules = names_for_type_checkers()
    assert vars(hybridsep)["_MODULES"] == modules
    assert set(hybridsep.__all__) == {*modules, "__version__"}
    assert len(modules) <= 32


def test_another_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'hybridsep' has no attribute 'cosimulate_all'"):
        hybridsep.cosimulate_all  # type: ignore[attr-defined]  # noqa: B018


def test_packages_import_nothing() -> None:
    for path in (ROOT / "hybridsep").glob("*/__init__.py"):
        (docstring,) = ast.parse(path.read_text(encoding="utf-8")).body
        assert isinstance(docstring, ast.Expr), path


def loaded(arguments: list[str], status: int = 0) -> set[str]:
    """Return the modules that are loaded at the end of a command, or, without arguments, after only the import."""
    command = f"sys.argv[1:] = {arguments!r}; from hybridsep.__main__ import main; main()"
    code = command if arguments else "import hybridsep"
    at_exit = "import atexit, json, sys; atexit.register(lambda: print('\\n' + json.dumps(sorted(sys.modules))))\n"
    done = subprocess.run([sys.executable, "-c", at_exit + code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == status, done.stderr
    return set(json.loads(done.stdout.splitlines()[-1]))


@pytest.mark.parametrize("arguments", [[], ["--help"], ["--version"], ["cosim", "--help"]])
def test_help_and_import_load_nothing_slow(arguments: list[str]) -> None:
    modules = loaded(arguments)
    assert "hybridsep" in modules
    assert not SLOW_MODULES & modules
    assert not {"numpy", "scipy"} & modules


@pytest.mark.slow
def test_a_replay_loads_no_plots_and_no_fmus(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t,x_d,x\n" + "".join(f"{k * 1e-3},{k * 1e-5},{k * 1.1e-5}\n" for k in range(200)))
    modules = loaded(["backtest", str(log), "-m", "spring_mass_damper"])
    assert "hybridsep.evaluate.backtest" in modules
    assert not {"matplotlib", "control", "fmpy", "pythonfmu", "ruckig"} & modules


def test_a_log_that_is_not_there_is_said_before_what_computes_is_imported(tmp_path: Path) -> None:
    """It took four seconds."""
    modules = loaded(["fit", str(tmp_path / "none.csv")], 2)
    assert "hybridsep.logs.log" in modules
    assert not {"scipy", "matplotlib", "fmpy"} & modules
