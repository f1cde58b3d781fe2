"""One BLAS thread while many small matrices are multiplied and factorised.

Threads make them slower, most of all where the cores are busy, and change the order of summation, so that results
depended on the number of cores; ``benchmarks/blas_threads.py`` measures both.
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
    """Context manager and decorator; the number of threads belongs to the process, so all that are open are one."""

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
"""Around a whole run, never around a sample: it costs some 50 µs. What was set before is restored."""
