"""The page about a fleet: what it says of each axis, its size, and that it loads nothing."""

import json
import re
from pathlib import Path

import pytest
from command_line import Run
from fleet_stubs import row

from hybridsep.base.errors import LogError
from hybridsep_fleet.page import courses, write_page
from hybridsep_fleet.results import Results

DAYS = tuple(f"2026-{month:02}-01" for month in range(1, 7))


def remarks(*figures: dict[str, object]) -> list[str]:
    rows = [row("mill", DAYS[i], **one) for i, one in enumerate(figures)]
    (course,) = courses(rows)
    return [words for _, words in course.remarks()]


def test_what_speaks_for_looking_at_an_axis() -> None:
    assert remarks({}, {}, {}) == []
    assert remarks({"ratio": 0.9}, {"ratio": 1.2}) == ["worse than hold: 1.20 × its error"]
    assert remarks({}, {}, {"modes": '[{"f_n": 18.0}, {"f_n": 60.0}]'}) == ["slowest mode down by 10 %"]
    assert remarks({}, {}, {"friction": 1.5e-6}) == ["friction up by 50 %"]
    assert remarks({}, {}, {"rms_h": 2e-6}) == ["error up by 100 %"]
    assert remarks({}, {"status": "failed", "message": "no numbers", "ratio": None}) == ["no numbers"]
    findings = json.dumps([["gaps", "warning", "two gaps"], ["delay", "note", "late"]])
    assert remarks({"findings": findings}) == ["two gaps"]
    assert remarks({"friction": None, "modes": "[]"}, {"friction": None, "modes": "[]"}) == []


def test_a_log_counts_as_it_was_fitted_last() -> None:
    rows = [row("mill", DAYS[1]), row("mill", DAYS[0], ratio=0.4), row("mill", DAYS[1], ratio=0.3)]
    (course,) = courses(rows)
    assert course.series("ratio") == [0.4, 0.3]


def test_a_page_of_3000_axes(tmp_path: Path) -> None:
    rows = [
        row(
            f"mill {i}",
            day,
            ratio=0.2 + i / 2500,
            rms_h=1e-6 * (1 + i / 7919 + k / 30),
            friction=1e-7 * (i + 3 * k + 1),
        )
        for i in range(3000)
        for k, day in enumerate(DAYS)
    ]
    rows.append(row("</script><b>evil & co", DAYS[0], status="failed", message="<img src=x>", ratio=None))
    write_page(rows, tmp_path / "page.html", tmp_path)
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert len(text) < 5e6
    assert "Fleet of 3001 machines, 3001 axes" in text
    assert "<img" not in text
    assert text.count("</script>") == 1
    assert not re.search(r"(?:src|href)=\"?(?:https?:)?//|@import|url\(", text)
    assert "<h3>Failed</h3>" in text
    assert text.count("worse than hold") > 20  # in the list and in the table
    assert "more, below" in text
    data = json.loads(re.search(r"const rows = (\[.*\]);\n", text)[1])  # type: ignore[index]
    assert len(data) == 3001
    assert data[1]["d"] == list(DAYS)
    assert len(data[1]["h"]) == 6


def test_reports_are_linked(tmp_path: Path, hybridsep: Run) -> None:
    results = Results(tmp_path / "out")
    results.add([row("mill", DAYS[0], folder="axes/X_1", ratio=1.5), row("saw", DAYS[0], folder="axes/gone")])
    (tmp_path / "out" / "axes" / "X_1").mkdir(parents=True)
    (tmp_path / "out" / "axes" / "X_1" / "report.html").write_text("")
    status, out, err = hybridsep("fleet", "report", tmp_path / "out")
    assert (status, err) == (0, "")
    assert "report.html" in out
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert '<a href="axes/X_1/report.html">mill X</a>' in text
    assert "gone" not in text
    assert hybridsep("fleet", "report", tmp_path / "out", "--out", tmp_path / "page.html")[0] == 0
    assert 'href="out/axes/X_1/report.html"' in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_no_results(tmp_path: Path, hybridsep: Run) -> None:
    with pytest.raises(LogError, match="there are no results; hybridsep fleet SOURCE --out"):
        write_page([], tmp_path / "page.html", tmp_path)
    for arguments, message in (
        (("report",), "hybridsep fleet report takes one folder of results, got 0"),
        ((tmp_path,), "--out must name the folder of the results"),
        ((tmp_path, "--out", tmp_path / "out"), "there are no logs"),
    ):
        status, _, err = hybridsep("fleet", *arguments)
        assert status == 2
        assert message in err
