"""The example log that ships with the package: a simulated ball-screw axis, 20 s at 1 kHz.

The drive is nobody's: a well-damped mode of 28 Hz and a light one of 74 Hz, friction and cable stiffness, an encoder
with 0.6 µm of noise and a resolution of 0.2 µm. The command visits random places within 80 mm at random speeds, rests,
and ends with small steps. Without options it is compared with ``hybridsep/logs/example_axis.csv.gz``, with ``--write``
written there.
"""

from __future__ import annotations

import argparse
import gzip
import io
import math
from collections.abc import Sequence

import numpy as np

from hybridsep import Limits, ModalModel, Mode, read_log, rest_to_rest, simulate
from hybridsep.base.files import write_whole
from hybridsep.base.signals import Array
from hybridsep.logs.formats import EXAMPLE
from hybridsep.plants.stage_drive import StageDrive

HEAD = """# example log of hybridsep: a simulated ball-screw axis, 20 s at 1 kHz
t [s],x_d [mm],x_meas [mm]"""

T_S = 1e-3  # s
N_SAMPLES = 20_000
SEED = 20
START = 0.12  # m
TRAVEL = 0.08  # m
NOISE, RESOLUTION = 6e-7, 2e-7  # m
FRICTION, CABLE = 1.8e-5, 0.02  # m, 1/m: offsets of the command


def drive() -> StageDrive:
    """Return the axis."""
    slow, fast = 2 * math.pi * 28.0, 2 * math.pi * 74.0
    modes = [Mode(28.0, 0.62, 0.94 * slow**2, 0.25 * slow), Mode(74.0, 0.06, 0.06 * fast**2, 0.0)]
    return StageDrive(ModalModel(modes), FRICTION, CABLE, T_S)


def command(random: np.random.Generator) -> Array:
    """Return the commanded positions, (20000,), m."""
    here, parts, length = START, [np.full(300, START)], 300
    while length < N_SAMPLES:
        small = length > 0.85 * N_SAMPLES
        there = here + random.choice((-1, 1)) * 5e-4 if small else START + TRAVEL * random.uniform(-0.5, 0.5)
        speed = math.exp(random.uniform(math.log(0.02), math.log(0.25)))
        limits = Limits(velocity=speed, acceleration=random.uniform(1.0, 6.0), jerk=random.uniform(50.0, 400.0))
        dwell = round(random.uniform(0.05, 0.35), 3)
        parts.append(rest_to_rest([here, there], limits, T_S, dwell=dwell))
        here, length = there, length + len(parts[-1])
    return np.concatenate(parts)[:N_SAMPLES]


def table() -> Array:
    """Return time, s, commanded and measured position, mm, as they are written, (20000, 3)."""
    random = np.random.default_rng(SEED)
    x_d = np.round(command(random), 7)  # what a controller records
    x = simulate(drive(), x_d, T_S) + random.normal(0.0, NOISE, N_SAMPLES)
    return np.column_stack((T_S * np.arange(N_SAMPLES), 1e3 * x_d, 1e3 * RESOLUTION * np.round(x / RESOLUTION)))


def main(arguments: Sequence[str] | None = None) -> None:
    """Compare, or write the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the file")
    made = table()
    if parser.parse_args(arguments).write:
        text = io.StringIO()
        np.savetxt(text, made, delimiter=",", fmt=("%.3f", "%.4f", "%.4f"), header=HEAD, comments="")
        write_whole(EXAMPLE, gzip.compress(text.getvalue().encode(), 9, mtime=0))
    log = read_log(EXAMPLE)
    shipped = np.column_stack((log.t, 1e3 * log.x_d, 1e3 * log.x_meas))
    print(f"{EXAMPLE}: {EXAMPLE.stat().st_size / 1e3:.0f} kB, differs by {1e3 * np.abs(shipped - made).max():.2g} µm")


if __name__ == "__main__":
    main()
