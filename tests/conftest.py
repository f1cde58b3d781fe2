"""Set up what every test shares."""

from __future__ import annotations

import os

# Threads make the small factorisations of these tests slower by two orders of magnitude on a busy machine. The
# variable must be set before NumPy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
