"""Command lines and Python blocks of README and documentation, run page by page after the README's fit."""

import contextlib
import io
import json
import re
import shutil
import sys
from pathlib import Path

import pytest
from built_once import built_once
from command_line import Run, run_line
from places import ROOT
from quick_fits import without_larger_structures, without_other_settings

from benchmarks.pictures import RECORD, judged_figures
from hybridsep import staircase

FOLDERS = [ROOT / "docs" / name for name in ("start", "howto")]
PAGES = [ROOT / "README.md", *(page for folder in FOLDERS for page in sorted(folder.glob("*.md")))]
RUN = re.compile(r"```(sh|python)\n(.*?)```", re.DOTALL)
ELSEWHERE = ("python3 -m venv", "sphinx-build ", "hybridsep fit my_axis.csv --Np 100 --v_max ")
"""Begin of lines that others run: CI, ``test_demo``, ``test_site``, ``test_fit_compensation``."""
FIT = "hybridsep fit my_axis.csv --Np 100"
LOG = "hybridsep example-log --out my_axis.csv"
ROWS = 1601
"""Lines of the example log that are left once it is written, and at night once it is fitted: of the others it is tested
that they work."""
MOVES = 3000  # samples of the staircase that blocks of Python run by day
MADE = {"README.md": "my_axis/report.html", "read-the-report.md": "replay.html", "close-the-loop.md": "compensated.png"}
"""Files that pages leave."""


def pieces() -> dict[Path, list[tuple[str, str]]]:
    """Return each page's command lines and blocks of Python with their language, of equal ones the first."""
    done = {FIT, LOG}
    found: dict[Path, list[tuple[str, str]]] = {}
    for page in PAGES:
        for language, text in RUN.findall(page.read_text(encoding="utf-8")):
            for piece in [text] if language == "python" else text.splitlines():
                if piece not in done and not piece.startswith(ELSEWHERE):
                    done.add(piece)
                    found.setdefault(page, []).append((language, piece))
    return found


PIECES = pieces()


def test_every_block_is_run_or_shown() -> None:
    """A command line in a block of another language would be run by nobody."""
    for page in PAGES:
        for language, text in re.findall(r"```(\w+)\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
            assert language in ("sh", "python", "toml", "text"), page.name
            assert language == "sh" or not re.search(r"^(hybridsep|python) ", text, re.MULTILINE), page.name
    lines = [piece for found in PIECES.values() for _, piece in found if piece.startswith("hybridsep ")]
    assert len(lines) >= 10
    assert set(MADE) <= {page.name for page in PIECES}


@pytest.mark.slow
def test_fmpy_gets_the_communication_step_size() -> None:
    """``step_size`` is nothing to a co-simulation, whose steps fmpy doubles until at most 1000 are left."""
    texts = [page.read_text(encoding="utf-8") for page in PAGES]
    calls = [call for text in texts for call in re.findall(r"simulate_fmu\((.*?)\n\)", text, re.DOTALL)]
    assert calls
    assert all("output_interval=1e-3" in call and "step_size" not in call for call in calls)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="the lines are for a POSIX shell")
@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("page", PIECES, ids=lambda page: page.name)
def test_a_page_runs_behind_the_readmes_fit(
    page: Path, whole: bool, hybridsep: Run, tmp_path: Path, session_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not whole:
        without_larger_structures(monkeypatch)
        without_other_settings(monkeypatch)
        monkeypatch.setattr("os.cpu_count", lambda: 1)  # other processes would load all that this one has
        monkeypatch.setattr("hybridsep.staircase", lambda: staircase()[:MOVES])

    def fitted(folder: Path) -> None:
        folder.mkdir()
        monkeypatch.chdir(folder)
        run_line(LOG, hybridsep)
        if whole:
            run_line(FIT, hybridsep)
            assert_the_row_of_the_readme(folder / "my_axis" / "fit.json")
        log = folder / "my_axis.csv"
        log.write_text("".join(log.read_text().splitlines(keepends=True)[:ROWS]))
        if not whole:
            run_line(FIT, hybridsep)

    shutil.copytree(built_once(session_folder / f"fit of the pages, {whole}", fitted), tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    for language, piece in PIECES[page]:
        if language == "python":
            python(piece, page)
        else:
            run_line(piece, hybridsep)
    if page.name in MADE:
        assert (tmp_path / MADE[page.name]).stat().st_size > 0


def assert_the_row_of_the_readme(results: Path) -> None:
    """Compare the README's prediction errors with the fit's, µm."""
    judged = json.loads(results.read_text(encoding="utf-8"))["judged"]
    (row,) = re.findall(rf"^\| prediction: `{FIT}` \|(.*)\|$", PAGES[0].read_text(encoding="utf-8"), re.MULTILINE)
    found = judged_figures(judged)
    assert [float(figure) for figure in re.findall(r"[\d.]+", row)] == pytest.approx([*found.values()], rel=0.02)
    pictured = json.loads(RECORD.read_text(encoding="utf-8"))["fit_report.png"]["figures"]
    assert found == pytest.approx(pictured, rel=2e-3), "python -m benchmarks.pictures"


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
