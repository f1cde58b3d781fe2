"""One page about a fleet: gains, what to look at first, and the course of each axis; one file that needs no network."""

import html
import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import median_high
from string import Template
from typing import Any

from hybridsep.base.errors import LogError
from hybridsep.base.files import write_whole

_WORSE, _SHIFT, _FRICTION, _RESIDUAL = 1.03, 0.05, 0.3, 0.5
"""From which on an axis is looked at: error relative to the best baseline; relative changes of the first mode's
frequency, of friction and of the error since the logs before. Two fits of one axis on recordings of different motions
differ by less on the recorded axes; these are the first rows of a list, not alarms."""

_FIRST_MOST = 20  # axes of a kind that are listed first

_KINDS = ("Failed", "Worse than a baseline", "Changed since the logs before", "Faults of recording")
"""What speaks for looking at an axis, by gravity."""

_BINS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5, math.inf)


@dataclass(frozen=True)
class Course:
    """Logs of an axis in the order of their days."""

    machine: str
    axis: str
    rows: list[dict[str, Any]]  # the latest row of each log

    @property
    def done(self) -> list[dict[str, Any]]:
        """Rows with figures."""
        return [row for row in self.rows if row["status"] == "done"]

    def series(self, name: str) -> list[float | None]:
        """Return a figure of each log: a column, or ``mode``, the frequency of the slowest mode, Hz."""
        return [_mode(row) if name == "mode" else row[name] for row in self.done]

    def remarks(self) -> list[tuple[str, str]]:
        """Return what speaks for looking at it, the gravest first: of which kind, and in words."""
        latest = self.rows[-1]
        failed, worse, changed, faults = _KINDS
        if latest["status"] != "done":
            return [(failed, latest["message"] or "failed")]
        found = []
        ratio = latest["ratio"]
        if ratio is not None and ratio > _WORSE:
            found.append((worse, f"worse than {latest['best']}: {ratio:.2f} × its error"))
        for name, words, most in (
            ("mode", "slowest mode", _SHIFT),
            ("friction", "friction", _FRICTION),
            ("rms_h", "error", _RESIDUAL),
        ):
            change = _change(self.series(name))
            if abs(change) > most:
                found.append((changed, f"{words} {'up' if change > 0 else 'down'} by {100 * abs(change):.0f} %"))
        listed = json.loads(latest["findings"] or "[]")
        return found + [(faults, words) for _, severity, words in listed if severity != "note"]

    def words(self) -> str:
        """Return all remarks."""
        return "; ".join(words for _, words in self.remarks())


def courses(rows: Sequence[Mapping[str, Any]]) -> list[Course]:
    """Return the axes of a fleet, by machine and axis; a log that was fitted again counts as it was fitted last."""
    latest: dict[tuple[str, str], dict[str, dict[str, Any]]] = {}
    for row in rows:
        latest.setdefault((row["machine"], row["axis"]), {})[row["url"]] = dict(row)
    return [
        Course(machine, axis, sorted(logs.values(), key=lambda row: (row["recorded"] or "", row["url"])))
        for (machine, axis), logs in sorted(latest.items())
    ]


def write_page(rows: Sequence[Mapping[str, Any]], page: Path, results: Path) -> None:
    """Write the page.

    ``rows``: as of :meth:`~hybridsep_fleet.results.Results.rows`; ``results``: folder of the results, to which links
    lead. LogError if there are no rows.
    """
    if not rows:
        raise LogError(f"{results}: there are no results; hybridsep fleet SOURCE --out {results} makes some")
    axes = courses(rows)
    ratios = [row["ratio"] for axis in axes for row in axis.done[-1:] if row["ratio"] is not None]
    failed = sum(axis.rows[-1]["status"] != "done" for axis in axes)
    data = json.dumps([_packed(axis, page, results) for axis in axes], separators=(",", ":")).replace("<", "\\u003c")
    template = (Path(__file__).parent / "templates" / "page.html").read_text(encoding="utf-8")
    days = [row["recorded"] for axis in axes for row in axis.rows if row["recorded"]]
    text = Template(template).substitute(
        title=f"Fleet of {len({axis.machine for axis in axes})} machines, {len(axes)} axes",
        subtitle=f"{sum(len(axis.rows) for axis in axes)} logs and axes, {min(days, default='')} to "
        f"{max(days, default='')}; the latest log of {failed} axes failed",
        histogram=_histogram(ratios),
        first=_first(axes, page, results),
        data=data,
    )
    write_whole(page, text)


def _packed(axis: Course, page: Path, results: Path) -> dict[str, Any]:
    """Return an axis as the page's script takes it: errors and friction in µm or µrad, three digits."""
    done = axis.done
    return {
        "m": axis.machine,
        "a": axis.axis,
        "d": [row["recorded"] for row in done] or [axis.rows[-1]["recorded"]],
        "r": _digits(done[-1]["ratio"], 1.0) if done else None,
        "h": [_digits(value, 1e6) for value in axis.series("rms_h")],
        "f": [_digits(value, 1.0) for value in axis.series("mode")],
        "c": [_digits(value, 1e6) for value in axis.series("friction")],
        "u": f"µ{done[-1]['unit']}" if done else "",
        "w": axis.words()[:200],
        "l": _link(axis, page, results),
    }


def _link(axis: Course, page: Path, results: Path) -> str:
    folder = axis.rows[-1]["folder"]
    report = results / folder / "report.html" if folder else None
    if report is None or not report.is_file():
        return ""
    return Path(os.path.relpath(report, page.parent)).as_posix()


def _digits(value: float | None, factor: float) -> float | None:
    return None if value is None else float(f"{factor * value:.3g}")


def _mode(row: Mapping[str, Any]) -> float | None:
    """Return the natural frequency of the slowest mode, Hz."""
    return min((mode["f_n"] for mode in json.loads(row["modes"] or "[]")), default=None)


def _change(values: Sequence[float | None]) -> float:
    """Return the latest value relative to the median of the values before, less 1; 0 without both."""
    *before, last = [value for value in values if value is not None] or [0.0]
    middle = median_high(before) if before else 0.0
    return last / middle - 1.0 if middle else 0.0


def _first(axes: Sequence[Course], page: Path, results: Path) -> str:
    """Return the lists of the axes to look at first, each axis in the list of its gravest remark."""
    marked: dict[str, list[Course]] = {kind: [] for kind in _KINDS}
    for axis in axes:
        for kind, _ in axis.remarks()[:1]:
            marked[kind].append(axis)
    parts = []
    for kind, found in marked.items():
        found.sort(key=lambda axis: (-(axis.rows[-1]["ratio"] or 0.0), -len(axis.remarks())))
        lines = [_line(axis, page, results) for axis in found[:_FIRST_MOST]]
        more = f'<p class="dim">and {len(found) - _FIRST_MOST} more, below</p>' if len(found) > _FIRST_MOST else ""
        if lines:
            table = f'<div class="wide"><table><tbody>{"".join(lines)}</tbody></table></div>'
            parts.append(f"<h3>{kind}</h3>{table}{more}")
    return "".join(parts) or "<p>None: no axis is worse than a baseline, has changed or has a fault of recording.</p>"


def _line(axis: Course, page: Path, results: Path) -> str:
    """Return a row of the lists."""
    link, name = _link(axis, page, results), html.escape(f"{axis.machine} {axis.axis}".strip())
    shown = f'<a href="{html.escape(link)}">{name}</a>' if link else name
    kind = "" if axis.rows[-1]["status"] == "done" else " bad"
    return f'<tr><td>{shown}</td><td class="words{kind}">{html.escape(axis.words()[:300])}</td></tr>'


def _histogram(ratios: Sequence[float]) -> str:
    """Return a histogram of the hybrid's error relative to the best baseline, as SVG."""
    if not ratios:
        return "<p>No axis has figures.</p>"
    counts = [sum(low <= ratio < high for ratio in ratios) for low, high in pairwise(_BINS)]
    width, height, most = 40, 150, max(counts)
    bars = []
    for i, count in enumerate(counts):
        tall = 110 * count / most
        bars.append(f'<rect x="{i * width + 3}" y="{125 - tall:.1f}" width="{width - 6}" height="{tall:.1f}"/>')
        if count:
            bars.append(f'<text x="{(i + 0.5) * width}" y="{120 - tall:.1f}" text-anchor="middle">{count}</text>')
        bars.append(f'<text x="{i * width}" y="142" text-anchor="middle">{_BINS[i]:g}</text>')
    one = _BINS.index(1.0) * width
    better = sum(ratio < 1.0 for ratio in ratios)
    middle = median_high(ratios)
    words = (
        f"Error of the hybrid relative to the best of physics model, hold and ARX models, latest log of each "
        f"axis: {better} of {len(ratios)} below 1, median {middle:.2f}."
    )
    box = f"-8 0 {len(counts) * width + 16} {height}"
    return (
        f'<svg class="bars" viewBox="{box}" role="img" aria-label="{words}">'
        f'<line x1="{one}" y1="5" x2="{one}" y2="125"/>{"".join(bars)}</svg><p class="dim">{words}</p>'
    )
