"""Benchmarks: figures that the pages print, each beside its command; no part of the package."""

import os
import sys
from pathlib import Path

os.environ |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "support"))  # drives, and the C core for tests
