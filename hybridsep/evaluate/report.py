"""Report: one HTML file with text, tables and interactive charts, which needs nothing else, not even a network."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from string import Template

from ..base.output import written_text
from .chart import Chart
from .chart_pages import write_pages
from .chart_script import DIGITS, chart_script, packed

__all__ = ["Report"]


@dataclass
class Report:
    """Report that is put together section by section.

    Attributes
    ----------
    title, subtitle : str
    charts : list of Chart
        Those added so far.
    """

    title: str
    subtitle: str
    charts: list[Chart] = field(default_factory=list)
    _parts: list[str] = field(default_factory=list)

    def heading(self, text: str) -> None:
        """Begin a section."""
        self._parts.append(f"<h2>{html.escape(text)}</h2>")

    def paragraph(self, text: str, kind: str = "") -> None:
        """Add a paragraph; ``kind`` is ``verdict``, ``dim`` or empty."""
        self._parts.append(f'<p class="{kind}">{html.escape(text)}</p>' if kind else f"<p>{html.escape(text)}</p>")

    def bullets(self, items: Iterable[str]) -> None:
        """Add a list."""
        self._parts.append("<ul>" + "".join(f"<li>{html.escape(item)}</li>" for item in items) + "</ul>")

    def code(self, text: str) -> None:
        """Add text to be copied."""
        self._parts.append(f"<pre>{html.escape(text)}</pre>")

    def table(self, head: Sequence[str], rows: Iterable[Sequence[str]], words: int | None = None) -> None:
        """Add a table; ``words`` is the column, from 0, of running text."""
        cells = "".join(f"<th>{html.escape(cell)}</th>" for cell in head)
        head_row = f"<thead><tr>{cells}</tr></thead>"
        lines = []
        for row in rows:
            marked = (
                f"<td{' class=words' if i == words else ''}>{html.escape(cell)}</td>" for i, cell in enumerate(row)
            )
            lines.append(f"<tr>{''.join(marked)}</tr>")
        self._parts.append(f'<div class="tables"><table>{head_row}<tbody>{"".join(lines)}</tbody></table></div>')

    def chart(self, chart: Chart) -> None:
        """Add a chart."""
        self.charts.append(chart)
        name = f"chart{len(self.charts)}"
        drawn = f'<div id="{name}" class="chart"></div>'
        caption = f"<figcaption>{html.escape(chart.caption)}</figcaption>" if chart.caption else ""
        self._parts.append(f"<figure>{drawn}{caption}</figure>")

    def write(self, path: str | Path, figures: str | Path | None = None) -> None:
        """Write the HTML file, and its charts to a PDF, a page each, for print.

        Parameters
        ----------
        path : str or Path
        figures : str or Path, optional
            The PDF.
        """
        template = (Path(__file__).parent / "templates" / "report.html").read_text(encoding="utf-8")
        values = {"title": html.escape(self.title), "subtitle": html.escape(self.subtitle)}
        text, n_bytes = packed(chart_script(chart, f"chart{1 + i}") for i, chart in enumerate(self.charts))
        page = Template(template).substitute(
            values, body="\n".join(self._parts), packed=text, n_bytes=n_bytes, digits=DIGITS
        )
        with written_text(path) as file:
            file.write(page)
        if figures is not None:
            write_pages(self.charts, figures)
