"""Hold that backtest and report print of every recording, against a few lines on the columns that are written."""

from __future__ import annotations

from pathlib import Path

import pytest
from places import EMPS, RECORDINGS

from benchmarks import hold

LOGS = [EMPS, *(sorted(RECORDINGS.glob("*.csv")) if RECORDINGS.is_dir() else []), RECORDINGS / "cnc_a_capture.json"]
EACH_KIND = ("cnc_a_axis1", "cnc_a_capture", "xl330_kp100_raw_jitter")
"""A recording of each device and reader; of all recordings at night."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "log",
    [pytest.param(log, id=log.stem, marks=[] if log.stem in EACH_KIND else [pytest.mark.nightly]) for log in LOGS],
)
def test_hold_is_what_follows_from_the_columns_of_a_recording(log: Path, tmp_path: Path) -> None:
    if not log.is_file():
        pytest.skip("the recorded axes are not here: ../shared/data, beside the repository")
    machine: str | Path = "emps"
    if log != EMPS:
        machine = tmp_path / "lag.toml"
        rate = 0.002 if log.stem.startswith("cnc") else 0.0053
        lag = ("--name", "lag", "--model", "lag", "--tau", 0.05, "--dead-time", 1, "--hold", "zoh", "--Np", 20)
        hold.hybridsep("init", machine, *lag, "--T_s", rate)
    Np = 100 if log == EMPS else 20  # in windows of 20 it would take as long as all others together
    found = dict(hold.of_replay(log, machine, tmp_path, Np))
    assert set(found) == {"columns", "backtest", "windows", "report"}
    assert max(found.values()) < 1e-12
