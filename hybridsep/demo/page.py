"""Index page of the demonstration's folder: tables, pictures and files; it needs no network."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Any

from ..base.output import written_text
from .tables import Table, compensation_table, prediction_table

__all__ = ["write_page"]

_PICTURES = {
    "staircase_compensated.png": "Staircase: tracking error, not compensated and with both models",
    "spiral_contour.png": "Spiral: contour error of both axes together",
    "spiral_x_compensated.png": "Spiral, X axis: tracking error",
    "spiral_y_compensated.png": "Spiral, Y axis: tracking error",
    "staircase.png": "Staircase: prediction error of the paper's model",
    "spiral_x.png": "Spiral, X axis: prediction error of the paper's model",
    "spiral_y.png": "Spiral, Y axis: prediction error of the paper's model",
    "spiral.png": "Spiral: path and prediction error of the paper's model",
    "emps.png": "EMPS, a recorded axis: prediction error of the paper's model",
}
"""What pictures show, in the order of the page; the first ones are of what compensation is worth."""

_TEMPLATE = Path(__file__).parent / "templates" / "index.html"


def write_page(out: Path, summary: Mapping[str, Mapping[str, Any]], files: Sequence[Path]) -> None:
    """Write ``index.html``.

    Parameters
    ----------
    out : Path
        The folder.
    summary : mapping
        As :func:`hybridsep.demo.demo.demo` returns it.
    files : sequence of Path
        All files in the folder, the page among them.
    """
    names = [path.relative_to(out).as_posix() for path in files if path.name != "index.html"]
    verdicts = [f"<p>{html.escape(name)}: {html.escape(case['verdict'])}</p>" for name, case in summary.items()]
    page = Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(
        compensation=_table(compensation_table(summary)),
        prediction=_table(prediction_table(summary)),
        pictures="\n".join(_picture(name, words) for name, words in _PICTURES.items() if name in names),
        verdicts="\n".join(verdicts),
        files="\n".join(
            f'<li><a href="{html.escape(name)}">{html.escape(name)}</a></li>'
            for name in sorted(names)
            if name not in _PICTURES
        ),
    )
    with written_text(out / "index.html") as file:
        file.write(page)


def _table(table: Table) -> str:
    head = "".join(f"<th>{html.escape(column)}</th>" for column in ("case", *table.columns))
    rows = [f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>" for row in table.rows]
    return (
        f"<h2>{html.escape(table.title)}</h2>\n"
        f'<div class="tables"><table>\n<tr>{head}</tr>\n' + "\n".join(rows) + "\n</table></div>\n"
        f'<p class="dim">{html.escape(table.note)}</p>'
    )


def _picture(name: str, words: str) -> str:
    return (
        f'<figure><img src="{name}" alt="{html.escape(words)}"><figcaption>{html.escape(words)}</figcaption></figure>'
    )
