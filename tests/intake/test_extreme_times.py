"""Times that no clock has: refused in one line, or a gap as any other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from log_files import columns, write

from hybridsep.base.errors import LogError
from hybridsep.intake.check import check
from hybridsep.logs.log import read_log


@pytest.mark.parametrize("uniform", [True, False])
@pytest.mark.parametrize("time", [1e16, -1e308, 1.7e308])
def test_times_that_no_clock_has(tmp_path: Path, time: float, uniform: bool) -> None:
    data = columns(50)
    data["t"][7] = time
    path = write(tmp_path / "log.npz", data)
    with pytest.raises(LogError, match=r"sample 8 .*: time 't' must be within ±1e\+15 s, got -?1"):
        read_log(path, uniform=uniform)


@pytest.mark.parametrize("interval", [1e-300, 1e-12, 1e-3])
def test_a_gap_of_any_length(tmp_path: Path, interval: float) -> None:
    """Where more samples are missing than a whole number can count, the fix ended with an IndexError."""
    data = columns(200)
    data["t"] = interval * np.arange(200.0)
    data["t"][150:] += 1e14
    log = read_log(write(tmp_path / "log.npz", data), uniform=False)
    intake = check(log)
    assert "gaps" in [finding.name for finding in intake.findings]
