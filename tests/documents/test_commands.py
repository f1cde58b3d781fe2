"""Command lines and Python blocks of README and documentation, run page by page in one folder."""

from __future__ import annotations

import contextlib
import io
import json
import re
import sys
from pathlib import Path

import pytest
from command_line import Run, run_line
from places import ROOT
from quick_fits import without_other_settings, without_other_windows

from benchmarks.pictures import RECORD, judged_figures
from hybridsep import staircase

PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs" / "start").glob("*.md")),
    *sorted((ROOT / "docs" / "howto").glob("*.md")),
]
RUN = re.compile(r"```(sh|python)\n(.*?)```", re.DOTALL)
ELSEWHERE = ("python3 -m venv", "sphinx-build ", "hybridsep fit my_axis.csv --Np 100 --v_max ")
"""Begin of lines that others run: CI, ``test_demo``, ``test_site``, ``test_fit_compensation``."""
FIT = "hybridsep fit my_axis.csv --Np 100"
LOG = "hybridsep example-log --out my_axis.csv"
ROWS = 3001
"""Lines of the example log that are left once it is written, and at night once the README's fit is over: of the others
it is tested that they work."""
MOVES = 3500
"""Samples of the staircase that blocks of Python run by day."""


def test_every_block_is_run_or_shown() -> None:
    """A command line in a block of another language would be run by nobody."""
    for page in PAGES:
        for language, text in re.findall(r"```(\w+)\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
            assert language in ("sh", "python", "toml", "text"), page.name
            assert language == "sh" or not re.search(r"^(hybridsep|python) ", text, re.MULTILINE), page.name


@pytest.mark.slow
def test_fmpy_gets_the_communication_step_size() -> None:
    """``step_size`` is nothing to a co-simulation, whose steps fmpy doubles until at most 1000 are left."""
    calls = [
        call
        for page in PAGES
        for call in re.findall(r"simulate_fmu\((.*?)\n\)", page.read_text(encoding="utf-8"), re.DOTALL)
    ]
    assert calls
    assert all("output_interval=1e-3" in call and "step_size" not in call for call in calls)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="the lines are for a POSIX shell")
@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.nightly)])
def test_the_pages_run_from_first_to_last(
    whole: bool, hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    without_other_windows(monkeypatch)
    if not whole:
        without_other_settings(monkeypatch)
        monkeypatch.setattr("hybridsep.staircase", lambda: staircase()[:MOVES])
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    done: set[str] = set()
    for page in PAGES:
        for language, text in RUN.findall(page.read_text(encoding="utf-8")):
            for piece in [text] if language == "python" else text.splitlines():
                if piece in done or piece.startswith(ELSEWHERE):
                    continue
                done.add(piece)
                if language == "python":
                    python(piece, page)
                else:
                    run_line(piece, hybridsep)
                    capsys.readouterr()
                if piece == FIT and whole:
                    assert_the_row_of_the_readme(tmp_path / "my_axis" / "fit.json")
                if piece == (FIT if whole else LOG):
                    log = tmp_path / "my_axis.csv"
                    log.write_text("".join(log.read_text().splitlines(keepends=True)[:ROWS]))
    assert len([piece for piece in done if piece.startswith("hybridsep ")]) >= 12
    for name in ("my_axis/report.html", "replay.html", "tuned.toml", "compensated.png"):
        assert (tmp_path / name).stat().st_size > 0, name


def assert_the_row_of_the_readme(results: Path) -> None:
    """Compare the README's prediction errors with the fit's, µm."""
    judged = json.loads(results.read_text(encoding="utf-8"))["judged"]
    (row,) = re.findall(rf"^\| prediction: `{FIT}` \|(.*)\|$", PAGES[0].read_text(encoding="utf-8"), re.MULTILINE)
    best_of_arx = min(rms for name, rms in judged["peers"].items() if name.startswith("ARX"))
    found = [judged["rms_pb"], judged["rms_hold"], best_of_arx, judged["rms_h"]]
    assert [float(figure) for figure in re.findall(r"[\d.]+", row)] == pytest.approx(
        [1e6 * rms for rms in found], rel=0.02
    )
    pictured = json.loads(RECORD.read_text(encoding="utf-8"))["fit_report.png"]["figures"]
    assert judged_figures(judged) == pytest.approx(pictured, rel=2e-3), "python -m benchmarks.pictures"


def python(text: str, page: Path) -> None:
    """Run a block; what it prints is finite numbers where it prints any."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(text, page.name, "exec"), {"__name__": page.stem})
    out = printed.getvalue()
    assert "nan" not in out
    numbers = [float(word) for word in out.split() if re.fullmatch(r"[\d.]+", word)]
    if "rms_h_um" in text:
        assert numbers[1] < 0.5 * numbers[0]
    if "tracking_rms" in text:
        assert numbers[0] < 8.0
