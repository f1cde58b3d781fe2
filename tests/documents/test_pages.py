"""Pages of the documentation, the README and its pictures, the listings' rows, and the Simulink example."""

import json
import re
import sys
from datetime import date
from functools import cache
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from built_once import BuiltFmus
from places import ROOT
from programs import output_of

from benchmarks.pictures import FOLDER as PICTURES
from benchmarks.pictures import MAKERS, RECORD, digest
from hybridsep import load_machine
from hybridsep.cosim.fmu import read_description
from hybridsep.fmi.flavours import FMI_VERSIONS
from hybridsep.fmi.ssp import SSP_VERSIONS

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
        assert place.resolve().parent != DATED or page.parent == DATED, f"{target} is not in the site"
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


FOLDER = ROOT / "integrations" / "listings"


def test_the_rows_name_the_versions_that_are_written() -> None:
    entry = json.loads((FOLDER / "fmi-standard.org.json").read_text(encoding="utf-8"))
    assert entry["fmiVersions"] == [f"{version}.0" for version in FMI_VERSIONS]
    row = ET.fromstring((FOLDER / "ssp-standard.org.html").read_text(encoding="utf-8"))
    *_, licence, reads, writes = (cell.text for cell in row.findall("td"))
    assert (entry["license"], licence, reads) == ("osi", "osi", "no")
    assert writes == "/".join(f"{version}.0" for version in SSP_VERSIONS)


SCRIPT = (ROOT / "examples" / "simulink_loop.m").read_text(encoding="utf-8")
PORTS = {
    (fmu, f"{kind}put"): re.findall(r"'(\w+)'", names)
    for fmu, kind, names in re.findall(r"^ports\.(\w+)\.(in|out)puts = \{(.*)\};$", SCRIPT, re.MULTILINE)
}
FMUS = ("ReferenceTrajectory", "HybridPredictor", "SepCompensator", "FeedDrive")


@pytest.mark.slow
@pytest.mark.parametrize("fmu", FMUS)
def test_ports_are_the_fmus_in_their_order(fmu: str, fmus: BuiltFmus) -> None:
    variables = read_description(fmus(fmu)).modelVariables
    for causality in ("input", "output"):
        assert PORTS[fmu, causality] == [v.name for v in variables if v.causality == causality]


@pytest.mark.slow
def test_wires_end_at_ports() -> None:
    text = SCRIPT.partition("wires = {")[2].partition("};")[0]
    wires = [line.strip().split(", ") for line in text.strip().splitlines()]
    assert len(wires) == 3
    for look_ahead, command in (("HybridPredictor", "x_d"), ("SepCompensator", "x_dm")):
        values = {"lookAhead": look_ahead, "command": command}
        for source, output, sink, entry in ([values.get(word, word.strip("'")) for word in wire] for wire in wires):
            assert output in PORTS[source, "output"]
            assert entry in PORTS[sink, "input"]


# The README ----------------------------------------------------------------------------------------------------------


README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_two_commands_come_first_and_ci_runs_the_second() -> None:
    first, second = (block.strip() for block in re.findall(r"```sh\n(.*?)```", README, re.DOTALL)[:2])
    assert "\n" not in first + second
    assert first.endswith(".venv/bin/hybridsep demo --out demo")
    assert second in (ROOT / ".ci" / "run").read_text().splitlines()


@pytest.mark.slow
def test_the_example_of_a_machine_file_is_valid(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "howto" / "log-to-fmu.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    path = tmp_path / "my_axis.toml"
    path.write_text(block, encoding="utf-8")
    assert load_machine(path).model.dc_gain == pytest.approx(1.0, abs=1e-3)


EXAMPLES = [path.name for path in sorted((ROOT / "examples").glob("*.py")) if "__main__" in path.read_text("utf-8")]


@pytest.mark.nightly  # by day: test_commands, test_paper, test_machine, test_help
@pytest.mark.parametrize("example", EXAMPLES)
def test_examples_run(example: str, tmp_path: Path) -> None:
    assert output_of(sys.executable, "-W", "error", ROOT / "examples" / example, cwd=tmp_path)


RECORDED = json.loads(RECORD.read_text(encoding="utf-8"))


def test_every_picture_is_one_that_the_command_makes() -> None:
    names = {path.name for path in PICTURES.glob("*.png")}
    assert names == set(RECORDED) == {name for made in MAKERS for name in made}


@pytest.mark.parametrize("name", RECORDED)
def test_a_picture_is_the_one_that_was_made(name: str) -> None:
    assert digest(PICTURES / name) == RECORDED[name]["sha256"], "python -m benchmarks.pictures makes it anew"


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
