"""What is said of logs: what they hold, what refuses them, what to type, and what is left on the disk."""

import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from command_line import Run, write_log, write_rows
from log_files import twincat_csv
from staircase_data import commanded, measured

from hybridsep.logs.log import read_log

MACHINE = ("--machine", "spring_mass_damper")


@pytest.mark.parametrize(
    "command",
    [("fit", "--out", "deep/new"), ("backtest", *MACHINE, "--save", "new/run.csv", "--report", "new/page.html")],
    ids=lambda command: command[0],
)
def test_a_log_without_any_measurement(
    hybridsep: Run, tmp_path: Path, command: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """NaN in all samples: RuntimeWarnings, a state that had learned no sample, and three files."""
    write_rows(tmp_path / "axis.csv", commanded()[:2000], np.full(2000, np.nan))
    monkeypatch.chdir(tmp_path)
    err = hybridsep.refused(command[0], "axis.csv", *command[1:])
    assert err.count("\n") == 1
    assert "the measured position is missing (NaN) in all 2000 samples; name its column (--x)" in err
    assert [path.name for path in tmp_path.iterdir()] == ["axis.csv"]


def test_a_refused_run_leaves_no_folder_and_takes_none_that_was_there(hybridsep: Run, tmp_path: Path) -> None:
    log = write_rows(tmp_path / "axis.csv", commanded()[:1500], -measured(0)[:1500])
    (tmp_path / "old").mkdir()
    for folder in ("new/inner", "old"):
        assert hybridsep("fit", log, "--out", tmp_path / folder)[0] == 2
    assert hybridsep("fit", tmp_path / "none.csv", "--out", tmp_path / "new")[0] == 2
    assert hybridsep("build", "--machine", "emps", "--weights", log, "--out", tmp_path / "new")[0] == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["axis.csv", "old"]


def test_a_refusal_names_its_file_and_itself_once(
    hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    x_d = commanded()[:2000] - commanded()[0]
    x = np.convolve(x_d, np.exp(-np.arange(60) / 12) / 12)[:2000]  # a lag of 12 ms
    write_rows(tmp_path / "axis.csv", x_d, x, header="t,x [m],x_d")
    monkeypatch.setattr("sys.argv", ["hybridsep", "fit", "axis.csv"])
    err = hybridsep.refused("fit", "axis.csv", "--out", "fit")
    assert err.startswith("error: axis.csv: columns swapped: x_d follows x, ")
    assert err.count("error:") == 1
    assert "  hybridsep fit axis.csv --out fit --x_d 'x [m]' --x x_d  # the two columns exchanged" in err
    err = hybridsep.refused("backtest", "axis.csv", *MACHINE, "--report", "page.html")
    assert err.startswith("error: axis.csv: columns swapped: x_d follows x, ")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["axis.csv"]


@pytest.mark.parametrize("scale", [1e3, 6e4])  # refused by the checks, and by the reader
def test_a_log_without_units_is_refused_with_lines_to_paste(tmp_path: Path, hybridsep: Run, scale: float) -> None:
    log = write_log(tmp_path / "joint 3.csv", header="t,goal,present", scale=scale)
    given = ("fit", log, "--x_d", "goal", "--x", "present")
    err = hybridsep.refused(*given, "--out", tmp_path / "fit")
    lines = [line.strip() for line in err.splitlines() if line.startswith("  hybridsep ")]
    command = shlex.split(lines[0], comments=True)
    assert command == ["hybridsep", *map(str, given), "--out", str(tmp_path / "fit"), "--unit", "mm"]
    assert lines[0].endswith("# a linear axis in mm")
    assert [shlex.split(line, comments=True)[-1] for line in lines] == ["mm", "um", "deg"]
    assert "joint" in lines[2]


def test_a_machine_file_that_fit_wrote_is_named(
    tmp_path: Path, hybridsep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_log(Path("axis.csv"), n=20)
    err = hybridsep.refused("backtest", "axis.csv")
    assert "It is the axis's machine file, which hybridsep fit axis.csv writes" in " ".join(err.split())
    Path("axis").mkdir()
    Path("axis/machine.toml").touch()
    err = hybridsep.refused("backtest", "axis.csv")
    assert "There is axis/machine.toml: add -m axis/machine.toml" in " ".join(err.split())


def test_the_same_log_twice_counts_once(tmp_path: Path, hybridsep: Run) -> None:
    logs = [write_rows(tmp_path / name, commanded()[:800], measured(0)[:800]) for name in ("a.csv", "b.csv")]
    # A refusal that comes after, and soon
    err = hybridsep.refused("fit", *logs, "--Np", 500, "--out", tmp_path / "fit")
    assert f"note: {logs[1]} has the samples of {logs[0]}: it counts once" in err


def recording(path: Path) -> Path:
    """Write a command at 1 kHz, and a position and a torque at 500 Hz."""
    x_d, x = commanded()[:4000], measured(0)[:4000]
    path.write_text(twincat_csv({"x_d": (1e-3, x_d), "x": (2e-3, x[::2]), "torque": (2e-3, x[::2])}))
    return path


def test_channels_are_listed(tmp_path: Path, hybridsep: Run) -> None:
    path = recording(tmp_path / "log.csv")
    status, out, err = hybridsep("fit", path, "--list-channels")
    assert (status, err) == (0, "")
    rows = [line.split() for line in out.splitlines() if line.strip()]
    assert ["x_d", "m", "commanded"] in rows
    assert ["torque", "m"] in rows
    status, out, err = hybridsep("fit", path, "--list-channels", "--json")
    assert (status, err) == (0, "")
    listed = {one["name"]: one for one in json.loads(out)[str(path)]}
    assert listed["x"] == {"name": "x", "unit": "m", "role": "x"}
    assert [one.name for one in tmp_path.iterdir()] == ["log.csv"]
    odd = write_log(tmp_path / "odd.csv", n=20, header="t,one,other")
    out = hybridsep.done("fit", odd, "--list-channels")
    words = "none is read as the commanded and measured position; name it: hybridsep fit "
    assert f"{words}{odd} --x_d NAME --x NAME" in out
    odd.write_text("0.000 0 0\n0.001 0 0\n0.002 0 0\n")
    assert "has no line of names, its first line is numbers" in hybridsep.refused("fit", odd, "--list-channels")


def test_rates_that_differ_are_said_and_resampled(tmp_path: Path, hybridsep: Run) -> None:
    path = recording(tmp_path / "log.csv")
    replay = ("backtest", path, "-m", "spring_mass_damper", "--json")
    err = hybridsep.refused(*replay)
    assert "'x_d' has 4000 samples every 0.001 s, 'x' has 2000 samples every 0.002 s" in err
    assert "(--resample) takes both at the times of the slower one" in err
    err = hybridsep.refused(*replay, "--resample")  # the machine has 1 kHz
    assert "sampled every 0.002 s, but machine spring_mass_damper has T_s = 0.001 s" in err
    assert len(read_log(path, resample=True).t) == 2000
