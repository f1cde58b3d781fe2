"""The README and its pictures."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT

from benchmarks.pictures import FOLDER, MAKERS, RECORD, digest

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


@pytest.mark.nightly  # by day: test_commands, test_paper, test_machine, test_newcomer
@pytest.mark.parametrize("example", EXAMPLES)
def test_examples_run(example: str, tmp_path: Path) -> None:
    command = [sys.executable, "-W", "error", str(ROOT / "examples" / example)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout


RECORDED = json.loads(RECORD.read_text(encoding="utf-8"))


def test_every_picture_is_one_that_the_command_makes() -> None:
    names = {path.name for path in FOLDER.glob("*.png")}
    assert names == set(RECORDED) == {name for made in MAKERS for name in made}


@pytest.mark.parametrize("name", RECORDED)
def test_a_picture_is_the_one_that_was_made(name: str) -> None:
    assert digest(FOLDER / name) == RECORDED[name]["sha256"], "python -m benchmarks.pictures makes it anew"


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_the_words_below_the_compensated_staircase_are_its_figures(page: str) -> None:
    (words,) = re.findall(r"!\[(Tracking error[^\]]*88[^\]]*)\]", (ROOT / page).read_text(encoding="utf-8"))
    for printed, figure in zip(re.findall(r"\d+\.\d", words), figures("staircase_compensated.png")[::2], strict=True):
        assert float(printed) == pytest.approx(figure, abs=0.051), "the picture's own legend has a decimal"


def test_the_table_at_the_front_has_the_figures_of_the_pictures() -> None:
    rows = {"prediction": figures("fit_report.png"), "compensation": figures("staircase_compensated.png")}
    for name, shown in rows.items():
        (row,) = re.findall(rf"^\| {name}: `[^`]*` \|(.*)$", README, re.MULTILINE)
        for printed, figure in zip(re.findall(r"[\d.]+", row), shown, strict=True):
            decimals = len(printed.partition(".")[2])
            assert float(printed) == pytest.approx(figure, abs=0.5000001 * 10.0**-decimals), name


def figures(name: str) -> list[float]:
    return list(RECORDED[name]["figures"].values())
