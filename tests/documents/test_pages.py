"""Links and file names on the pages of the repository."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from places import ROOT

PAGES = (
    *("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"),
    *("docs/identify.md", "docs/importers.md", "docs/paper.md", "docs/tune.md"),
)
FOLDERS = (".", "hybridsep", "fmu_src/c", "fmu_src/c/core", "benchmarks", "benchmarks/step_time")
"""Folders below which a page names files."""
FILE = re.compile(r"(?<![\w*{./-])((?:[\w.-]+/)*[\w.-]+\.(?:py|c|h|toml|md))(?![\w*}])")
ELSEWHERE = {
    "my_axis.toml",
    "machine.toml",
    "tuned.toml",
    "example_axis/machine.toml",
    "my_axis/machine.toml",
    "all.c",
    "sources/all.c",
    "FMI.c",
}
"""Files of the user, of an archive, of another project."""


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page: str) -> None:
    place = (ROOT / page).parent
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", (ROOT / page).read_text(encoding="utf-8")):
        assert (place / target).exists(), target


@pytest.mark.parametrize("page", PAGES)
def test_files_on_the_page_exist(page: str) -> None:
    names = set(FILE.findall((ROOT / page).read_text(encoding="utf-8"))) - ELSEWHERE
    assert names
    known = {path.name for folder in ("hybridsep", "fmu_src", "tests", "benchmarks") for path in files_in(folder)}
    for name in names:
        found = any((ROOT / folder / name).is_file() for folder in FOLDERS)
        assert found or ("/" not in name and name in known), name


def files_in(folder: str) -> list[Path]:
    return [path for path in (ROOT / folder).rglob("*.*") if path.is_file()]
