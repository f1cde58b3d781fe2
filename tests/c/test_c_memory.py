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
def test_no_allocation_in_100_000_rows_and_10_000_steps() -> None:
    command = [sys.executable, str(LONG_RUN), "--samples", "100000", "--steps", "10000"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"held +0 calls of the allocator after the initialization", done.stdout)
    assert done.stdout.count("held") == 3
