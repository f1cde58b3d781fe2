"""Logs that commands refuse, or change only with a word about it: what is said, and what is left on the disk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import Run, write_log, write_rows
from staircase_data import commanded, measured

from hybridsep.intake.repair import changed_by, changes, take_in
from hybridsep.logs.log import read_log

MACHINE = ("--machine", "spring_mass_damper")
TRUST = ("--trust", "true")


@pytest.fixture
def without_measurement(tmp_path: Path) -> Path:
    return write_rows(tmp_path / "axis.csv", commanded()[:2000], np.full(2000, np.nan))


@pytest.mark.parametrize(
    "command",
    [
        ("fit", "--out", "deep/new"),
        ("identify", "--out", "new/machine.toml"),
        ("backtest", *MACHINE, *TRUST, "--out", "new/batches.csv"),
        ("tune", *MACHINE, *TRUST, "--p", "10", "--Np", "50", "--out", "new/tuned.toml"),
        ("report", *MACHINE, *TRUST, "--out", "new/page.html"),
    ],
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


def test_a_refusal_names_its_file_and_itself_once(hybridsep: Run, tmp_path: Path) -> None:
    """It began with "error: clipped.csv: error: clipped: "."""
    x = np.clip(measured(0)[:3000], 4e-3, 2e-2)
    clipped, turned = (write_rows(tmp_path / f"{name}.csv", commanded()[:3000], x) for name in ("clipped", "turned"))
    write_rows(turned, commanded()[:3000], -measured(0)[:3000])
    for log, finding in ((clipped, "clipped"), (turned, "sign")):
        status, out, err = hybridsep("fit", log, "--out", tmp_path / "fit")
        assert (status, out) == (2, "")
        assert err.startswith(f"error: {log}: {finding}: ")
        assert err.count("error:") == 1
        assert err.count(log.name) == 1
        assert "Fix: " in err
        assert "(--fix does it)" in err


def test_exchanged_columns_are_said(hybridsep: Run, tmp_path: Path) -> None:
    """They were printed as handled, and not among the sources."""
    path = write_log(tmp_path / "axis.csv", header="t,x,x_d")
    used, findings = take_in([read_log(path, uniform=False)], fix=True)
    (finding,) = findings["axis.csv"]
    assert str(finding).startswith("fixed: columns swapped: ")
    assert changes(findings) == [
        "axis.csv: columns swapped: exchange the commanded and the measured position; the controller must do the same"
    ]
    assert changed_by(findings["axis.csv"]) == ", positions changed (--fix: columns swapped)"
    assert changed_by([]) == ""
    np.testing.assert_allclose(used[0].x_d, commanded()[:2500])
    status, out, err = hybridsep("backtest", path, *MACHINE, "--fix")
    assert status == 0, err
    assert "axis.csv, positions changed (--fix: columns swapped)" in " ".join(out.split())
