"""Pictures of the documentation: those that its command has made, with the figures that the pages name."""

import json
import re

import pytest
from places import ROOT

from benchmarks.pictures import FOLDER, MAKERS, RECORD, digest

RECORDED = json.loads(RECORD.read_text(encoding="utf-8"))
README = (ROOT / "README.md").read_text(encoding="utf-8")


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
