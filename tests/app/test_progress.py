"""Progress where standard error is no terminal: stages as lines, the demo's duration first, nothing with --json."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from threading import Timer

import pytest

from hybridsep.app import console
from hybridsep.app.console import progress_bar


class Clock:
    """Time that a test sets, s."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(console, "monotonic", clock)
    return clock


def test_a_line_for_each_stage_and_for_each_pause(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar(False) as advance:
        for k in range(300):  # 30 s, two stages
            clock.now += 0.1
            advance("first" if k < 100 else "second", k / 300)
        advance("done", 1.0)
    out, err = capsys.readouterr()
    lines = err.splitlines()
    assert out == ""
    assert [line.split("] ")[1] for line in lines] == ["first", "first", *["second"] * 4]
    assert all(re.fullmatch(r"\[ *\d+%\] \w+", line) for line in lines)


def test_what_is_quick_and_what_prints_json_says_nothing(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    for quiet, seconds in ((False, 1.9), (True, 60.0)):
        with progress_bar(quiet) as advance:
            advance("stage", 0.0)
            clock.now += seconds
            advance("next stage", 0.5)
            advance("done", 1.0)
    assert capsys.readouterr() == ("", "")


@pytest.mark.slow
def test_the_demo_says_in_a_pipe_how_long_it_takes_and_where_it_is(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "hybridsep", "demo", "--out", str(tmp_path / "demo")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert process.stdout is not None
        late = Timer(120.0, process.kill)
        late.start()
        try:
            said = [process.stderr.readline().rstrip() for _ in range(2)]
        finally:
            late.cancel()
            process.kill()
        out = process.stdout.read()
    assert said[0] == "note: this takes about 10 seconds of processor time"
    assert all(re.fullmatch(r"\[ *\d+%\] staircase, .+", line) for line in said[1:])
    assert out == ""


def test_the_readme_says_how_long_its_first_command_takes() -> None:
    readme = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    before, _, after = readme.partition(".venv/bin/hybridsep demo --out demo\n```\n")
    told = " ".join(after[:800].split())
    assert before
    assert "about 10 seconds of processor time" in told
