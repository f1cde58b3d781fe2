"""Messages that say what a file is and what to type."""

import shlex
from pathlib import Path

import pytest
from command_line import Run, write_log, write_rows
from staircase_data import commanded, measured


@pytest.mark.parametrize("scale", [1e3, 6e4])  # refused by the checks, and by the reader
def test_a_log_without_units_is_refused_with_lines_to_paste(tmp_path: Path, hybridsep: Run, scale: float) -> None:
    log = write_log(tmp_path / "joint 3.csv", header="t,goal,present", scale=scale)
    given = ("fit", log, "--x_d", "goal", "--x", "present")
    status, out, err = hybridsep(*given, "--out", tmp_path / "fit")
    assert (status, out) == (2, "")
    lines = [line.strip() for line in err.splitlines() if line.startswith("  hybridsep ")]
    command = shlex.split(lines[0], comments=True)
    assert command == ["hybridsep", *map(str, given), "--out", str(tmp_path / "fit"), "--unit", "mm"]
    assert lines[0].endswith("# a linear axis in mm")
    assert shlex.split(lines[1], comments=True)[-2:] == ["--unit", "deg"]
    assert "joint" in lines[1]


def test_a_machine_file_that_fit_wrote_is_named(
    tmp_path: Path, hybridsep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_log(Path("axis.csv"), n=20)
    status, _, err = hybridsep("backtest", "axis.csv")
    assert status == 2
    assert "It is the axis's machine file, which hybridsep fit axis.csv writes" in " ".join(err.split())
    Path("axis").mkdir()
    Path("axis/machine.toml").touch()
    status, _, err = hybridsep("backtest", "axis.csv")
    assert status == 2
    assert "There is axis/machine.toml: add -m axis/machine.toml" in " ".join(err.split())


def test_the_same_log_twice_counts_once(tmp_path: Path, hybridsep: Run) -> None:
    logs = [write_rows(tmp_path / name, commanded()[:800], measured(0)[:800]) for name in ("a.csv", "b.csv")]
    status, _, err = hybridsep("fit", *logs, "--Np", 500, "--out", tmp_path / "fit")
    assert status == 2  # a refusal that comes behind, and soon
    assert f"note: {logs[1]} has the samples of {logs[0]}: it counts once" in err
