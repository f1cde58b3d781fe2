"""Limit of one BLAS thread for sequences of small matrix operations.

More threads are slower, above all on busy cores, and change the order of summation, so that results would depend on
the number of cores.
"""

import threading
from contextlib import ContextDecorator
from functools import cache

import scipy.linalg  # noqa: F401  # loads the libraries that are limited
from threadpoolctl import ThreadpoolController


class _OneThread(ContextDecorator):
    """Reentrant context manager and decorator; uses are counted, as the number of threads belongs to the process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._n_open = 0

    def __enter__(self) -> None:
        with self._lock:
            if self._n_open == 0:
                self._limit = _controller().limit(limits=1, user_api="blas")
            self._n_open += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._n_open -= 1
            if self._n_open == 0:
                self._limit.restore_original_limits()


@cache  # looking for the libraries takes milliseconds
def _controller() -> ThreadpoolController:
    return ThreadpoolController()


one_blas_thread = _OneThread()
"""Around a window or a whole run, after which the limit is as before: it costs 10 µs where more are set, else 1 µs."""
