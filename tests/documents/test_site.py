"""The documentation as a site, by the extra `docs`: built without a warning, complete, no request off the machine."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag

import pytest
from places import ROOT

import hybridsep

pytestmark = pytest.mark.nightly

DOCS = ROOT / "docs"
NAMES = sorted(
    path.relative_to(DOCS).with_suffix("").as_posix()
    for path in DOCS.rglob("*.md")
    if path.parent.name != "experiments"
)
LOADED = {
    "script": "src",
    "img": "src",
    "iframe": "src",
    "source": "src",
    "object": "data",
    "audio": "src",
    "video": "src",
}
"""Attribute of an element that a browser loads without a click."""


class Page(HTMLParser):
    """What a page loads, where it leads, and what it shows."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.without_alt: list[str] = []
        self.tags: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.tags.add(tag)
        self.anchors.update(value for name, value in attrs if name in ("id", "name") and value)
        if tag == "link" and "canonical" not in (found.get("rel") or ""):
            self.loads.append(found.get("href") or "")
        if tag in LOADED:
            self.loads += [found[key] or "" for key in (LOADED[tag], "srcset") if key in found]
        if tag == "img" and len((found.get("alt") or "").split()) < 3:
            self.without_alt.append(found.get("src") or "")
        if tag == "a" and "href" in found:
            self.links.append(found["href"] or "")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site")
    arguments = ["-W", "--keep-going", "-q", "-d", str(out / "trees"), str(DOCS), str(out / "html")]
    proxies = dict.fromkeys(("http_proxy", "https_proxy", "ALL_PROXY"), "http://127.0.0.1:9")
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, **proxies},
        cwd=ROOT,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return out / "html"


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[str, Page]:
    return {name: Page((site / f"{name}.html").read_text(encoding="utf-8")) for name in NAMES}


def test_no_page_loads_anything_from_elsewhere(site: Path, pages: dict[str, Page]) -> None:
    for name, page in pages.items():
        assert page.loads, name
        for target in page.loads:
            assert not re.match(r"(\w+:)?//", target), (name, target)
            assert (site / name).parent.joinpath(target.partition("?")[0]).exists(), (name, target)
    for path in site.rglob("*.css"):
        assert not re.search(r"url\(\s*['\"]?(https?:)?//|@import\s+['\"]?http", path.read_text(encoding="utf-8")), path
    for path in site.rglob("*.js"):
        assert not re.search(r"(fetch|open|import)\(\s*['\"`][^)]*https?://", path.read_text(encoding="utf-8")), path


def test_links_lead_to_a_page_and_a_place_on_it(site: Path, pages: dict[str, Page]) -> None:
    n = 0
    for name, page in pages.items():
        for place, anchor in inside(name, page):
            assert place in pages or (site / f"{place}.html").exists() or (site / place).exists(), (name, place)
            assert not anchor or place not in pages or anchor in pages[place].anchors, (name, place, anchor)
            n += 1
    assert n > 1000


@pytest.mark.parametrize(
    ("question", "page", "anchor"),
    [
        ("will it fit my axis?", "start/what", "will-it-fit-my-axis"),
        ("what does this refusal mean?", "reference/messages", "sign"),
        ("how do I load it in Simulink?", "howto/simulink", "by-a-script"),
        ("my log, my FMU", "start/first-fmu", ""),
        ("how good is it?", "evidence/figures", "compensation"),
        ("what did not work?", "evidence/experiments", "prediction"),
    ],
)
def test_two_clicks_from_the_first_page(pages: dict[str, Page], question: str, page: str, anchor: str) -> None:
    first = {place for place, _ in inside("index", pages["index"])}
    second = {place for name in first & set(pages) for place, _ in inside(name, pages[name])}
    assert page in first | second, question
    assert not anchor or anchor in pages[page].anchors


def test_every_page_is_reached_and_searched(site: Path, pages: dict[str, Page]) -> None:
    reached = {place for name, page in pages.items() for place, _ in inside(name, page) if place != name}
    assert set(NAMES) - reached == set()
    index = (site / "searchindex.js").read_text(encoding="utf-8")
    assert all(f'"{name}"' in index for name in NAMES)


def test_pictures_have_words_and_mathematics_is_mathml(pages: dict[str, Page]) -> None:
    assert [(name, page.without_alt) for name, page in pages.items() if page.without_alt] == []
    for name in ("explanation/model", "explanation/averaging", "explanation/compensation"):
        assert {"math", "msub", "mo"} <= pages[name].tags


def test_the_reference_has_every_public_name(pages: dict[str, Page]) -> None:
    anchors = {anchor.rpartition(".")[2] for anchor in pages["reference/api"].anchors}
    assert set(hybridsep.__all__) - {"HybridSepError", "__version__"} <= anchors


def inside(name: str, page: Page) -> Iterator[tuple[str, str]]:
    """Yield the pages or files of the site that a page leads to, without ending, and the place on them."""
    for link in page.links:
        if re.match(r"\w+:|//", link):
            continue
        target, anchor = urldefrag(link)
        place = os.path.normpath(Path(name).parent / unquote(target)) if target else name
        yield Path(place).as_posix().removesuffix(".html"), unquote(anchor)


def test_each_command_has_a_page_of_its_own() -> None:
    listed = set(re.findall(r"\(command-line/([\w-]+)\.md\)", (DOCS / "reference" / "command-line.md").read_text()))
    assert listed == {path.stem for path in (DOCS / "reference" / "command-line").iterdir()}
