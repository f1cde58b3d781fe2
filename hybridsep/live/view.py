"""Signals that the page draws, of the rows of a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.signals import Array
from ..logs.units import Shown
from .core import Row

__all__ = ["COLUMNS", "names", "signals", "source_data", "table"]

COLUMNS = ("t", "x_d", "x_meas", "x_pb", "x_h", "x_h_std", "active", "step", "k")
"""Columns of a row as the page gets it; the shares of the experts follow."""

_BAND = 2.0
"""Half width of the band in standard deviations: 95 % of the samples, if they are distributed normally."""


def table(rows: list[Row]) -> Array:
    """Return rows as an array, ``(n, len(COLUMNS) + experts)``."""
    return np.array(
        [
            (row.t, row.x_d, row.x_meas, row.x_pb, row.x_h, row.x_h_std, row.active, row.step, row.k, *row.shares)
            for row in rows
        ]
    )


def signals(rows: Array, shown: Shown) -> Array:
    """Return what is drawn, ``(n, 13 + experts)``, by :func:`names`.

    Parameters
    ----------
    rows : (n, m) array
        As of :func:`table`.
    shown : Shown
        Units.
    """
    t, x_d, x_meas, x_pb, x_h, std, _, step, _ = rows.T[: len(COLUMNS)]
    position, error = shown.position[0], shown.small[0]
    half = np.where(std > 0.0, _BAND * error * std, np.nan)
    hybrid, miss = error * (x_h - x_d), error * (x_meas - x_h)
    return np.column_stack(
        (
            *(t, position * x_d, position * x_meas),
            *(error * (x_meas - x_d), error * (x_pb - x_d), hybrid, hybrid - half, hybrid + half),
            *(error * (x_meas - x_pb), miss, -half, half),
            1e6 * step,
            np.cumsum(rows[:, len(COLUMNS) :], axis=1),
        )
    )


def names(n_experts: int) -> list[str]:
    """Return the names of the columns of :func:`signals`."""
    drawn = ["t", "x_d", "x_meas", "e_meas", "e_pb", "e_h", "e_low", "e_high", "r_pb", "r_h", "r_low", "r_high", "step"]
    return drawn + [f"share{i}" for i in range(n_experts)]


def source_data(rows: Array, n_experts: int) -> dict[str, Any]:
    """Return columns as the page's source takes them: single precision but for the time."""
    columns = dict(zip(names(n_experts), rows.T, strict=True))
    return {name: column.copy() if name == "t" else column.astype(np.float32) for name, column in columns.items()}
