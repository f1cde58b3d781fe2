"""Links and file names on the pages of the repository, and its length and tone at the front."""

import re
from datetime import date
from functools import cache
from pathlib import Path

import pytest
from places import ROOT

DATED = ROOT / "docs" / "experiments"
"""Pages that tell of the code at their commit: names of files on them may have gone."""
TOP = tuple(ROOT / name for name in ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md"))
PAGES = (*TOP, *sorted((ROOT / "plugins").glob("*/README.md")), *sorted((ROOT / "docs").rglob("*.md")))
FOLDERS = ". hybridsep fmu_src/c fmu_src/c/core benchmarks benchmarks/outside integrations/linuxcnc".split()  # noqa: SIM905
"""Folders below which a page names files."""
FILE = re.compile(r"(?<![\w*{./-])((?:[\w.-]+/)*[\w.-]+\.(?:py|c|h|toml|md))(?![\w*}])")
ELSEWHERE = re.compile(
    r"(?:my_axis/|[xy]/)?machine\.toml|(?:my_axis|tuned|stage|swept|printer)\.toml|(?:sources/)?all\.c|FMI\.c|"
    r"src/hal/utils/scope_files\.c|linuxcnc/hsep\.c"
)
"""Files of the user, of an archive, of another project."""


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def links(page: Path) -> list[tuple[str, str]]:
    """Return the targets and anchors of a page's links that stay in the repository."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return [(match[1], match[2] or "") for match in re.finditer(r"\]\((?!http|#)([^)#]+)(?:#([^)]+))?\)", text)]


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub and the site make them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@cache
def names_of_files() -> set[str]:
    """Return the names of the files that a page may name without a folder."""
    folders = ("hybridsep", "fmu_src", "integrations", "tests", "plugins", "benchmarks")
    return {path.name for folder in folders for path in (ROOT / folder).rglob("*.*")}


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page: Path) -> None:
    for target, anchor in links(page):
        place = page.parent / target
        assert place.exists(), target
        assert not anchor or anchor in anchors(place), (target, anchor)


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if page.parent != DATED], ids=name_of)
def test_files_on_the_page_exist(page: Path) -> None:
    for name in set(FILE.findall(re.sub(r"\]\([^)]*\)", "]", page.read_text(encoding="utf-8")))):
        found = any((ROOT / folder / name).is_file() for folder in FOLDERS)
        assert found or name in names_of_files() or ELSEWHERE.fullmatch(name), name


def test_an_experiment_says_when_it_was_made_and_is_summed_up() -> None:
    summary = (ROOT / "docs" / "evidence" / "experiments.md").read_text(encoding="utf-8")
    for page in DATED.glob("2*.md"):
        day = date.fromisoformat(page.name[:10])
        assert re.search(rf"\b{day.day}( and \d+)? {day:%B %Y}", page.read_text(encoding="utf-8")), page
        assert f"`{page.stem}`" in summary, page


def test_the_front_is_short() -> None:
    text = TOP[0].read_text(encoding="utf-8")
    assert len(text.split()) <= 900
    assert len(text.splitlines()) <= 140
    assert len(TOP[1].read_text(encoding="utf-8").splitlines()) <= 250
