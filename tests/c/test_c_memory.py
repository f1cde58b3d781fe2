"""The C core takes no memory after its initialization, whatever the C library does inside: malloc itself is counted."""

from __future__ import annotations

import platform
import re
import subprocess
import sys

import numpy as np
import pytest
from places import ROOT

LONG_RUN = ROOT / "benchmarks" / "long_run" / "run.py"


@pytest.mark.skipif(
    platform.libc_ver()[0] != "glibc" or np.finfo(np.longdouble).eps > 2e-19,
    reason="the program stands in for glibc's malloc, and the exact weights need x86's extended precision",
)
@pytest.mark.slow
@pytest.mark.parametrize("tenths", [1, pytest.param(10, marks=pytest.mark.nightly)])
def test_no_allocation_and_no_drift_in_many_rows_and_steps(tenths: int) -> None:
    """Of 10 000 rows and 10⁶ steps of each model, at night of ten times as many; and no error that grows."""
    command = [sys.executable, str(LONG_RUN), "--samples", str(10_000 * tenths), "--steps", str(1_000_000 * tenths)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"held +0 calls of the allocator after the initialization", done.stdout)
    assert done.stdout.count("held") == 5
