"""Report: a page that stands alone, escapes what it is given, and draws all that matters of long lines."""

import re
from base64 import b64decode
from html.parser import HTMLParser
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plotly.graph_objects import Figure

from hybridsep.evaluate.html_report import Chart, Line, Report, drawn_places


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
    points = Line("</script>", [1.0, 2.0], [3.0, np.nan], "#ff0000", points=True)
    for caption in ("A caption", "<&>"):
        report.chart(Chart("f [Hz]", ("<!--",), [points], caption, x_log=True, y_log=True))
    path = tmp_path_factory.mktemp("report") / "report.html"
    report.write(path)
    return path.read_text(encoding="utf-8")


def test_the_page_is_well_formed_and_needs_no_network(page: str) -> None:
    tags = Tags()
    tags.feed(page)
    assert tags.open == []
    assert [value for name, value in tags.attributes if name in ("src", "href")] == ["data:,"]
    assert page.startswith("<!DOCTYPE html>\n")
    assert 'addEventListener("beforeprint"' in page  # charts get the paper's width
    assert "<thead><tr><th>name</th>" in page  # repeated on the next page


def test_text_is_escaped(page: str) -> None:
    for text in ("Axis &lt;X&gt; &amp; co", "$ 5 samples", "use &lt;hybrid&gt;", "a &lt; b", "&lt;a&gt;", "A &amp; B"):
        assert text in page


def test_plotly_is_in_it_once_and_no_name_ends_a_script(page: str) -> None:
    assert page.count("plotly.js v") == 1
    assert page.count("Plotly.newPlot(") >= 2
    scripts = re.findall(r"<script[^>]*>(.*?)</script>", page, re.DOTALL)
    drawn = [script for script in scripts if '"f [Hz]"' in script]
    assert len(drawn) == 2
    assert all(script.rstrip().endswith("};") for script in drawn)
    assert not any("</" in script or "<!--" in script for script in drawn)


def traces(chart: Chart) -> tuple[Any, ...]:
    """Its lines, whose names plotly checks, with numbers."""
    found: tuple[Any, ...] = Figure(chart.figure()).data
    for one in found:
        one.x, one.y = (np.frombuffer(b64decode(values["bdata"])) for values in (one.x, one.y))
    return found


def test_of_a_long_line_the_extremes_are_drawn() -> None:
    t = np.arange(50_000) * 1e-3
    y = np.sin(t)
    y[31_234], y[100] = 7.0, np.nan
    band = Line("band", t, -np.ones(len(t)), "#010203", upper=np.ones(len(t)), panel=1)
    found = traces(Chart("t [s]", ("y [µm]", "e [µm]"), [Line("y", t, y, "#123456"), band]))
    assert [(trace.name, trace.showlegend) for trace in found] == [("y", True), ("band", True)]
    assert found[1].fillcolor == "rgba(1, 2, 3, 0.18)"
    assert [trace.yaxis for trace in found] == ["y", "y2"]
    assert len(found[0].y) <= 1202
    assert np.nanmax(found[0].y) == 7.0


def test_a_line_is_cut_where_a_gap_is() -> None:
    """It was drawn across, and a command seemed to jump; the legend has it once."""
    t = np.arange(9000.0)
    lines = [Line("y", t, t, "#123456"), Line("band", t, -t, "#010203", upper=t)]
    pieces = [piece for line in lines for piece in line.cut([5000, 8000, 8000])]
    found = traces(Chart("t [s]", ("y",), pieces))
    assert [one.showlegend for one in found] == [True, False, False, True, False, False]
    assert [(min(one.x), max(one.x)) for one in found[:3]] == [(0, 4999), (5000, 7999), (8000, 8999)]
    assert [one.legendgroup for one in found] == ["y"] * 3 + ["band"] * 3


def test_a_band_with_a_gap_is_one_outline_a_stretch() -> None:
    upper = np.array([1.0, 1.0, np.nan, 1.0])
    (band,) = traces(Chart("f [Hz]", ("γ²",), [Line("band", [1, 2, 3, 4], -upper, "#010203", upper=upper)]))
    np.testing.assert_array_equal(band.x, [1, 2, 2, 1, np.nan, 4, 4, np.nan])
    np.testing.assert_array_equal(band.y, [-1, -1, 1, 1, np.nan, -1, 1, np.nan])


@given(n=st.integers(1, 3000), columns=st.integers(1, 300), n_lines=st.integers(1, 2), seed=st.integers(0, 9))
def test_each_column_keeps_the_extremes_of_all_lines(n: int, columns: int, n_lines: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    lines = np.where(random.random((n_lines, n)) < 0.3, np.nan, random.normal(size=(n_lines, n)))
    places = drawn_places(columns, *lines)
    assert (np.diff(places) > 0).all()
    assert (places[0], places[-1]) == (0, n - 1)
    if n <= 2 * columns:
        assert len(places) == n
        return
    assert len(places) <= 2 * n_lines * columns + 2
    edges = np.linspace(0, n, columns + 1).astype(int)
    for begin, end in pairwise(edges):
        kept = places[(places >= begin) & (places < end)]
        for y in lines:
            if np.isnan(y[begin:end]).all():
                assert begin in kept  # a gap
            else:
                assert np.nanmax(y[kept]) == np.nanmax(y[begin:end])
                assert np.nanmin(y[kept]) == np.nanmin(y[begin:end])
