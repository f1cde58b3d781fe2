"""Run of a replayed log: its predictions as signals, for figures and files."""

from __future__ import annotations

import numpy as np

from ..base.signals import Array
from ..compensate.planning import SepState
from ..cosim.run import PREDICTOR, Run
from .backtest import Backtest

__all__ = ["replayed_run"]


def replayed_run(found: Backtest, x_d: Array, x_meas: Array, T_s: float, Np: int, *, measurement_delay: int = 0) -> Run:
    """Return the run of a replay, each measurement at the instant that it is of.

    Parameters
    ----------
    found : Backtest
    x_d, x_meas : (n,) array, m
        What was replayed; the true position of a recorded axis is NaN.
    T_s : float
        Sampling interval, s.
    Np : int
        Samples in a window.
    measurement_delay : int
        Samples by which measurements arrived late: measurements from before the log are left out.
    """
    n = max(len(x_meas) - measurement_delay, 0)
    arrived = slice(measurement_delay, None)
    return Run(
        kind=PREDICTOR,
        t=np.asarray(np.arange(n) * T_s, dtype=np.float64),
        x_d=x_d[:n],
        x_dm=x_d[:n],
        x=np.full(n, np.nan),
        x_meas=x_meas[arrived],
        x_pb=found.x_pb[arrived],
        x_h=found.x_h[arrived],
        x_h_std=found.x_h_std[arrived],
        state=np.where(found.active[arrived], SepState.HYBRID, SepState.PHYSICS),
        T_s=T_s,
        Np=Np,
        measurement_delay=measurement_delay,
    )
