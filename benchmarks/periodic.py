"""Benchmark of a drive whose force repeats with the position, predicted with its period known and unknown.

    python -m benchmarks.periodic

RMS error of the hybrid in µm on random moves, cold, and in a second run with other moves from another start. The drive
is the staircase's without its cubic terms, plus a force that moves its position of rest by a sine of the position; the
noise is 1 µm.
"""

import math

import numpy as np
from rich.console import Console
from rich.table import Table

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import backtest
from hybridsep.model.physics import ModalModel
from hybridsep.plants.trajectory import PAPER_LIMITS, rest_to_rest
from hybridsep.predict.predictor import HybridPredictor

TS, NOISE = 1e-3, 1e-6
M, C, K = 1.0, 15.7, 24674.0
STARTS = (0.0, 0.0313)  # of the two runs, m: no whole number of any pitch apart
CASES = ((20e-6, 0.005), (50e-6, 0.02), (5e-6, 0.001))  # amplitudes and pitches, m


def moves(amplitude: float, pitch: float, start: float, seed: int) -> tuple[Array, Array]:
    """Return commands and measured positions of random moves of the drive, m.

    Parameters
    ----------
    amplitude, pitch : float, m
        By which the force moves the position of rest, and after which it repeats.
    start : float, m
        Position of rest at the beginning.
    seed : int
        Of moves and noise.
    """
    rng = np.random.default_rng(seed)
    stops = np.concatenate(([0.0], rng.uniform(-0.02, 0.02, 12)))
    x_d = start + rest_to_rest(stops, PAPER_LIMITS, TS, dwell=0.05)
    x, v, at_start = start, 0.0, math.sin(2.0 * math.pi * start / pitch)
    measured = np.empty(len(x_d))
    for k, command in enumerate(x_d.tolist()):
        measured[k] = x
        for _ in range(10):  # semi-implicit Euler, 0.1 ms
            offset = amplitude * (math.sin(2.0 * math.pi * x / pitch) - at_start)
            v += TS / 10.0 * (-C * v - K * (x - command - offset)) / M
            x += TS / 10.0 * v
    return x_d, measured + rng.normal(0.0, NOISE, len(x_d))


def new_predictor(period: float) -> HybridPredictor:
    """Return a predictor of the drive that knows the period, m, or none, 0."""
    return HybridPredictor(ModalModel.spring_mass_damper(m=M, c=C, k=K), PredictorSettings(p=20, period=period))


def errors(amplitude: float, pitch: float, period: float, starts: tuple[float, float] = STARTS) -> list[float]:
    """Return the RMS errors of two runs, one after the other, µm."""
    predictor, found = new_predictor(period), []
    for seed, start in enumerate(starts, start=1):
        predictor.restart(start)
        found.append(1e6 * backtest(predictor, *moves(amplitude, pitch, start, seed)).overall.h.rms)
    return found


def main() -> None:
    table = Table(title="RMS of x_meas − x_h, µm, cold and second run; noise 1 µm")
    for heading in ("amplitude, µm", "pitch, mm", "physics", "hold", "period unknown", "period given"):
        table.add_column(heading, justify="right")
    for amplitude, pitch in CASES:
        peers = backtest(new_predictor(0.0), *moves(amplitude, pitch, STARTS[0], 1)).overall
        shown = [" / ".join(f"{error:.2f}" for error in errors(amplitude, pitch, one)) for one in (0.0, pitch)]
        sizes = (1e6 * amplitude, 1e3 * pitch, 1e6 * peers.pb.rms, 1e6 * peers.hold.rms)
        table.add_row(*(f"{size:.4g}" for size in sizes), *shown)
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
