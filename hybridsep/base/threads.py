"""Limit of one BLAS thread for sequences of small matrix operations.

More threads are slower, above all on busy cores, and change the order of summation, so that results would depend on
the number of cores.
"""

from __future__ import annotations

import threading
from contextlib import ContextDecorator
from functools import cache

import scipy.linalg  # noqa: F401  # loads the libraries that are limited
from threadpoolctl import LibController, ThreadpoolController

__all__ = ["one_blas_thread"]


@cache
def _libraries() -> tuple[LibController, ...]:
    """Return the BLAS libraries of NumPy and SciPy; looking for them takes milliseconds."""
    return tuple(one for one in ThreadpoolController().lib_controllers if one.user_api == "blas")


class _OneThread(ContextDecorator):
    """Reentrant context manager and decorator; uses are counted, as the number of threads belongs to the process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._n_open = 0
        self._before: list[tuple[LibController, int]] = []

    def __enter__(self) -> None:
        with self._lock:
            if self._n_open == 0:
                threads = [(library, library.get_num_threads()) for library in _libraries()]
                self._before = [(library, n) for library, n in threads if n is not None and n > 1]
                for library, _ in self._before:
                    library.set_num_threads(1)
            self._n_open += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._n_open -= 1
            if self._n_open == 0:
                for library, n in self._before:
                    library.set_num_threads(n)


one_blas_thread = _OneThread()
"""Around a window or a whole run: it costs 10 µs where more threads are set, 1 µs where one is, or within another use.

The previous limit is restored.
"""
