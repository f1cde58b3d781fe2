"""Recordings to identify a model from, simulated: a log, a swept sine, a frequency response, accelerations.

``python examples/recordings_to_identify.py FOLDER`` writes ``log.csv`` (the paper's nonlinear drive on its staircase,
5 µm of noise), ``sweep.csv`` (the stage's X axis, Table 1: 60 s from 1 to 100 Hz, 1 % of noise) and ``frf.csv`` (the
same axis, 1 000 lines, 1 % of each line's magnitude as noise) and ``raw_data_x.csv`` (a printer with a resonance of
45 Hz as Klipper's accelerometer shows it).
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import chirp

from hybridsep import Encoder, ModalModel, Mode, load_machine, simulate, staircase

T_S = 1e-3


def main(folder: Path) -> None:
    """Write the four files."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(0)
    x_d = staircase(T_S)
    x = simulate(load_machine("spring_mass_damper").new_plant(), x_d, T_S)
    _write(
        folder / "log.csv", "t [s],x_d [m],x [m]", np.arange(len(x_d)) * T_S, x_d, Encoder(5e-6, seed=0).measure_all(x)
    )

    stage = load_machine("als25010_x").model
    t = np.arange(60_000) * T_S
    swept = 1e-3 * chirp(t, 1, 60, 100) * np.minimum(1, np.minimum(t, 60 - t) / 0.5)
    discrete = stage.discretise(T_S)
    response = discrete.forced_response(discrete.rest(), swept)[0]
    response += 0.01 * response.std() * rng.standard_normal(len(t))
    _write(folder / "sweep.csv", "t [s],x_d [m],x [m]", t, swept, response)

    f = np.linspace(1, 100, 1000)
    G = stage.frequency_response(2 * np.pi * f)
    G = G * (1 + 0.01 * (rng.standard_normal(1000) + 1j * rng.standard_normal(1000)) / np.sqrt(2))
    _write(folder / "frf.csv", "frequency [Hz],real,imag", f, G.real, G.imag)

    t = np.arange(0, 16, 1 / 3200)
    printer = ModalModel([Mode(45.0, 0.08, (2 * np.pi * 45.0) ** 2)]).discretise(1 / 3200)
    rising = 75 * (5 + 8 * t) * chirp(t, 5, 16, 133)  # mm/s², 75 mm/s² a Hz as Klipper does
    shaken = printer.forced_response(printer.rest(), rising)[0]
    axes = [part * shaken + 50 * rng.standard_normal(len(t)) for part in (1.0, 0.1, 0.0)]
    _write(folder / "raw_data_x.csv", "#time,accel_x,accel_y,accel_z", t, *axes)


def _write(path: Path, header: str, *columns: NDArray[np.floating[Any]]) -> None:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.9g")
    print(f"{path}: {len(columns[0])} rows")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
