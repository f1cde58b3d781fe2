"""Logs that commands refuse, or change only with a word about it: what is said, and what is left on the disk."""

from pathlib import Path

import numpy as np
import pytest
from command_line import Run, write_rows
from staircase_data import commanded, measured

MACHINE = ("--machine", "spring_mass_damper")


@pytest.fixture
def without_measurement(tmp_path: Path) -> Path:
    return write_rows(tmp_path / "axis.csv", commanded()[:2000], np.full(2000, np.nan))


@pytest.mark.parametrize(
    "command",
    [("fit", "--out", "deep/new"), ("backtest", *MACHINE, "--save", "new/run.csv", "--report", "new/page.html")],
    ids=lambda command: command[0],
)
def test_a_log_without_any_measurement(
    hybridsep: Run, without_measurement: Path, command: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """NaN in all samples: RuntimeWarnings, a state that had learned no sample, and three files."""
    folder = without_measurement.parent
    monkeypatch.chdir(folder)
    status, out, err = hybridsep(command[0], "axis.csv", *command[1:])
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert "the measured position is missing (NaN) in all 2000 samples; name its column (--x), or record it" in err
    assert [path.name for path in folder.iterdir()] == ["axis.csv"]


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
    status, out, err = hybridsep("fit", "axis.csv", "--out", "fit")
    assert (status, out) == (2, "")
    assert err.startswith("error: axis.csv: columns swapped: x_d follows x, ")
    assert err.count("error:") == 1
    assert "  hybridsep fit axis.csv --out fit --x_d 'x [m]' --x x_d  # the two columns exchanged" in err
    status, out, err = hybridsep("backtest", "axis.csv", *MACHINE, "--report", "page.html")
    assert (status, out) == (2, "")
    assert err.startswith("error: axis.csv: columns swapped: x_d follows x, ")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["axis.csv"]
