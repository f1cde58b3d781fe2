"""Limit of one BLAS thread for sequences of small matrix operations.

More threads are slower, above all on busy cores, and change the order of summation, so that results would depend on
the number of cores; ``benchmarks/blas_threads.py`` measures both.
"""

from __future__ import annotations

import threading
from contextlib import ContextDecorator
from functools import cache
from typing import Any

import scipy.linalg  # noqa: F401  # loads the libraries that are limited
from threadpoolctl import ThreadpoolController

__all__ = ["one_blas_thread"]


@cache
def _libraries() -> ThreadpoolController:
    """Return the BLAS libraries of NumPy and SciPy; looking for them takes milliseconds."""
    return ThreadpoolController()


class _OneThread(ContextDecorator):
    """Reentrant context manager and decorator; uses are counted, as the number of threads belongs to the process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._n_open = 0
        self._limit: Any = None

    def __enter__(self) -> None:
        with self._lock:
            if self._n_open == 0:
                self._limit = _libraries().limit(limits=1, user_api="blas")
            self._n_open += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._n_open -= 1
            if self._n_open == 0:
                self._limit.restore_original_limits()


one_blas_thread = _OneThread()
"""For a whole run, not for a sample: it costs some 50 µs. The previous limit is restored."""
