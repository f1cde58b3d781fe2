"""Progress where standard error is no terminal: stages as lines, the demo's duration first, nothing with --json."""

import re
from pathlib import Path

import pytest
from command_line import Run
from places import ROOT

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


def test_the_demo_and_the_readme_say_how_long_it_takes(
    hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("hybridsep.demo.cases.demo", interrupted)
    status, out, err = hybridsep("demo", "--out", tmp_path / "demo")
    assert (status, out) == (130, "")
    assert err.startswith("note: this takes about 10 seconds of processor time")
    _, found, after = (ROOT / "README.md").read_text(encoding="utf-8").partition("hybridsep demo --out demo\n```\n")
    assert found
    assert "about 10 seconds of processor time" in " ".join(after[:800].split())
