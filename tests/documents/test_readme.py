"""The README's two commands and CI, the example of a machine file, the examples."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


@pytest.mark.slow
def test_the_two_commands_come_first_and_ci_runs_the_second() -> None:
    first, second = (block.strip() for block in blocks("sh")[:2])
    assert "\n" not in first + second
    assert first.endswith(".venv/bin/hybridsep demo --out demo")
    assert second in (ROOT / ".ci" / "run").read_text().splitlines()


@pytest.mark.slow
def test_the_example_of_a_machine_file_is_valid(tmp_path: Path) -> None:
    from hybridsep import load_machine

    page = (ROOT / "docs" / "howto" / "log-to-fmu.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    path = tmp_path / "my_axis.toml"
    path.write_text(block, encoding="utf-8")
    assert load_machine(path).model.dc_gain == pytest.approx(1.0, abs=1e-3)


EXAMPLES = [path.name for path in sorted((ROOT / "examples").glob("*.py")) if "__main__" in path.read_text("utf-8")]


@pytest.mark.nightly  # by day: test_commands, test_mechanism, test_paper, test_machine, test_example_log
@pytest.mark.parametrize("example", EXAMPLES)
def test_examples_run(example: str, tmp_path: Path) -> None:
    command = [sys.executable, "-W", "error", str(ROOT / "examples" / example)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout
