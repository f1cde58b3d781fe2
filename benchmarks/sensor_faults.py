"""Faults of a position sensor; each returns the faulty measurement and the index of its last faulty sample."""

from collections.abc import Callable

import numpy as np

from hybridsep.base.signals import Array

Fault = Callable[[Array, float, np.random.Generator], tuple[Array, int]]
"""From measured positions, (n,), m, the sampling interval, s, and random numbers, to faulty positions and the index of
the last faulty sample; for an offset step the index of the first shifted sample, as the shifted position is true from
there on."""


def outliers(x_meas: Array, T_s: float, rng: np.random.Generator) -> tuple[Array, int]:
    """Return 1 to 5 single samples wrong by 10 µm to 1 m."""
    faulty = x_meas.copy()
    at = rng.choice(np.arange(*_span(len(x_meas))), size=rng.integers(1, 6), replace=False)
    faulty[at] += rng.choice((-1.0, 1.0), len(at)) * 10 ** rng.uniform(-5, 0, len(at))
    return faulty, int(at.max())


def zeros(x_meas: Array, T_s: float, rng: np.random.Generator) -> tuple[Array, int]:
    """Return a measurement that reads 0 for 50 ms."""
    return _reads(x_meas, 0.0, round(0.05 / T_s), rng)


def zeros_for_long(x_meas: Array, T_s: float, rng: np.random.Generator) -> tuple[Array, int]:
    """Return a measurement that reads 0 for 0.5 s."""
    return _reads(x_meas, 0.0, round(0.5 / T_s), rng)


def missing_for_long(x_meas: Array, T_s: float, rng: np.random.Generator) -> tuple[Array, int]:
    """Return a measurement that is missing (NaN) for 0.1 s."""
    return _reads(x_meas, np.nan, round(0.1 / T_s), rng)


def stuck(x_meas: Array, T_s: float, rng: np.random.Generator) -> tuple[Array, int]:
    """Return a measurement that repeats its value for 0.5 s."""
    k, n = int(rng.integers(*_span(len(x_meas)))), round(0.5 / T_s)
    faulty = x_meas.copy()
    faulty[k + 1 : k + 1 + n] = x_meas[k]
    return faulty, k + n


def offset_step(x_meas: Array, T_s: float, rng: np.random.Generator) -> tuple[Array, int]:
    """Return a measurement shifted by 10 µm to 10 mm from one sample on."""
    k = int(rng.integers(*_span(len(x_meas))))
    faulty = x_meas.copy()
    faulty[k:] += rng.choice((-1.0, 1.0)) * 10 ** rng.uniform(-5, -2)
    return faulty, k


def missing(x_meas: Array, T_s: float, rng: np.random.Generator) -> tuple[Array, int]:
    """Return a measurement with 1 % of the samples missing (NaN) up to the end of the span of faults."""
    end = _span(len(x_meas))[1]
    at = rng.choice(end, size=max(1, end // 100), replace=False)
    faulty = x_meas.copy()
    faulty[at] = np.nan
    return faulty, int(at.max())


def jitter(x_meas: Array, T_s: float, rng: np.random.Generator) -> tuple[Array, int]:
    """Return samples taken at instants that are off by 5 % of the sampling interval (standard deviation)."""
    n = len(x_meas)
    instants = np.arange(n) + 0.05 * rng.standard_normal(n)
    return np.interp(instants, np.arange(n), x_meas), n - 1


OFFSET_STEP, JITTER = "offset step", "5 % jitter"

FAULTS: dict[str, Fault] = {
    "outliers of 10 µm to 1 m": outliers,
    "reads 0 for 50 ms": zeros,
    "reads 0 for 0.5 s": zeros_for_long,
    "missing for 0.1 s": missing_for_long,
    "stuck for 0.5 s": stuck,
    OFFSET_STEP: offset_step,
    "1 % missing": missing,
    JITTER: jitter,
}


def _span(n: int) -> tuple[int, int]:
    """Return the samples in which faults begin: a tenth to a half of a run, so that there is a time after them."""
    return n // 10, n // 2


def _reads(x_meas: Array, reading: float, n: int, rng: np.random.Generator) -> tuple[Array, int]:
    """Return a measurement that is something else over ``n`` samples."""
    k = int(rng.integers(*_span(len(x_meas))))
    faulty = x_meas.copy()
    faulty[k : k + n] = reading
    return faulty, k + n - 1
