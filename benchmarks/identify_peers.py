"""Output error against SIPPY's, on a simulated axis and on the recorded one if it is there: poles, error, time.

SIPPY (``sippy_unipi``, extra ``benchmark``) fits ``x = B(z)/F(z) x_d`` by a nonlinear programme over all samples.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io

from hybridsep import PAPER_LIMITS, ModalModel, Mode, rest_to_rest
from hybridsep.base.signals import Array
from hybridsep.identify.operation import identify_operation

EMPS = Path(__file__).resolve().parents[2] / "shared" / "data" / "emps" / "DATA_EMPS.mat"


NOISES = 5
"""Noises of the simulated axis, whose estimates show each package's own spread."""


def simulated(seed: int) -> tuple[Array, Array, float]:
    """Return a second-order axis, 20 Hz and ζ = 0.4, with 1 µm of noise."""
    T_s = 1e-3
    targets = np.concatenate(([0.0], np.random.default_rng(0).uniform(-2.5e-3, 2.5e-3, 8)))
    x_d = rest_to_rest(targets, PAPER_LIMITS, T_s, start_times=[0.1 + 0.25 * i for i in range(8)], duration=2.2)
    discrete = ModalModel([Mode(20.0, 0.4, (40 * np.pi) ** 2)]).discretise(T_s)
    x = discrete.forced_response(discrete.rest(), x_d)[0]
    return x_d, x + 1e-6 * np.random.default_rng(seed).standard_normal(len(x)), T_s


def ours(x_d: Array, x: Array, T_s: float) -> tuple[float, float, float, float]:
    """Return f_n, ζ, RMS error, m, and time, s, of the structure that was chosen among all of second order."""
    start = time.perf_counter()
    found = identify_operation([(x_d, x)], T_s, order_max=2)
    mode = found.model.modes[0]
    return mode.f_n, mode.zeta, found.rms, time.perf_counter() - start


def peer(x_d: Array, x: Array, T_s: float) -> tuple[float, float, float, float]:
    """Return the same of SIPPY's second-order model , whose B begins with one sample of delay."""
    from sippy_unipi import system_identification

    scale = 1.0 / np.std(x_d)
    start = time.perf_counter()
    found: Any = system_identification(
        (x - x_d[0]) * scale, (x_d - x_d[0]) * scale, "OE", OE_orders=[2, 2, 0], tsample=T_s, max_iterations=300
    )
    elapsed = time.perf_counter() - start
    poles = np.asarray(found.G.poles(), dtype=complex)
    poles = np.log(poles[poles != 0])
    pole = poles[np.argmax(poles.imag)] / T_s
    rms = float(np.std(found.Yid.ravel() / scale - (x - x_d[0])))
    return abs(pole) / (2 * np.pi), -pole.real / abs(pole), rms, elapsed


def main() -> None:
    """Print both packages' figures."""
    cases = {"simulated": [simulated(seed) for seed in range(NOISES)]}
    if EMPS.is_file():
        data = io.loadmat(EMPS)
        cases["EMPS, 4 s"] = [(data["qg"].ravel()[:4000], data["qm"].ravel()[:4000], 1e-3)]
    for case, recordings in cases.items():
        for package, fit in (("hybridsep", ours), ("SIPPY", peer)):
            figures = np.array([fit(*recording) for recording in recordings])
            (f_n, zeta, rms, elapsed), spread = figures.mean(axis=0), figures.std(axis=0)
            print(
                f"{case:10} {package:10} f_n {f_n:.4f} ± {spread[0]:.4f} Hz, ζ {zeta:.5f} ± {spread[1]:.5f}, "
                f"RMS {1e6 * rms:.3f} µm, {elapsed:.1f} s"
            )


if __name__ == "__main__":
    main()
