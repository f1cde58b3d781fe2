"""Report: a page that stands alone, escapes what it is given, and draws all that matters of long lines."""

from __future__ import annotations

import base64
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridsep.evaluate.chart import Chart, Line
from hybridsep.evaluate.chart_pages import COLUMN_WIDTH, write_pages
from hybridsep.evaluate.report import Report


class Tags(HTMLParser):
    """Collects tags, and checks that they are closed in order."""

    VOID = ("meta", "link", "br", "hr", "img")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.attributes: list[tuple[str, str]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [(name, value or "") for name, value in attrs]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    report = Report("Axis <X> & co", "$ 5 samples")
    report.heading("A & B")
    report.paragraph("use <hybrid>", "verdict")
    report.bullets(["a < b"])
    report.code('print("<x>")')
    report.table(["name", "words"], [["<a>", "b & c"]], words=1)
    t = np.arange(50_000) * 1e-3
    y = np.sin(t)
    y[31_234], y[100] = 7.0, np.nan
    band = Line("band", t, -np.ones(len(t)), "#010203", upper=np.ones(len(t)), panel=1)
    report.chart(Chart("t [s]", ("y [µm]", "e [µm]"), [Line("y", t, y, "#123456"), band], "A caption"))
    report.chart(
        Chart("f [Hz]", ("g",), [Line("", [1.0, 2.0], [3.0, 4.0], "#ff0000", points=True)], x_log=True, y_log=True)
    )
    path = tmp_path_factory.mktemp("report") / "report.html"
    report.write(path)
    return path.read_text(encoding="utf-8")


def charts(page: str) -> list[Any]:
    """Return the traces of each chart."""
    decoder = json.JSONDecoder()
    return [
        decoder.raw_decode(page, match.end())[0] for match in re.finditer(r'Plotly\.newPlot\(\s*"chart\d+",\s*', page)
    ]


def test_the_page_is_well_formed_and_needs_no_network(page: str) -> None:
    tags = Tags()
    tags.feed(page)
    assert tags.open == []
    sources = [value for name, value in tags.attributes if name in ("src", "href")]
    assert sources == ["data:,"]
    assert page.startswith("<!DOCTYPE html>\n<!-- report of hybridsep -->")


def test_text_is_escaped(page: str) -> None:
    for text in ("Axis &lt;X&gt; &amp; co", "$ 5 samples", "use &lt;hybrid&gt;", "a &lt; b", "&lt;a&gt;", "A &amp; B"):
        assert text in page


def test_long_lines_keep_their_extremes(page: str) -> None:
    first, second = charts(page)
    assert [trace["name"] for trace in first] == ["y", "band", "band"]
    assert [trace["showlegend"] for trace in first] == [True, False, True]
    assert second[0]["mode"] == "markers"
    assert first[2]["fillcolor"] == "rgba(1, 2, 3, 0.18)"
    assert len(page) < 6_500_000  # of which plotly.js has 4.9 million
    y = np.frombuffer(base64.b64decode(first[0]["y"]["bdata"]), dtype=first[0]["y"]["dtype"])
    assert len(y) <= 6002
    assert np.nanmax(y) == 7.0


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="nowhere"):
        Report("a", "b").write(tmp_path / "nowhere" / "report.html")


def test_charts_for_print_are_one_column_wide_a_page_each(tmp_path: Path) -> None:
    t = np.arange(50_000) * 1e-3
    band = Line("band", t, -np.ones(len(t)), "#010203", upper=np.ones(len(t)), panel=1)
    charts = [
        Chart("t [s]", ("y [µm]", "e [µm]"), [Line("y", t, np.sin(t), "#123456"), band]),
        Chart("f [Hz]", ("g",), [Line("", [1.0, 2.0], [3.0, 4.0], "#ff0000", points=True)], x_log=True, y_log=True),
    ]
    written = []
    for name in ("a.pdf", "b.pdf"):
        write_pages(charts, tmp_path / name)
        written.append((tmp_path / name).read_bytes())
    assert written[0] == written[1]
    boxes = [[float(edge) for edge in box.split()] for box in re.findall(rb"/MediaBox \[([^]]*)\]", written[0])]
    assert [box[2] for box in boxes] == [pytest.approx(72.0 * COLUMN_WIDTH / 25.4, abs=0.01)] * 2
    assert len(written[0]) < 400_000
