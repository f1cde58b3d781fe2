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
from numpy.typing import NDArray
from report_page import scripts

from hybridsep.evaluate.chart import Chart, Line
from hybridsep.evaluate.chart_pages import COLUMN_WIDTH, write_pages
from hybridsep.evaluate.chart_script import DIGITS, chart_script, packed
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
    decoder, text = json.JSONDecoder(), scripts(page)
    return [decoder.raw_decode(text, match.end())[0] for match in re.finditer(r'Plotly\.newPlot\("chart\d+", ', text)]


def values(binary: dict[str, str]) -> NDArray[np.float64]:
    """Return the values of a trace's axis."""
    return np.frombuffer(base64.b64decode(binary["bdata"]), dtype=binary["dtype"]).astype(np.float64)


def rules(page: str, medium: str) -> dict[str, str]:
    """Return the style of each selector within a medium's block."""
    block = page.partition(f"@media {medium} {{")[2].partition("\n}")[0]
    found: dict[str, str] = {}
    for selectors, style in re.findall(r"([^{}]+)\{([^{}]*)\}", block):
        for selector in selectors.split(","):
            found[selector.strip()] = found.get(selector.strip(), "") + style
    return found


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
    y = values(first[0]["y"])
    assert len(y) <= 2002
    assert np.nanmax(y) == 7.0
    assert len(page) < 1_950_000  # of which plotly.js has 1.84 million


def test_an_offset_costs_no_digits() -> None:
    t = np.arange(3000) * 1e-4
    chart = Chart("t [s]", ("y",), [Line("y", 1.7e9 + t, 500.0 + 1e-6 * np.sin(t), "#123456")])
    packed = json.JSONDecoder().raw_decode(chart_script(chart, "chart1"), len('Plotly.newPlot("chart1", '))[0][0]
    shown = values(packed["x"])
    assert (np.diff(shown) > 0).all()
    assert np.ptp(values(packed["y"])) == pytest.approx(1e-6 * np.ptp(np.sin(t)), rel=1e-2)


def test_names_cannot_end_the_script() -> None:
    chart = Chart("</script><script>", ("<!--",), [Line("</script>", [0.0], [1.0], "#123456")])
    text, _ = packed([chart_script(chart, "chart1")])
    assert set(text) <= set(DIGITS)
    assert "<" not in DIGITS


def test_on_paper_nothing_scrolls_and_nothing_is_cut(page: str) -> None:
    paper = rules(page, "print")
    assert "white-space: pre-wrap" in paper["pre"]
    assert "overflow-wrap: anywhere" in paper["pre"]
    for selector in ("pre", ".tables"):
        assert "overflow: visible" in paper[selector]
    assert "white-space: normal" in paper["td"]
    for selector in ("figure", "pre", "tr"):
        assert "break-inside: avoid" in paper[selector]
    assert "break-after: avoid" in paper["h2"]
    assert "h2" not in [selector for selector, style in paper.items() if "break-inside" in style]
    assert 'addEventListener("beforeprint"' in page  # charts get the paper's width
    assert "<thead><tr><th>name</th>" in page  # repeated on the next page


def test_a_phone_shows_that_a_table_goes_on(page: str) -> None:
    phone = rules(page, "(max-width: 40rem)")
    assert "white-space: normal" in phone["th"]
    assert "white-space: normal" in phone["td:first-child"]
    assert re.search(r"\.tables \{[^}]*overflow-x: auto;[^}]*\blocal\b[^}]*\bscroll;", page)


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="nowhere"):
        Report("a", "b").write(tmp_path / "nowhere" / "report.html")


@pytest.mark.slow
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
