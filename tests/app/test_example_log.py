"""``hybridsep example-log`` and the log that it writes."""

from pathlib import Path

import example_log
import numpy as np
import pytest
from command_line import Run

from hybridsep import read_log
from hybridsep.logs.checks import check
from hybridsep.logs.formats import EXAMPLE


def test_it_is_written_and_read(hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert hybridsep("example-log") == (0, "example_axis.csv\n", "")
    assert hybridsep("example-log", "--out", "logs/other.csv.gz")[0] == 0
    log = read_log("example_axis.csv")
    assert (len(log.t), log.T_s, log.unit, log.unit_stated) == (20_000, 1e-3, "m", True)
    assert check(log) == ()
    np.testing.assert_array_equal(read_log("logs/other.csv.gz").x_meas, log.x_meas)
    assert EXAMPLE.stat().st_size < 300_000
    assert hybridsep("example-log")[0] == 2
    assert "--out must end in .csv or .gz, got 'log.mat'" in hybridsep("example-log", "--out", "log.mat")[2]


@pytest.mark.slow
def test_it_is_what_its_script_makes() -> None:
    log = read_log(EXAMPLE)
    t, x_d, x_meas = example_log.table().T
    np.testing.assert_allclose(log.t, t, atol=1e-12)
    np.testing.assert_allclose(1e3 * log.x_d, x_d, atol=1e-9)
    # A rounding to the encoder's resolution, 0.2 µm, may fall otherwise on another platform.
    np.testing.assert_allclose(1e3 * log.x_meas, x_meas, atol=2.1e-4)
