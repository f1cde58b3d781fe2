"""The documentation as a site, by the extra `docs`: built without a warning, complete, no request off the machine."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

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
LOADED = {**dict.fromkeys(("script", "img", "iframe", "source", "audio", "video"), "src"), "object": "data"}
"""Attribute of an element that a browser loads without a click."""


class Page(HTMLParser):
    """What a page loads, where it leads, and what it shows."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.anchors.update(value for name, value in attrs if name in ("id", "name") and value)
        if tag == "link" and "canonical" not in (found.get("rel") or ""):
            self.loads.append(found.get("href") or "")
        if tag in LOADED:
            self.loads += [found[key] or "" for key in (LOADED[tag], "srcset") if key in found]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site")
    arguments = ["-W", "--keep-going", "-q", "-d", str(out / "trees"), str(DOCS), str(out / "html")]
    proxies = dict.fromkeys(("http_proxy", "https_proxy", "ALL_PROXY"), "http://127.0.0.1:9")
    command, environment = [sys.executable, "-m", "sphinx", *arguments], {**os.environ, **proxies}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=ROOT)
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


def test_the_page_for_a_log_is_beside_it(site: Path) -> None:
    assert all((site / "try" / name).stat().st_size > 1000 for name in ("index.html", "hsep.wasm.js", "example.csv"))


def test_the_reference_has_every_public_name(pages: dict[str, Page]) -> None:
    anchors = {anchor.rpartition(".")[2] for anchor in pages["reference/api"].anchors}
    assert set(hybridsep.__all__) - {"HybridSepError", "__version__"} <= anchors
