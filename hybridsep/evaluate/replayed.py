"""Run of a replayed log: its predictions as signals, for figures and files."""

from __future__ import annotations

import numpy as np

from ..base.signals import Array
from ..compensate.plan import SepState
from ..cosim.run import PREDICTOR, Run
from .backtest import Backtest

__all__ = ["replayed_run"]


def replayed_run(found: Backtest, x_d: Array, x_meas: Array, T_s: float, Np: int) -> Run:
    """Return the run of a replay.

    Parameters
    ----------
    found : Backtest
    x_d, x_meas : (n,) array, m
        What was replayed; the true position of a recorded axis is NaN.
    T_s : float
        Sampling interval, s.
    Np : int
        Samples in a window.
    """
    return Run(
        kind=PREDICTOR,
        t=np.asarray(np.arange(len(x_meas)) * T_s, dtype=np.float64),
        x_d=x_d,
        x_dm=x_d,
        x=np.full(len(x_meas), np.nan),
        x_meas=x_meas,
        x_pb=found.x_pb,
        x_h=found.x_h,
        x_h_std=found.x_h_std,
        state=np.where(found.active, SepState.HYBRID, SepState.PHYSICS),
        T_s=T_s,
        Np=Np,
    )
